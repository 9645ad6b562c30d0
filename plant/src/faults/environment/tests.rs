use super::*;
use crate::Plant;

const MS: u64 = 1_000_000;

fn faults(faults: &[Fault]) -> EnvironmentFaults {
    let scenario = Scenario { fault: faults.to_vec(), ..Scenario::default() };
    EnvironmentFaults::new(&scenario)
}

fn fault(target: FaultTarget, kind: FaultKind, for_s: Option<f64>) -> Fault {
    Fault::new(target, kind, 1.0, for_s)
}

/// Wind towards north at `time_ns`, the beginning of an integration step.
fn wind_mps(faults: &EnvironmentFaults, time_ns: u64) -> f64 {
    faults.inject(time_ns, 0.0, &Surroundings::default()).wind_mps.x
}

#[test]
fn a_step_is_there_from_its_first_sample_to_its_end() {
    let lasting = faults(&[fault(FaultTarget::Wind, FaultKind::Step, Some(0.5))]);
    let at = [999, 1000, 1001, 1499, 1500].map(|ms| wind_mps(&lasting, ms * MS));
    assert_eq!(at, [0.0, 5.0, 5.0, 5.0, 0.0]);
    let endless = faults(&[fault(FaultTarget::Wind, FaultKind::Step, None)]);
    assert_eq!(wind_mps(&endless, 1_000_000 * MS), 5.0);
    let vector = Some([0.0, -2.0, 1.0]);
    let own = faults(&[Fault { vector, ..fault(FaultTarget::Wind, FaultKind::Step, None) }]);
    assert_eq!(own.inject(1000 * MS, 0.0, &Surroundings::default()).wind_mps, Vector3::new(0.0, -2.0, 1.0));
}

#[test]
fn a_gust_rises_to_its_peak_and_falls_as_one_minus_cosine() {
    for (for_s, duration_ms) in [(None, 2000), (Some(0.4), 400)] {
        let gust = faults(&[fault(FaultTarget::Wind, FaultKind::Gust, for_s)]);
        let at = |share: f64| wind_mps(&gust, 1000 * MS + (share * f64::from(duration_ms)) as u64 * MS);
        assert_eq!([at(-0.1), at(0.0), at(1.0), at(1.1)], [0.0; 4]);
        for (share, expected) in [(0.25, 2.5), (0.5, 5.0), (0.75, 2.5)] {
            assert!((at(share) - expected).abs() < 1e-14, "{} at {share}", at(share));
        }
        assert!((1..10).all(|k| at(0.05 * f64::from(k)) > at(0.05 * f64::from(k - 1))), "it only rises to its peak");
    }
}

#[test]
fn a_step_that_rises_takes_its_time_and_stays() {
    let rising = faults(&[Fault { ms: Some(400.0), ..fault(FaultTarget::Wind, FaultKind::Step, None) }]);
    for (ms, expected) in [(999, 0.0), (1000, 0.0), (1200, 2.5), (1400, 5.0), (9000, 5.0)] {
        assert!((wind_mps(&rising, ms * MS) - expected).abs() < 1e-12, "at {ms} ms");
    }
}

#[test]
fn a_gust_goes_on_inside_a_step() {
    let gust = faults(&[fault(FaultTarget::Wind, FaultKind::Gust, None)]);
    let inside = gust.inject(1300 * MS, 0.004, &Surroundings::default()).wind_mps.x;
    assert!((inside - wind_mps(&gust, 1304 * MS)).abs() < 1e-14 && inside > wind_mps(&gust, 1300 * MS));
    // A flight through the gust hardly depends on the integration step; a gust held over each step would be 2 % off.
    let fly = |substep_s: f64| {
        let mut scenario = Scenario::default();
        scenario.plant.substep_s = substep_s;
        scenario.plant.drag_linear_nspm = [0.3; 3];
        scenario.plant.rotor_effectiveness = [0.0; 3];
        scenario.fault = vec![Fault::new(FaultTarget::Wind, FaultKind::Gust, 0.1, Some(0.2))];
        let mut plant = Plant::new(&scenario);
        plant.advance(40).unwrap();
        plant.truth().actual.position_m[0]
    };
    let (coarse, fine) = (fly(0.01), fly(0.001));
    assert!(fine > 0.02 && (coarse - fine).abs() < 1e-7 * fine, "{coarse} or {fine}");
}

#[test]
fn winds_and_masses_add_up() {
    let all = faults(&[
        fault(FaultTarget::Wind, FaultKind::Step, None),
        Fault { vector: Some([0.0, 1.0, 0.0]), ..fault(FaultTarget::Wind, FaultKind::Gust, Some(1.0)) },
        fault(FaultTarget::Payload, FaultKind::Mass, None),
        Fault { value: Some(0.3), ..fault(FaultTarget::Payload, FaultKind::Mass, None) },
    ]);
    let calm = Surroundings { wind_mps: Vector3::new(1.0, 1.0, 1.0), ..Surroundings::default() };
    let outside = all.inject(1500 * MS, 0.0, &calm);
    assert!((outside.wind_mps - Vector3::new(6.0, 2.0, 1.0)).norm() < 1e-14);
    assert!((outside.payload_kg - 0.5).abs() < 1e-15);
    assert_eq!(all.inject(999 * MS, 0.0, &calm), calm);
}

#[test]
fn a_payload_sinks_by_its_share_of_gravity() {
    let scenario =
        Scenario { fault: vec![Fault::new(FaultTarget::Payload, FaultKind::Mass, 0.1, None)], ..Scenario::default() };
    let mut plant = Plant::new(&scenario);
    let (mass, payload) = (scenario.airframe.mass_kg, PAYLOAD_KG);
    plant.advance(10).unwrap();
    assert!(plant.truth().actual.velocity_mps.iter().all(|v| v.abs() < 1e-9), "not before it is taken up");
    plant.advance(20).unwrap();
    let motion = plant.truth().actual;
    let sunk = 0.5 * scenario.airframe.g_mps2 * payload / (mass + payload) * 0.2 * 0.2;
    assert!((motion.position_m[2] - sunk).abs() < 1e-9, "{} instead of {sunk}", motion.position_m[2]);
    assert!(motion.rates_radps.iter().all(|rate| rate.abs() < 1e-9), "it hangs at the centre of mass");
}
