//! Evidence for and against a dead rotor, on rates made up for it; whole flights are in `tests/fallback.rs`.

use airframe::Trim;
use nalgebra::Vector3;

use super::*;

/// Hovers for `ticks`, with rotors of an effectiveness and a push \[rad/s2\]; when a rotor is dead beyond doubt \[s\].
fn certain_after(effect: [f64; 3], push: [f64; 3], rate_hz: f64, ticks: usize) -> Option<f64> {
    let scenario = Scenario::default();
    let trim = Trim::solve(&scenario.airframe, false).actuation;
    let rotors = Rotors::new(&scenario, MixingMatrix::new(&scenario.airframe, false), &trim);
    let does = rotors.expected(&trim) * Vector3::from(effect) + Vector3::from(push);
    let (mut evidence, mut rates) = (rotors.unknown(&trim), Vector3::zeros());
    for tick in 1..=ticks {
        let inertia = rotors.inertia_kgm2;
        let gyroscopic = rates.cross(&inertia.component_mul(&rates)).component_div(&inertia);
        let next = rates + (does - gyroscopic) / rate_hz;
        evidence = rotors.observe(&evidence, [rates, next], &trim, 1.0 / rate_hz);
        if evidence.is_certain() {
            return Some(tick as f64 / rate_hz);
        }
        rates = next;
    }
    None
}

#[test]
fn each_rotor_can_be_seen_to_be_dead() {
    for rate_hz in [50.0, 100.0, 500.0, 2000.0] {
        for rotor in 0..3 {
            let mut effect = [1.0; 3];
            effect[rotor] = 0.0;
            let after = certain_after(effect, [0.0; 3], rate_hz, 2000).expect("it is seen");
            assert!((0.05..0.15).contains(&after), "rotor {rotor} at {rate_hz} Hz: after {after} s");
        }
    }
}

#[test]
fn healthy_weak_and_pushed_vehicles_are_let_fly() {
    assert_eq!(certain_after([1.0; 3], [0.0; 3], 100.0, 1000), None);
    for rotor in 0..3 {
        let mut effect = [1.0; 3];
        effect[rotor] = 0.6;
        assert_eq!(certain_after(effect, [0.0; 3], 100.0, 20), None, "rotor {rotor} at 60 %");
    }
    // 0.2 N m on pitch and on roll, a fifth of what rotor 1 does.
    for push in [[8.0, 0.0, 0.0], [-8.0, 0.0, 0.0], [0.0, 16.0, 0.0], [0.0, -16.0, 0.0], [0.0, 0.0, -16.0]] {
        assert_eq!(certain_after([1.0; 3], push, 100.0, 20), None, "{push:?}");
    }
}

#[test]
fn a_jump_of_the_rates_is_no_dead_rotor() {
    let scenario = Scenario::default();
    let trim = Trim::solve(&scenario.airframe, false).actuation;
    let rotors = Rotors::new(&scenario, MixingMatrix::new(&scenario.airframe, false), &trim);
    for jump in [1.0, -1.0] {
        let mut evidence = rotors.unknown(&trim);
        // What rotor 1 would do in 30 ms, at once: a sensor that fell out, and came back.
        let there = rotors.expected(&trim).column(0) * (0.03 * jump);
        let mut path = [Vector3::zeros(); 40];
        path[10..20].fill(there);
        for pair in path.windows(2) {
            evidence = rotors.observe(&evidence, [pair[0], pair[1]], &trim, 0.01);
            assert!(!evidence.is_certain());
        }
    }
}

#[test]
fn gaps_and_numbers_that_overflow_leave_no_evidence() {
    let scenario = Scenario::default();
    let trim = Trim::solve(&scenario.airframe, false).actuation;
    let rotors = Rotors::new(&scenario, MixingMatrix::new(&scenario.airframe, false), &trim);
    let nothing = rotors.unknown(&trim);
    let some = rotors.observe(&nothing, [Vector3::zeros(), Vector3::repeat(0.1)], &trim, 0.01);
    assert_ne!(some, nothing);
    assert_eq!(rotors.observe(&some, [Vector3::zeros(), Vector3::repeat(0.1)], &trim, 0.06), nothing);
    assert_eq!(rotors.observe(&some, [Vector3::zeros(), Vector3::repeat(f64::MAX)], &trim, 0.01), nothing);
    assert_eq!(rotors.observe(&some, [Vector3::zeros(), Vector3::repeat(0.1)], &trim, 0.0), some);
}
