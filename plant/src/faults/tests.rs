use contract::message::{Actuators, Sample, Stamp};
use proptest::prelude::*;
use settings::{Fault, FaultKind, FaultTarget, Profile, Scenario};

use crate::Plant;

const SENSORS: [FaultTarget; 4] =
    [FaultTarget::Position, FaultTarget::Velocity, FaultTarget::Attitude, FaultTarget::Rates];
const TRUE_ONES: [FaultTarget; 6] = [
    FaultTarget::Rotor1,
    FaultTarget::Rotor2,
    FaultTarget::Rotor3,
    FaultTarget::Tilt,
    FaultTarget::Wind,
    FaultTarget::Payload,
];

/// All faults of `targets` from 0.2 s to 0.3 s, with saturation below the speeds of hover.
fn all(targets: &[FaultTarget]) -> Vec<Fault> {
    let fault = |target: FaultTarget, kind: FaultKind| Fault {
        value: (kind == FaultKind::Saturated).then_some(0.3),
        ..Fault::new(target, kind, 0.2, Some(0.1))
    };
    targets.iter().flat_map(|target| target.kinds().iter().map(|kind| fault(*target, *kind))).collect()
}

/// Scenario with noise, jitter and losses, so that every random stream is used.
fn scenario(faults: &[Fault], seed: u64) -> Scenario {
    let mut scenario = Scenario::from(Profile::Paper);
    scenario.run.seed = seed;
    scenario.run.command_jitter_ms = 8.0;
    scenario.run.command_drop_probability = 0.2;
    scenario.plant.noise.position_m = 0.01;
    scenario.plant.drag_linear_nspm = [0.1; 3];
    scenario.fault = faults.to_vec();
    scenario
}

/// Flies `scenario` for 0.4 s, rocking about hover.
fn fly(scenario: &Scenario) -> Vec<Sample> {
    fly_told(scenario, |_, _| ())
}

/// Flies `scenario` and calls `tell` before each sample.
fn fly_told(scenario: &Scenario, tell: impl Fn(u64, &mut Plant)) -> Vec<Sample> {
    let mut plant = Plant::new(scenario);
    let trim = plant.truth().actuators;
    let rate_hz = u64::from(scenario.run.rate_hz);
    (1..=rate_hz * 2 / 5)
        .map(|k| {
            let share = 1.0 + 0.05 * (k as f64 * 40.0 / rate_hz as f64).sin();
            let mut command = trim;
            command.rotor_speed.iter_mut().for_each(|omega| *omega *= share);
            command.tilt_rad *= share;
            plant.command(&Actuators { stamp: Stamp { sequence: k, ..Stamp::default() }, command, flags: 0 }, 0);
            plant.advance(1).unwrap();
            tell(k, &mut plant);
            Sample { state: plant.sample(), truth: plant.truth() }
        })
        .collect()
}

/// All bits of a sample except those of NaN.
fn written(sample: &Sample) -> String {
    format!("{sample:?}")
}

#[test]
fn no_fault_has_an_effect_before_its_onset() {
    let sound = fly(&scenario(&[], 7));
    for fault in all(&[&SENSORS[..], &TRUE_ONES[..]].concat()) {
        let faulty = fly(&scenario(std::slice::from_ref(&fault), 7));
        let same = |k: usize| written(&faulty[k]) == written(&sound[k]);
        // Element k is sample k + 1; a fault of the true vehicle at sample 20 shows at sample 21.
        assert!((0..19).all(same), "{fault:?} acts too early");
        assert!(!(19..30).all(same), "{fault:?} does nothing");
    }
}

#[test]
fn a_sensor_fault_changes_only_the_measurements() {
    let sound = fly(&scenario(&[], 7));
    for fault in all(&SENSORS) {
        let faulty = fly(&scenario(std::slice::from_ref(&fault), 7));
        for (k, (mut faulty, sound)) in faulty.into_iter().zip(&sound).enumerate() {
            if (19..29).contains(&k) {
                faulty.state.measured = sound.state.measured;
            }
            assert_eq!(written(&faulty), written(sound), "{fault:?} in element {k}");
        }
    }
}

#[test]
fn a_faulty_flight_repeats_with_its_seed() {
    for fault in all(&[&SENSORS[..], &TRUE_ONES[..]].concat()) {
        let fly = |seed: u64| -> Vec<String> {
            fly(&scenario(std::slice::from_ref(&fault), seed)).iter().map(written).collect()
        };
        assert_eq!(fly(1), fly(1), "{fault:?}");
        assert_ne!(fly(1), fly(2), "{fault:?}");
    }
}

#[test]
fn a_fault_given_or_ended_while_flying_is_the_same_as_one_of_the_scenario() {
    let of = |samples: Vec<Sample>| -> Vec<String> { samples.iter().map(written).collect() };
    for fault in all(&[&SENSORS[..], &TRUE_ONES[..]].concat()) {
        let cut = Fault { for_s: Some(0.05), ..fault };
        let given = |tick, plant: &mut Plant| {
            if tick == 19 {
                plant.apply_fault(0, &fault);
            }
        };
        let ended = |tick, plant: &mut Plant| {
            given(tick, plant);
            if tick == 24 {
                plant.apply_fault(0, &cut);
            }
        };
        assert_eq!(of(fly_told(&scenario(&[], 7), given)), of(fly(&scenario(&[fault], 7))), "{fault:?}");
        let (shorter, ended) = (of(fly(&scenario(&[cut], 7))), of(fly_told(&scenario(&[], 7), ended)));
        // The shape of a gust depends on its duration, so a gust that is cut off has the shape of a longer one.
        assert_eq!(shorter == ended, fault.kind != FaultKind::Gust, "{fault:?}");
    }
}

#[test]
fn left_out_samples_do_not_change_a_fault_of_the_true_vehicle() {
    for fault in all(&TRUE_ONES) {
        let mut scenario = Scenario::from(Profile::Paper);
        scenario.fault = vec![fault];
        let mut one_by_one = Plant::new(&scenario);
        let mut at_once = one_by_one.clone();
        for _ in 0..40 {
            one_by_one.advance(1).unwrap();
        }
        at_once.advance(40).unwrap();
        assert_eq!(one_by_one.sample(), at_once.sample());
    }
}

#[test]
fn a_fault_acts_alike_at_every_rate_and_substep() {
    for kind in [(FaultTarget::Rotor1, FaultKind::Off), (FaultTarget::Wind, FaultKind::Gust)] {
        let height = |rate_hz: u32, substep_s: f64| {
            let mut scenario = Scenario::from(Profile::Paper);
            scenario.run.rate_hz = rate_hz;
            scenario.plant.substep_s = substep_s;
            scenario.plant.drag_linear_nspm = [0.1; 3];
            scenario.fault = vec![Fault::new(kind.0, kind.1, 0.1, Some(0.1))];
            let mut plant = Plant::new(&scenario);
            plant.advance(u64::from(rate_hz) * 3 / 10).unwrap();
            plant.truth().actual.velocity_mps
        };
        let expected = height(100, 0.001);
        for (rate_hz, substep_s) in [(50, 0.001), (50, 0.02), (100, 0.003), (250, 0.001), (2000, 0.001)] {
            let got = height(rate_hz, substep_s);
            let off = got.iter().zip(expected).map(|(g, e)| (g - e).abs()).fold(0.0, f64::max);
            assert!(off < 1e-3, "{kind:?} at {rate_hz} Hz in steps of {substep_s} s is off by {off}");
        }
    }
}

proptest! {
    /// For any faults, sizes and rates nothing panics, and a flight with numbers that are not finite has diverged.
    #[test]
    fn any_fault_leaves_the_state_finite_or_diverged(
        value in prop::num::f64::ANY,
        vector in prop::array::uniform3(prop::num::f64::ANY),
        ms in 0.0..60_000.0,
        rate_hz in prop::sample::select(vec![50u32, 100, 250, 2000]),
        substep_s in 0.0002..0.02,
        chosen in prop::sample::subsequence(all(&[&SENSORS[..], &TRUE_ONES[..]].concat()), 0..5),
    ) {
        let mut scenario = scenario(&chosen, 3);
        scenario.run.rate_hz = rate_hz;
        scenario.plant.substep_s = substep_s;
        for fault in &mut scenario.fault {
            (fault.value, fault.vector, fault.ms) = (Some(value), Some(vector), Some(ms));
        }
        for Sample { state, truth } in fly(&scenario) {
            let motion = truth.actual;
            let groups = [motion.position_m, motion.velocity_mps, motion.attitude_rad, motion.rates_radps];
            prop_assert!(groups.iter().flatten().all(|value| value.is_finite()) || state.status >= 2);
        }
    }
}
