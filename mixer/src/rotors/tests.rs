//! Tests of the evidence for a dead rotor on synthetic motions; whole flights are in `tests/fallback.rs`.

use airframe::Trim;
use nalgebra::Vector3;

use super::*;

/// Model of the default vehicle, its trim, and its motion in hover.
fn hovering() -> (RotorModel, Actuation, Kinematics) {
    let scenario = Scenario::default();
    let Trim { roll_rad, actuation } = Trim::solve(&scenario.airframe, false);
    let rotors = RotorModel::new(&scenario, MixingMatrix::new(&scenario.airframe, false), &actuation);
    (rotors, actuation, Kinematics { attitude_rad: [roll_rad, 0.0, 0.0], ..Kinematics::default() })
}

/// Time after which a rotor of a vehicle with the accelerations `does` is declared dead \[s\]; `None` if none is within
/// `ticks`. The attitude stays at hover.
fn certain_after(does: Vector4<f64>, rate_hz: f64, ticks: usize) -> Option<f64> {
    let (rotors, trim, mut before) = hovering();
    let (mut evidence, dt) = (rotors.unknown(&trim), 1.0 / rate_hz);
    for tick in 1..=ticks {
        let carried = rotors.acceleration([&before, &before], dt);
        let d = (does - carried) * dt;
        let mut after = before;
        after.velocity_mps[2] += d[0];
        (0..3).for_each(|axis| after.rates_radps[axis] += d[1 + axis]);
        evidence = rotors.observe(&evidence, [&before, &after], &trim, dt);
        if evidence.dead_rotor().is_some() {
            return Some(tick as f64 * dt);
        }
        before = after;
    }
    None
}

/// Accelerations by rotors of the given effectiveness and a push \[m/s2, rad/s2\].
fn with(effect: [f64; 3], push: [f64; 4]) -> Vector4<f64> {
    let (rotors, trim, _) = hovering();
    rotors.expected(&trim) * Vector3::from(effect) + Vector4::from(push)
}

/// Effectiveness with one rotor at `effect` and the others sound.
fn one_at(rotor: usize, effect: f64) -> [f64; 3] {
    std::array::from_fn(|other| if other == rotor { effect } else { 1.0 })
}

#[test]
fn a_hover_leaves_nothing_unexplained() {
    let (rotors, trim, hover) = hovering();
    let missing = rotors.acceleration([&hover, &hover], 0.01) - rotors.expected(&trim).column_sum();
    assert!(missing.amax() < 1e-9, "{missing}");
    assert!(rotors.expected(&trim).row(0).iter().all(|lift| *lift < 0.0), "every rotor lifts");
}

#[test]
fn each_rotor_can_be_seen_to_be_dead() {
    for rate_hz in [50.0, 100.0, 500.0, 2000.0] {
        for rotor in 0..3 {
            let after = certain_after(with(one_at(rotor, 0.0), [0.0; 4]), rate_hz, 2000).expect("it is seen");
            assert!((0.05..0.15).contains(&after), "rotor {rotor} at {rate_hz} Hz: after {after} s");
        }
    }
}

/// Returns whether `rotor` seems dead. It should give the shares `moment` and `lift` of its moment and lift at hover;
/// the shares `missing` and `lift_missing` of these are missing. A missing moment at a right angle is added, `aside`
/// times as large.
fn seems_dead(rotor: usize, moment: f64, lift: f64, missing: f64, lift_missing: f64, aside: f64) -> bool {
    let (rotors, trim, _) = hovering();
    let mut evidence = rotors.unknown(&trim);
    let hover: Vector4<f64> = rotors.expected(&trim).column(rotor).into_owned();
    let m: Vector3<f64> = hover.fixed_rows::<3>(1) * moment;
    let across = m.cross(&Vector3::new(0.3, -0.8, 0.5)).normalize() * m.norm() * missing * aside;
    let missing_m = m * missing + across;
    evidence.expected.set_column(rotor, &Vector4::new(hover[0] * lift, m.x, m.y, m.z));
    evidence.unexplained = -Vector4::new(hover[0] * lift * lift_missing, missing_m.x, missing_m.y, missing_m.z);
    rotors.seems_dead(&evidence, rotor)
}

#[test]
fn each_threshold_of_a_dead_rotor_is_where_its_constant_says() {
    for rotor in 0..3 {
        assert!(seems_dead(rotor, 1.0, 1.0, 1.0, 1.0, 0.0));
        assert!(seems_dead(rotor, 0.41, 1.0, 1.0, 1.0, 0.0) && !seems_dead(rotor, 0.39, 1.0, 1.0, 1.0, 0.0));
        assert!(seems_dead(rotor, 0.41, 0.2, 1.0, 1.0, 0.0), "however small its lift is");
        assert!(seems_dead(rotor, 1.0, 1.0, 0.71, 1.0, 0.0) && !seems_dead(rotor, 1.0, 1.0, 0.69, 1.0, 0.0));
        assert!(seems_dead(rotor, 3.0, 1.0, 0.71, 1.0, 0.0) && !seems_dead(rotor, 3.0, 1.0, 0.69, 1.0, 0.0));
        assert!(seems_dead(rotor, 1.0, 1.0, 1.0, 0.51, 0.0) && !seems_dead(rotor, 1.0, 1.0, 1.0, 0.49, 0.0));
        assert!(seems_dead(rotor, 1.0, 3.0, 1.0, 0.51, 0.0) && !seems_dead(rotor, 1.0, 3.0, 1.0, 0.49, 0.0));
        // A component half as large at a right angle makes the square of the cosine 0.8.
        assert!(seems_dead(rotor, 1.0, 1.0, 1.0, 1.0, 0.49) && !seems_dead(rotor, 1.0, 1.0, 1.0, 1.0, 0.51));
        assert!(!seems_dead(rotor, 1.0, 1.0, -1.0, 1.0, 0.0), "a moment of the other sign");
    }
}

#[test]
fn healthy_weak_and_pushed_vehicles_have_no_dead_rotor() {
    assert_eq!(certain_after(with([1.0; 3], [0.0; 4]), 100.0, 1000), None);
    for rotor in 0..3 {
        assert_eq!(certain_after(with(one_at(rotor, 0.6), [0.0; 4]), 100.0, 20), None, "rotor {rotor} at 60 %");
    }
    // Pushes of 0.2 N m on roll and on pitch, a fifth of the moment of rotor 1, and a fall.
    for push in [
        [0.0, 8.0, 0.0, 0.0],
        [0.0, -8.0, 0.0, 0.0],
        [0.0, 0.0, 16.0, 0.0],
        [0.0, 0.0, -16.0, 0.0],
        [9.8, 0.0, 0.0, 0.0],
    ] {
        assert_eq!(certain_after(with([1.0; 3], push), 100.0, 20), None, "{push:?}");
    }
}

#[test]
fn a_moment_that_is_missing_while_the_lift_is_there_is_no_dead_rotor() {
    for rotor in 0..3 {
        let mut does = with(one_at(rotor, 0.0), [0.0; 4]);
        does[0] = with([1.0; 3], [0.0; 4])[0];
        assert_eq!(certain_after(does, 100.0, 20), None, "rotor {rotor}: the rates lie, or a moment acts");
        does[0] = with(one_at(rotor, 2.0), [0.0; 4])[0];
        assert_eq!(certain_after(does, 100.0, 20), None, "rotor {rotor}: the more so");
    }
}

#[test]
fn a_tilt_that_fails_is_no_dead_rotor() {
    let (rotors, trim, _) = hovering();
    for tilt_rad in [0.0, 0.2, 1.0] {
        let does = rotors.expected(&Actuation { tilt_rad, ..trim }).column_sum();
        assert_eq!(certain_after(does, 100.0, 30), None, "a tilt of {tilt_rad} rad");
    }
}

#[test]
fn a_jump_of_the_rates_is_no_dead_rotor() {
    let (rotors, trim, hover) = hovering();
    for jump in [1.0, -1.0] {
        let mut evidence = rotors.unknown(&trim);
        // The motion jumps by the effect of rotor 1 in 30 ms, as with a sensor that failed and recovered.
        let mut there = hover;
        let change = rotors.expected(&trim).column(0) * (0.03 * jump);
        there.velocity_mps[2] = change[0];
        there.rates_radps = [change[1], change[2], change[3]];
        let path: Vec<&Kinematics> = (0..40).map(|i| if (10..20).contains(&i) { &there } else { &hover }).collect();
        for pair in path.windows(2) {
            evidence = rotors.observe(&evidence, [pair[0], pair[1]], &trim, 0.01);
            assert!(evidence.dead_rotor().is_none());
        }
    }
}

#[test]
fn gaps_and_numbers_that_overflow_leave_no_evidence() {
    let (rotors, trim, hover) = hovering();
    let turning = |rate: f64| Kinematics { rates_radps: [rate; 3], ..hover };
    let nothing = rotors.unknown(&trim);
    let some = rotors.observe(&nothing, [&hover, &turning(0.1)], &trim, 0.01);
    assert_ne!(some, nothing);
    assert_eq!(rotors.observe(&some, [&hover, &turning(0.1)], &trim, 0.06), nothing);
    assert_eq!(rotors.observe(&some, [&hover, &turning(f64::MAX)], &trim, 0.01), nothing);
    assert_eq!(rotors.observe(&some, [&hover, &turning(0.1)], &trim, 0.0), some);
}
