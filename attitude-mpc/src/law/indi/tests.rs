use airframe::{MixingMatrix, Parameters, Trim};
use contract::message::{Kinematics, State};
use nalgebra::DVector;

use super::*;

const SAMPLE_S: f64 = 0.01;

fn parts() -> (Parameters, Trim, MixingMatrix) {
    let vehicle = Parameters::default();
    (vehicle, Trim::solve(&vehicle, false), MixingMatrix::new(&vehicle, false))
}

/// Returns, at each sample, the filtered disturbance, and the filtered acceleration minus the unfiltered actuators.
/// Only the actuators act on the vehicle: they swing at 3 Hz, `scale` times as strong as in the model.
fn swing(scale: f64) -> Vec<[Vector4<f64>; 2]> {
    let (vehicle, trim, mixing) = parts();
    let gains = IndiGains::default();
    let indi = Indi::new(RigidBody::new(&vehicle, &trim, &mixing), &gains, SAMPLE_S);
    let inertia = vehicle.inertia();
    let at = |t_s: f64| {
        let mut actuation = trim.actuation;
        let swing = (19.0 * t_s).sin();
        actuation.rotor_speed[0] *= 1.0 + 0.05 * swing;
        actuation.rotor_speed[1] *= 1.0 - 0.04 * swing;
        actuation.rotor_speed[2] *= 1.0 + 0.03 * swing;
        actuation.tilt_rad += 0.1 * swing;
        actuation
    };
    let mut memory = AttitudeMemory::new(7, trim.actuation);
    let (mut measured, mut slow) = (Kinematics::default(), [Vector4::zeros(); 2]);
    measured.attitude_rad[0] = trim.roll_rad; // constant: this vehicle does not integrate the rates
    let sample = |measured: &Kinematics| {
        let [p, q, r] = measured.rates_radps;
        DVector::from_row_slice(&[measured.velocity_mps[2], 0.0, 0.0, 0.0, p, q, r])
    };
    let mut before = sample(&measured);
    let mut found = vec![];
    for tick in 0..300_u64 {
        let actuation = at(tick as f64 * SAMPLE_S);
        let x = sample(&measured);
        memory.x.rows_mut(0, 7).copy_from(&before);
        let state = State { measured, ..State::default() };
        indi.estimate(&EstimateInput { tick, state: &state, modelled: actuation, x: &x }, &mut memory);
        let acceleration = (&x - &before) / SAMPLE_S;
        let force = Vector4::new(acceleration[0], acceleration[5], acceleration[4], acceleration[6]);
        let share = 1.0 - (-gains.filter_radps * SAMPLE_S).exp();
        let [mut first, mut second] = slow;
        first += (force.component_mul(&inertia) - first) * share;
        second += (first - second) * share;
        slow = [first, second];
        found.push([memory.disturbance, second - mixing.deviation(&actuation)]);
        before = x;
        for step in 0..10 {
            let inputs = mixing.deviation(&at((tick as f64 + (f64::from(step) + 0.5) / 10.0) * SAMPLE_S)) * scale;
            let faster = inputs.component_div(&inertia) * (SAMPLE_S / 10.0);
            measured.velocity_mps[2] += faster[0];
            let [p, q, r] = measured.rates_radps;
            measured.rates_radps = [p + faster[2], q + faster[1], r + faster[3]];
        }
    }
    found.split_off(100)
}

/// Largest magnitude on each axis.
fn largest(all: impl Iterator<Item = Vector4<f64>>) -> Vector4<f64> {
    all.fold(Vector4::zeros(), |most, one| most.zip_map(&one, |a, b| a.max(b.abs())))
}

#[test]
fn the_actuators_alone_are_no_disturbance() {
    let all = swing(1.0);
    let [both, one] = [0, 1].map(|i| largest(all.iter().map(|found| found[i])));
    for axis in 1..4 {
        assert!(
            both[axis] < 0.02 * one[axis],
            "axis {axis}: {} with both filtered, {} with one",
            both[axis],
            one[axis]
        );
    }
}

#[test]
fn weak_actuators_are_a_disturbance_of_what_they_lack() {
    let [sound, half, weaker] = [1.0, 0.5, 0.25].map(|scale| largest(swing(scale).iter().map(|found| found[0])));
    for axis in 1..4 {
        assert!(half[axis] > 20.0 * sound[axis], "axis {axis}: {} and {}", half[axis], sound[axis]);
        assert!((weaker[axis] / half[axis] - 1.5).abs() < 0.1, "axis {axis}: {} and {}", weaker[axis], half[axis]);
    }
}

#[test]
fn a_gap_in_the_samples_teaches_nothing() {
    let (vehicle, trim, mixing) = parts();
    let indi = Indi::new(RigidBody::new(&vehicle, &trim, &mixing), &IndiGains::default(), SAMPLE_S);
    let mut memory = AttitudeMemory::new(7, trim.actuation);
    memory.x.fill(0.1);
    let (still, fast) = (DVector::zeros(7), DVector::from_element(7, 0.1));
    let measured = Kinematics { attitude_rad: [trim.roll_rad, 0.0, 0.0], ..Kinematics::default() };
    let state = State { measured, ..State::default() };
    for (tick, x, learns) in [(7, &still, false), (9, &fast, false), (10, &still, true)] {
        let before = memory.disturbance;
        indi.estimate(&EstimateInput { tick, state: &state, modelled: trim.actuation, x }, &mut memory);
        assert_eq!(memory.disturbance != before, learns, "sample {tick}");
    }
}

#[test]
fn a_faster_filter_takes_in_more() {
    let share = |filter_radps: f64| {
        let (vehicle, trim, mixing) = parts();
        let gains = IndiGains { filter_radps, ..IndiGains::default() };
        Indi::new(RigidBody::new(&vehicle, &trim, &mixing), &gains, SAMPLE_S).share
    };
    assert!(share(10.0) < share(30.0) && share(1e6) <= 1.0 && share(1e-9) > 0.0);
}

#[test]
fn sensed_positions_are_used_where_asked_for_and_numbers() {
    let (vehicle, trim, mixing) = parts();
    let of = |actuators, sensed| {
        let gains = IndiGains { actuators, ..IndiGains::default() };
        Indi::new(RigidBody::new(&vehicle, &trim, &mixing), &gains, SAMPLE_S).actuators(sensed, trim.actuation)
    };
    let sensed = Actuation { rotor_speed: [1.0, 2.0, 3.0], tilt_rad: 0.4 };
    assert_eq!(of(IndiActuators::Sensed, sensed), sensed);
    assert_eq!(of(IndiActuators::Modelled, sensed), trim.actuation);
    assert_eq!(of(IndiActuators::Sensed, Actuation { tilt_rad: f64::NAN, ..sensed }), trim.actuation);
}
