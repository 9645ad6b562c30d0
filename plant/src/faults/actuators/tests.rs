use contract::message::{Actuators, Stamp, Truth};

use super::*;
use crate::Plant;

const TARGETS: [FaultTarget; 4] = [FaultTarget::Rotor1, FaultTarget::Rotor2, FaultTarget::Rotor3, FaultTarget::Tilt];
const POSITION: [f64; 4] = [1400.0, 1300.0, 1350.0, 0.5];
const COMMAND: [f64; 4] = [1500.0, 1200.0, 2600.0, 0.9];

fn actuation([o1, o2, o3, tilt_rad]: [f64; 4]) -> Actuation {
    Actuation { rotor_speed: [o1, o2, o3], tilt_rad }
}

/// Fault from 0.1 s on, tick 10.
fn fault(target: FaultTarget, kind: FaultKind, value: Option<f64>) -> Fault {
    Fault { value, ..Fault::new(target, kind, 0.1, None) }
}

/// Command that the actuators follow at `tick` with `faults`, and their condition.
fn faulted(faults: &[Fault], tick: u64) -> ([f64; 4], Condition) {
    let scenario = Scenario { fault: faults.to_vec(), ..Scenario::default() };
    let mut faults = ActuatorFaults::new(&scenario);
    let (target, condition) = faults.inject(tick, &actuation(POSITION), &actuation(COMMAND));
    (bytemuck::cast(target), condition)
}

/// Flies a changed vehicle from hover at 100 Hz; every 0.1 s the rotors are commanded 10 % faster or slower, with tilt.
fn fly(change: impl Fn(&mut Scenario)) -> Vec<Truth> {
    let mut scenario = Scenario::default();
    change(&mut scenario);
    let mut plant = Plant::new(&scenario);
    let trim = bytemuck::cast::<Actuation, [f64; 4]>(plant.truth().actuators.into());
    let mut sample = |k: u64| {
        let share = if (k / 10).is_multiple_of(2) { 1.1 } else { 0.9 };
        let command = actuation(trim.map(|position| position * share)).into();
        let stamp = Stamp { sequence: k + 1, ..Stamp::default() };
        plant.command(&Actuators { stamp, command, flags: 0 }, 3_000_000);
        plant.advance(1).unwrap();
        plant.truth()
    };
    (0..40).map(&mut sample).collect()
}

/// Flies the vehicle with faults.
fn faulty(faults: &[Fault]) -> Vec<Truth> {
    fly(|scenario| scenario.fault = faults.to_vec())
}

/// Positions of one actuator along the flight of [`faulty`].
fn track(faults: &[Fault], actuator: usize) -> Vec<f64> {
    faulty(faults).iter().map(|truth| bytemuck::cast::<Actuation, [f64; 4]>(truth.actuators.into())[actuator]).collect()
}

#[test]
fn each_kind_acts_on_its_own_actuator_while_it_is_active() {
    for (actuator, target) in TARGETS.into_iter().enumerate() {
        for kind in target.kinds() {
            let fault = Fault { for_s: Some(0.1), value: Some(0.3), ..fault(target, *kind, None) };
            assert_eq!(faulted(std::slice::from_ref(&fault), 9), (COMMAND, Condition::default()));
            assert_eq!(faulted(std::slice::from_ref(&fault), 20), (COMMAND, Condition::default()));
            let (followed, condition) = faulted(&[fault], 10);
            assert!(followed != COMMAND || condition != Condition::default(), "{target:?} {kind:?}");
            for other in (0..4).filter(|other| *other != actuator) {
                assert_eq!(followed[other], COMMAND[other]);
                assert_eq!(condition.slow_s[other], None);
                assert!(condition.effectiveness.get(other).is_none_or(|share| *share == 1.0));
            }
        }
    }
}

#[test]
fn an_unpowered_actuator_goes_to_zero_with_its_lag() {
    for (actuator, target) in TARGETS.into_iter().enumerate() {
        let track = track(&[fault(target, FaultKind::Off, None)], actuator);
        let [before, soon, late] = [track[9], track[10], track[39]];
        assert!(soon < before && soon > 0.5 * before, "{target:?} does not stop at once: {before}, {soon}");
        assert!(late.abs() < 1e-3 * before, "{target:?} is at {late}");
    }
}

#[test]
fn a_dead_rotor_tips_the_vehicle_to_its_side() {
    let rates = |target| faulty(&[fault(target, FaultKind::Off, None)])[14].actual.rates_radps;
    assert!(rates(FaultTarget::Rotor1)[1] < -0.4, "the nose drops");
    assert!(rates(FaultTarget::Rotor2)[0] > 0.4 && rates(FaultTarget::Rotor3)[0] < -0.4);
    assert!(rates(FaultTarget::Tilt)[2] < -0.4, "its yawing moment is missing");
}

#[test]
fn a_stuck_actuator_keeps_its_place_bit_for_bit_and_then_follows_again() {
    for (actuator, target) in TARGETS.into_iter().enumerate() {
        // At the onset, 0.11 s, the rotor is on the way to a new speed.
        let stuck = Fault { at_s: 0.11, for_s: Some(0.2), ..fault(target, FaultKind::Stuck, None) };
        let track = track(&[stuck], actuator);
        assert!(track[9].to_bits() != track[10].to_bits(), "it was moving");
        assert!(track[10..31].iter().all(|position| position.to_bits() == track[10].to_bits()), "{target:?}");
        assert!(track[31] != track[30]);
    }
}

#[test]
fn a_weak_rotor_has_less_thrust_and_torque() {
    for (actuator, target) in TARGETS.into_iter().take(3).enumerate() {
        for (value, share) in [(None, 0.7), (Some(0.2), 0.2)] {
            let (followed, condition) = faulted(&[fault(target, FaultKind::Wrong, value)], 10);
            assert_eq!((followed, condition.effectiveness[actuator]), (COMMAND, share));
        }
        let weak = fly(|scenario| scenario.plant.rotor_effectiveness[actuator] = 0.7);
        let with_fault = faulty(&[Fault { at_s: 0.0, ..fault(target, FaultKind::Wrong, None) }]);
        assert_eq!(weak, with_fault, "it flies as a vehicle that is so from the start");
    }
}

#[test]
fn a_wrong_tilt_is_off_its_command_within_its_range() {
    let tilt = |value| faulted(&[fault(FaultTarget::Tilt, FaultKind::Wrong, value)], 10).0[TILT];
    assert_eq!(tilt(None), COMMAND[TILT] + 5f64.to_radians());
    assert_eq!(tilt(Some(-3.0)), COMMAND[TILT] - 3f64.to_radians());
    let range = Scenario::default().limits().tilt_max_rad;
    assert_eq!([tilt(Some(500.0)), tilt(Some(-500.0))], [range, -range]);
}

#[test]
fn a_slow_actuator_follows_with_the_lag_it_was_given() {
    for (ms, lag_s) in [(None, 0.15), (Some(400.0), 0.4)] {
        let slow = |target| Fault { at_s: 0.0, ms, ..fault(target, FaultKind::Slow, None) };
        let rotors = [FaultTarget::Rotor1, FaultTarget::Rotor2, FaultTarget::Rotor3].map(slow);
        assert_eq!(faulty(&rotors), fly(|scenario| scenario.plant.rotor_lag_s = lag_s));
        assert_eq!(faulty(&[slow(FaultTarget::Tilt)]), fly(|scenario| scenario.plant.servo_lag_s = lag_s));
    }
    let (_, condition) = faulted(&[Fault { ms: Some(0.0), ..fault(FaultTarget::Rotor2, FaultKind::Slow, None) }], 10);
    assert_eq!(condition.slow_s[1], Some(Scenario::default().plant.rotor_lag_s), "never faster than it is");
}

#[test]
fn a_saturated_actuator_reaches_a_part_of_its_range() {
    let limits = Scenario::default().limits();
    let [max1, _, max3] = limits.rotor_speed_max;
    let followed = |target, value| faulted(&[fault(target, FaultKind::Saturated, value)], 10).0;
    assert_eq!(followed(FaultTarget::Rotor1, None)[0], COMMAND[0].min(0.8 * max1));
    assert_eq!(followed(FaultTarget::Rotor3, Some(0.5))[2], 0.5 * max3);
    assert_eq!(followed(FaultTarget::Tilt, Some(0.1))[TILT], 0.1 * limits.tilt_max_rad);
    let scenario =
        Scenario { fault: vec![fault(FaultTarget::Tilt, FaultKind::Saturated, Some(0.1))], ..Scenario::default() };
    let other_side = actuation(COMMAND.map(|c| -c));
    let (target, _) = ActuatorFaults::new(&scenario).inject(10, &actuation(POSITION), &other_side);
    assert_eq!(target.tilt_rad, -0.1 * limits.tilt_max_rad, "on both sides");
    for nonsense in [f64::NAN, -1.0] {
        assert_eq!(followed(FaultTarget::Rotor1, Some(nonsense))[0], 0.0);
    }
}

#[test]
fn faults_of_one_actuator_act_in_the_order_of_the_file() {
    let [bias, low, off] = [(FaultKind::Wrong, Some(10.0)), (FaultKind::Saturated, Some(0.1)), (FaultKind::Off, None)]
        .map(|(kind, value)| fault(FaultTarget::Tilt, kind, value));
    let tilt = |faults: &[Fault]| faulted(faults, 10).0[TILT];
    let reach = 0.1 * Scenario::default().limits().tilt_max_rad;
    assert_eq!(tilt(&[bias, low]), reach);
    assert_eq!(tilt(&[low, bias]), reach + 10f64.to_radians());
    assert_eq!(tilt(&[bias, low, off]), 0.0);
    let weak = |value| fault(FaultTarget::Rotor2, FaultKind::Wrong, Some(value));
    assert_eq!(faulted(&[weak(0.5), weak(0.5)], 10).1.effectiveness, [1.0, 0.25, 1.0]);
    let slow = |ms| Fault { ms: Some(ms), ..fault(FaultTarget::Rotor2, FaultKind::Slow, None) };
    assert_eq!(faulted(&[slow(90.0), slow(200.0), slow(50.0)], 10).1.slow_s[1], Some(0.2), "the longest lag counts");
}
