use airframe::MixingMatrix;
use airframe::Trim;
use airframe::linear::Continuous;
use nalgebra::{SMatrix, SVector, Vector4};

use super::*;
use crate::integrator;

const CALM: fn() -> Surroundings = Surroundings::default;
const SOUND: fn() -> Condition = Condition::default;
/// Rows of the state vector that (48) keeps: w, phi, theta, psi, p, q, r.
const LINEAR: [usize; 7] = [5, 6, 7, 8, 9, 10, 11];

fn scenario() -> Scenario {
    Scenario::from(contract::scenario::Profile::Paper)
}

fn trim(scenario: &Scenario) -> (StateVector, Actuation) {
    let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction);
    let motion = Kinematics { attitude_rad: [trim.roll_rad, 0.0, 0.0], ..Kinematics::default() };
    (assemble(&motion, &trim.actuation), trim.actuation)
}

/// Rate of change at hover after `change` to the vehicle, its state and its surroundings.
fn rate_after(change: impl Fn(&mut Scenario, &mut StateVector, &mut Surroundings)) -> StateVector {
    let (mut scenario, mut outside) = (scenario(), CALM());
    let (mut x, command) = trim(&scenario);
    change(&mut scenario, &mut x, &mut outside);
    Dynamics::new(&scenario).derivative(&x, &command, &SOUND(), &outside)
}

#[test]
fn hover_is_an_equilibrium() {
    for tilt_reaction in [false, true] {
        let mut scenario = scenario();
        scenario.plant.tilt_reaction = tilt_reaction;
        let (x, command) = trim(&scenario);
        for rate in Dynamics::new(&scenario).derivative(&x, &command, &SOUND(), &CALM()) {
            assert!(rate.abs() < 1e-12);
        }
    }
}

#[test]
fn rotor_speeds_push_and_turn_the_right_way() {
    let faster = |rotor: usize| rate_after(move |_, x, _| x[12 + rotor] *= 1.01);
    let [front, left, right] = [faster(0), faster(1), faster(2)];
    for rates in [front, left, right] {
        assert!(rates[5] < 0.0, "more thrust accelerates upwards, against z");
    }
    assert!(front[10] > 0.0 && left[10] < 0.0 && right[10] < 0.0, "the front rotor pitches up, the rear ones down");
    assert!(front[9].abs() < 1e-12 && left[9] < 0.0 && right[9] > 0.0, "rotor 2 rolls one way, rotor 3 the other");
    assert!(left[11] > 0.0 && right[11] < 0.0, "torques of the rear rotors oppose each other");
}

#[test]
fn tilt_pushes_sideways_and_yaws() {
    let rates = rate_after(|_, x, _| x[15] += 0.01);
    assert!(rates[4] > 0.0 && rates[11] > 0.0);
    assert!(rates[10] < 0.0, "less front lift: the nose sinks");
}

#[test]
fn tilt_reaction_pitches_up() {
    let rates = rate_after(|scenario, _, _| scenario.plant.tilt_reaction = true);
    assert!((rates[10] - 23.9).abs() < 0.1, "about 24 rad/s2 at trim");
    let without = rate_after(|_, _, _| ());
    assert!((0..16).filter(|&i| i != 10).all(|i| rates[i].to_bits() == without[i].to_bits()));
}

#[test]
fn a_weak_rotor_loses_thrust_and_torque_in_proportion() {
    let weak = rate_after(|scenario, _, _| scenario.plant.rotor_effectiveness = [1.0, 0.81, 1.0]);
    let slow = rate_after(|_, x, _| x[13] *= 0.9);
    for i in 3..12 {
        assert!((weak[i] - slow[i]).abs() < 1e-11);
    }
}

#[test]
fn wind_carries_and_drag_brakes() {
    let drag = |scenario: &mut Scenario| {
        scenario.plant.drag_linear_nspm = [0.2, 0.2, 0.1];
        scenario.plant.drag_quadratic_ns2pm2 = 0.02;
    };
    // Facing east, wind towards north comes from the right and carries to the left.
    let rates = rate_after(|scenario, x, outside| {
        drag(scenario);
        x[8] = std::f64::consts::FRAC_PI_2;
        outside.wind_mps = Vector3::new(3.0, 0.0, 0.0);
    });
    assert!(rates[4] < -0.5 && rates[3].abs() < 1e-12);
    let braked = rate_after(|scenario, x, _| {
        drag(scenario);
        x[3] = 2.0;
    });
    let expected = -(0.2 * 2.0 + 0.02 * 2.0 * 2.0) / 1.1;
    assert!((braked[3] - expected).abs() < 1e-12);
    let with_the_wind = rate_after(|scenario, x, outside| {
        drag(scenario);
        x[3] = 2.0;
        outside.wind_mps = Vector3::new(2.0, 0.0, 0.0);
    });
    assert!(with_the_wind[3].abs() < 1e-12, "no drag when moving with the air");
}

#[test]
fn a_disturbing_force_is_ned_and_a_moment_is_body() {
    let rates = rate_after(|_, x, outside| {
        x[8] = std::f64::consts::FRAC_PI_2; // facing east: south is to the right
        outside.force_n = Vector3::new(-1.1, 0.0, 0.0);
        outside.moment_nm = Vector3::new(0.0239, 0.0, 0.0);
    });
    let right = Trim::solve(&Parameters::default(), false).roll_rad.cos();
    assert!((rates[4] - right).abs() < 1e-12 && rates[3].abs() < 1e-12);
    assert!((rates[9] - 1.0).abs() < 1e-12 && rates[10].abs() < 1e-12);
}

#[test]
fn gravity_is_the_third_column_of_the_rotation() {
    let (roll, pitch, yaw) = (0.4f64, -0.7f64, 2.0f64);
    let cbn = direction_cosines(roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    assert!((cbn * cbn.transpose() - Matrix3::identity()).norm() < 1e-15);
    assert!((cbn.determinant() - 1.0).abs() < 1e-15);
    let rates = rate_after(|scenario, x, _| {
        scenario.plant.rotor_effectiveness = [0.0; 3];
        (x[6], x[7], x[8]) = (roll, pitch, yaw);
    });
    let gravity = cbn * Vector3::new(0.0, 0.0, 9.81);
    assert!((Vector3::new(rates[3], rates[4], rates[5]) - gravity).norm() < 1e-14);
}

#[test]
fn a_free_tumble_keeps_energy_and_angular_momentum() {
    let mut scenario = scenario();
    scenario.plant.rotor_effectiveness = [0.0; 3];
    let dynamics = Dynamics::new(&scenario);
    let vehicle = scenario.airframe;
    let inertia = Vector3::new(vehicle.ixx_kgm2, vehicle.iyy_kgm2, vehicle.izz_kgm2);
    let kept = |x: &StateVector| {
        let (v, rates) = (Vector3::new(x[3], x[4], x[5]), Vector3::new(x[9], x[10], x[11]));
        let cbn = direction_cosines(x[6].sin_cos(), x[7].sin_cos(), x[8].sin_cos());
        let momentum = inertia.component_mul(&rates);
        let energy = 0.5 * vehicle.mass_kg * v.norm_squared() - vehicle.mass_kg * vehicle.g_mps2 * x[2]
            + 0.5 * rates.dot(&momentum);
        let world = cbn.transpose() * momentum;
        [energy, world.x, world.y, world.z]
    };
    let motion = Kinematics {
        velocity_mps: [1.0, -2.0, -3.0],
        attitude_rad: [0.3, 0.2, -1.0],
        rates_radps: [2.0, -0.5, 1.0],
        ..Kinematics::default()
    };
    let command = Actuation::default();
    let start = assemble(&motion, &command);
    let end = (0..700)
        .fold(start, |x, _| integrator::step(&x, 1e-3, |_, x| dynamics.derivative(x, &command, &SOUND(), &CALM())));
    assert!(end[2].abs() > 0.1, "it did fall");
    for (before, after) in kept(&start).into_iter().zip(kept(&end)) {
        assert!((before - after).abs() < 1e-9, "{before} became {after}");
    }
}

#[test]
fn val_linear_model_is_the_linearisation_of_the_equations_of_motion() {
    let scenario = scenario();
    let dynamics = Dynamics::new(&scenario);
    let (hover, command) = trim(&scenario);
    let mixing = MixingMatrix::new(&scenario.airframe, false);
    let linear = Continuous::hover(&scenario.airframe, &Trim::solve(&scenario.airframe, false));
    let rates = |x: &StateVector| {
        let rates = dynamics.derivative(x, &command, &SOUND(), &CALM());
        SVector::<f64, 7>::from_fn(|i, _| rates[LINEAR[i]])
    };

    let mut a = SMatrix::<f64, 7, 7>::zeros();
    for (column, &state) in LINEAR.iter().enumerate() {
        a.set_column(
            column,
            &slope(|h| {
                let mut x = hover;
                x[state] += h;
                rates(&x)
            }),
        );
    }
    let mut b = SMatrix::<f64, 7, 4>::zeros();
    for input in 0..4 {
        b.set_column(
            input,
            &slope(|h| {
                let demand = Vector4::from_fn(|i, _| if i == input { h } else { 0.0 });
                let u = mixing.trim + mixing.inverse * demand;
                let mut x = hover;
                x[12..16].copy_from_slice(&[u[0].hypot(u[1]).sqrt(), u[2].sqrt(), u[3].sqrt(), u[0].atan2(u[1])]);
                rates(&x)
            }),
        );
    }
    assert!((a - linear.a).amax() < 1e-9, "A is off by {:e}", (a - linear.a).amax());
    assert!((b - linear.b).amax() < 1e-9, "B is off by {:e}", (b - linear.b).amax());
}

/// Derivative of `f` at 0, of fourth order.
fn slope(f: impl Fn(f64) -> SVector<f64, 7>) -> SVector<f64, 7> {
    let h = 1e-3;
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}
