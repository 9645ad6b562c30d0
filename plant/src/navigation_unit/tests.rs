use contract::message::{Actuators, Stamp};
use navigation::Source;
use navigation::state::ATTITUDE;
use settings::{Fault, FaultKind, FaultTarget, Flow, Receiver, SensorPreset, SensorsSettings};

use super::*;
use crate::Plant;

/// Scenario with the sensors of `preset`, and the EKF.
fn with(preset: SensorPreset) -> Scenario {
    let mut scenario = Scenario::default();
    scenario.plant.sensors = SensorsSettings { filter: FilterName::Ekf, ..SensorsSettings::from(preset) };
    scenario
}

/// Flies `scenario` for `ticks` near hover, with rotors that never rest; `look` sees every sample.
fn fly(scenario: &Scenario, ticks: u64, mut look: impl FnMut(&Plant, &Kinematics, &Kinematics)) {
    let mut plant = Plant::new(scenario);
    let trim = plant.sample().command_in_force;
    for tick in 1..=ticks {
        let mut command = trim;
        for (i, speed) in command.rotor_speed.iter_mut().enumerate() {
            *speed *= 1.0 + 0.01 * (tick as f64 / 9.0 + i as f64).sin();
        }
        let stamp = Stamp { tick: tick - 1, sequence: tick, ..Stamp::default() };
        plant.command(&Actuators { stamp, command, flags: 0 }, 0);
        plant.advance(1).expect("the tricopter never fails");
        let state = plant.sample();
        look(&plant, &state.measured, &plant.truth().actual);
    }
}

fn unit(plant: &Plant) -> &NavigationUnit {
    plant.navigation().expect("a unit")
}

/// Error of an estimate: position and velocity NED, attitude as a rotation vector in the estimate's body axes.
fn error(measured: &Kinematics, actual: &Kinematics) -> nalgebra::SVector<f64, 9> {
    state_of(measured).error_to(&state_of(actual)).fixed_rows::<9>(0).into_owned()
}

#[test]
fn without_errors_the_estimate_is_the_motion() {
    for rates in [(100, 250.0), (50, 1000.0), (400, 200.0), (100, 333.0)] {
        let mut scenario = with(SensorPreset::Ideal);
        (scenario.run.rate_hz, scenario.plant.sensors.imu.rate_hz) = rates;
        fly(&scenario, u64::from(rates.0) * 2, |_, measured, actual| {
            let off = error(measured, actual);
            assert!(off.amax() < if rates.0 > 200 { 1e-2 } else { 1e-4 }, "{rates:?}: {off}");
            let rates_off = Vector3::from(measured.rates_radps) - Vector3::from(actual.rates_radps);
            assert!(rates_off.amax() < 0.05, "{rates:?}: {rates_off}");
        });
    }
}

#[test]
fn val_errors_are_as_large_as_the_covariance_says() {
    for standing_s in [0.0, 5.0] {
        check_consistency(standing_s, 60);
    }
}

/// Checks the NEES of `seeds` flights of 3 s, after an alignment of `standing_s`.
fn check_consistency(standing_s: f64, seeds: u64) {
    let mut nees = 0.0;
    for seed in 0..seeds {
        let mut scenario = with(SensorPreset::Typical);
        scenario.run.seed = seed;
        scenario.plant.sensors.alignment.standing_s = standing_s;
        // The receiver's constant errors are noise to the filter, but these fast motions would reveal them as constant.
        scenario.plant.sensors.receiver = Receiver::default();
        fly(&scenario, 300, |plant, measured, actual| {
            if plant.tick == 300 {
                let covariance = unit(plant).covariance(plant.now_ns()).fixed_view::<9, 9>(0, 0).into_owned();
                let off = error(measured, actual);
                nees += off.dot(&covariance.cholesky().expect("a positive covariance").solve(&off)) / seeds as f64;
            }
        });
    }
    let bound = 4.0 * (2.0 * 9.0 / seeds as f64).sqrt();
    assert!((nees - 9.0).abs() < bound, "{standing_s} s: {nees} and not 9 +- {bound}");
}

#[test]
fn vibration_grows_with_the_rotor_speed() {
    let deviation = |share: f64| {
        let mut scenario = with(SensorPreset::Ideal);
        scenario.plant.sensors.imu.vibration_mps2 = 0.5;
        let (motion, mut actuators) = crate::vehicle::start(&scenario);
        actuators.rotor_speed = actuators.rotor_speed.map(|speed| speed * share);
        let mut random = Stream::Navigation.open(1);
        let mut instruments = Instruments::new(&scenario, &motion, 4_000_000, &mut random);
        let n = 2000;
        let squares = (1..=n).map(|k| {
            let (imus, _) = instruments.measure(k * 4_000_000, &motion, &actuators, &[0.0; 3], |_| {}, &mut random);
            let at_rest = state_of(&motion).attitude.inverse() * Vector3::new(0.0, 0.0, -scenario.airframe.g_mps2);
            (imus[0].specific_force_mps2 - at_rest).norm_squared() / 3.0
        });
        (squares.sum::<f64>() / n as f64).sqrt()
    };
    assert!(deviation(0.0) < 1e-12);
    assert!((deviation(1.0) / 0.5 - 1.0).abs() < 0.05 && (deviation(2.0) / 1.0 - 1.0).abs() < 0.05);
}

#[test]
fn sensor_faults_leave_the_estimate_finite() {
    let targets: Vec<_> =
        FaultTarget::ALL.map(|(target, _)| target).into_iter().filter(|it| it.is_a_sensor()).collect();
    for (target, kind) in targets.iter().flat_map(|target| target.kinds().iter().map(move |kind| (*target, *kind))) {
        let mut scenario = with(SensorPreset::Typical);
        scenario.plant.sensors.flow = Flow { rate_hz: 50.0, noise_density: 0.02 };
        scenario.fault = vec![Fault::new(target, kind, 0.5, Some(2.5))];
        fly(&scenario, 400, |_, measured, _| {
            let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = measured;
            let all = [position_m, velocity_mps, attitude_rad, rates_radps];
            assert!(all.iter().all(|numbers| numbers.iter().all(|number| number.is_finite())), "{target:?} {kind:?}");
        });
    }
}

#[test]
fn faults_act_on_the_sensors_and_the_estimate_bears_the_loss_of_the_receiver() {
    let fault = |target, kind| Fault { value: Some(5.0), ..Fault::new(target, kind, 1.0, Some(1.5)) };
    let flown = |faults: &[Fault], source: Source| {
        let scenario = Scenario { fault: faults.to_vec(), ..with(SensorPreset::Typical) };
        let (mut worst, mut refused, mut heading) = (0.0_f64, 0.0, 0.0_f64);
        fly(&scenario, 300, |plant, measured, actual| {
            let off = error(measured, actual);
            worst = worst.max(off.fixed_rows::<3>(0).norm());
            heading = heading.max(off.fixed_rows::<3>(ATTITUDE).norm());
            refused = unit(plant).navigation().filter().record(source).refused;
        });
        (worst, refused, heading)
    };
    let (worst, refused, heading) = flown(&[], Source::Position);
    assert!(worst < 0.8 && refused < 2.0 && heading < 0.15, "{worst} {refused} {heading}");
    let off = [FaultTarget::Position, FaultTarget::Velocity]
        .map(|target| Fault { value: None, ..fault(target, FaultKind::Off) });
    let (worst, refused, _) = flown(&off, Source::Position);
    assert!(worst < 1.5 && refused < 2.0, "{worst} {refused}");
    for (target, source) in [(FaultTarget::Position, Source::Position), (FaultTarget::Height, Source::Height)] {
        let (worst, refused, _) = flown(&[fault(target, FaultKind::Wrong)], source);
        assert!(worst < 0.8 && refused > 10.0, "5 m off are refused, not followed: {target:?} {worst} {refused}");
    }
    let (worst, ..) = flown(&[fault(FaultTarget::Acceleration, FaultKind::Wrong)], Source::Position);
    assert!(worst > 5.0, "nothing tells 5 m/s2 from a motion: {worst}");
}
