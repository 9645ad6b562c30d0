use airframe::linear::Continuous;
use airframe::{AtSpeed, FlightPoint, LevelFlight, MixingMatrix, Parameters, Trim};
use nalgebra::{SMatrix, SVector, Vector4};

use super::*;
use crate::integrator;

const CALM: fn() -> Surroundings = Surroundings::default;
const SOUND: fn() -> Condition = Condition::default;

fn scenario() -> Scenario {
    Scenario::from(settings::Profile::Paper)
}

fn trim(scenario: &Scenario) -> (StateVector, Actuation) {
    let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction);
    let motion = Kinematics { attitude_rad: [trim.roll_rad, 0.0, 0.0], ..Kinematics::default() };
    (assemble(&motion, &trim.actuation), trim.actuation)
}

fn roll() -> f64 {
    Trim::solve(&Parameters::default(), false).roll_rad
}

fn attitude([roll, pitch, yaw]: [f64; 3]) -> Quaternion<f64> {
    UnitQuaternion::from_euler_angles(roll, pitch, yaw).into_inner()
}

/// Sets the attitude of `x` to these Euler angles.
fn turn(x: &mut StateVector, angles_rad: [f64; 3]) {
    x[6..10].copy_from_slice(attitude(angles_rad).coords.as_slice());
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

fn with_drag() -> Scenario {
    let mut scenario = scenario();
    scenario.plant.drag_linear_nspm = [0.2, 0.2, 0.1];
    scenario.plant.drag_quadratic_ns2pm2 = 0.02;
    scenario
}

#[test]
fn level_flight_does_not_accelerate() {
    for (way, tilt_reaction) in [([15.0, 0.0], false), ([-9.0, 12.0], true), ([0.0, 15.0], true)] {
        let mut scenario = with_drag();
        scenario.plant.tilt_reaction = tilt_reaction;
        let level = LevelFlight::solve(&scenario.airframe, tilt_reaction, &scenario.plant.drag(), way).unwrap();
        let motion = Kinematics {
            velocity_mps: level.velocity_mps,
            attitude_rad: [level.roll_rad, level.pitch_rad, 0.0],
            ..Kinematics::default()
        };
        let x = assemble(&motion, &level.actuation);
        let rates = Dynamics::new(&scenario).derivative(&x, &level.actuation, &SOUND(), &CALM());
        assert!((rates[0] - way[0]).abs() < 1e-10 && (rates[1] - way[1]).abs() < 1e-10, "{rates:?}");
        assert!(rates[2..].iter().all(|rate| rate.abs() < 1e-10), "{rates:?}");
    }
}

#[test]
fn the_linear_model_at_a_point_of_flight_is_exact_there() {
    let scenario = with_drag();
    let trim = Trim::solve(&scenario.airframe, false);
    for (velocity_mps, attitude_rad, rates_radps) in [
        ([14.0, -3.0, -4.0], [0.2, -0.4, 0.0], [0.3, -0.7, 0.5]),
        ([0.0, 12.0, 2.0], [-0.5, 0.1, 1.0], [-1.0, 0.2, -0.4]),
    ] {
        let motion = Kinematics { velocity_mps, attitude_rad, rates_radps, ..Kinematics::default() };
        let mut actuation = trim.actuation;
        actuation.rotor_speed[0] *= 1.05;
        actuation.tilt_rad += 0.1;
        let f = Dynamics::new(&scenario).derivative(&assemble(&motion, &actuation), &actuation, &SOUND(), &CALM());

        let [roll_rad, pitch_rad, yaw_rad] = attitude_rad;
        let point = FlightPoint { velocity_mps, roll_rad, pitch_rad, rates_radps };
        let model = AtSpeed::new(&scenario.airframe, &trim, &scenario.plant.drag(), &point);
        let [p, q, r] = rates_radps;
        let x = SVector::from([velocity_mps[2], roll_rad - trim.roll_rad, pitch_rad, yaw_rad, p, q, r]);
        let u = MixingMatrix::new(&scenario.airframe, false).deviation(&actuation);
        let ours = model.continuous.a * x + model.continuous.b * (u + model.offset);
        for (row, theirs) in [(0, f[5]), (4, f[10]), (5, f[11]), (6, f[12])] {
            assert!((ours[row] - theirs).abs() < 1e-9, "row {row}: {} is not {theirs}", ours[row]);
        }
    }
}

#[test]
fn rotor_speeds_push_and_turn_the_right_way() {
    let faster = |rotor: usize| rate_after(move |_, x, _| x[13 + rotor] *= 1.01);
    let [front, left, right] = [faster(0), faster(1), faster(2)];
    for rates in [front, left, right] {
        assert!(rates[5] < 0.0, "more thrust accelerates upwards, against z");
    }
    assert!(front[11] > 0.0 && left[11] < 0.0 && right[11] < 0.0, "the front rotor pitches up, the rear ones down");
    assert!(front[10].abs() < 1e-12 && left[10] < 0.0 && right[10] > 0.0, "rotor 2 rolls one way, rotor 3 the other");
    assert!(left[12] > 0.0 && right[12] < 0.0, "torques of the rear rotors oppose each other");
}

#[test]
fn tilt_pushes_sideways_and_yaws() {
    let rates = rate_after(|_, x, _| x[16] += 0.01);
    assert!(rates[4] > 0.0 && rates[12] > 0.0);
    assert!(rates[11] < 0.0, "less front lift: the nose sinks");
}

#[test]
fn tilt_reaction_pitches_up() {
    let rates = rate_after(|scenario, _, _| scenario.plant.tilt_reaction = true);
    assert!((rates[11] - 23.9).abs() < 0.1, "about 24 rad/s2 at trim");
    let without = rate_after(|_, _, _| ());
    assert!((0..17).filter(|&i| i != 11).all(|i| rates[i].to_bits() == without[i].to_bits()));
}

#[test]
fn a_weak_rotor_loses_thrust_and_torque_in_proportion() {
    let weak = rate_after(|scenario, _, _| scenario.plant.rotor_effectiveness = [1.0, 0.81, 1.0]);
    let slow = rate_after(|_, x, _| x[14] *= 0.9);
    for i in (3..6).chain(10..13) {
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
        turn(x, [roll(), 0.0, std::f64::consts::FRAC_PI_2]);
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
        turn(x, [roll(), 0.0, std::f64::consts::FRAC_PI_2]); // facing east: south is to the right
        outside.force_n = Vector3::new(-1.1, 0.0, 0.0);
        outside.moment_nm = Vector3::new(0.0239, 0.0, 0.0);
    });
    let right = Trim::solve(&Parameters::default(), false).roll_rad.cos();
    assert!((rates[4] - right).abs() < 1e-12 && rates[3].abs() < 1e-12);
    assert!((rates[10] - 1.0).abs() < 1e-12 && rates[11].abs() < 1e-12);
}

#[test]
fn gravity_is_the_third_column_of_the_rotation() {
    let (roll, pitch, yaw) = (0.4f64, -0.7f64, 2.0f64);
    let cbn = rotation(&attitude([roll, pitch, yaw])).transpose();
    let paper = Matrix3::new(
        pitch.cos() * yaw.cos(),
        pitch.cos() * yaw.sin(),
        -pitch.sin(),
        roll.sin() * pitch.sin() * yaw.cos() - roll.cos() * yaw.sin(),
        roll.sin() * pitch.sin() * yaw.sin() + roll.cos() * yaw.cos(),
        roll.sin() * pitch.cos(),
        roll.cos() * pitch.sin() * yaw.cos() + roll.sin() * yaw.sin(),
        roll.cos() * pitch.sin() * yaw.sin() - roll.sin() * yaw.cos(),
        roll.cos() * pitch.cos(),
    );
    assert!((cbn - paper).norm() < 1e-15, "(7), with its slip mended");
    assert!((cbn * cbn.transpose() - Matrix3::identity()).norm() < 1e-15);
    assert!((cbn.determinant() - 1.0).abs() < 1e-15);
    let rates = rate_after(|scenario, x, _| {
        scenario.plant.rotor_effectiveness = [0.0; 3];
        turn(x, [roll, pitch, yaw]);
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
    let inertia = vehicle.moments_kgm2();
    let kept = |x: &StateVector| {
        let (v, rates) = (Vector3::new(x[3], x[4], x[5]), Vector3::new(x[10], x[11], x[12]));
        let cbn = rotation(&Quaternion::new(x[9], x[6], x[7], x[8])).transpose();
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
    let end = (0..700).fold(start, |x, _| {
        let mut next = integrator::step(&x, 1e-3, |_, x| dynamics.derivative(x, &command, &SOUND(), &CALM()));
        normalise(&mut next);
        next
    });
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
    // States of (48): w, phi, theta, psi, p, q, r. The angles follow from the rates by (8).
    let kept = |x: &StateVector| {
        let Kinematics { velocity_mps: [_, _, w], attitude_rad: [phi, theta, psi], rates_radps: [p, q, r], .. } =
            kinematics(x);
        [w, phi, theta, psi, p, q, r]
    };
    let rates = |x: &StateVector| {
        let rates = dynamics.derivative(x, &command, &SOUND(), &CALM());
        let [_, phi, theta, _, p, q, r] = kept(x);
        let psi = (q * phi.sin() + r * phi.cos()) / theta.cos();
        SVector::<f64, 7>::from([
            rates[5],
            p + psi * theta.sin(),
            q * phi.cos() - r * phi.sin(),
            psi,
            rates[10],
            rates[11],
            rates[12],
        ])
    };

    let mut a = SMatrix::<f64, 7, 7>::zeros();
    for column in 0..7 {
        a.set_column(
            column,
            &slope(|h| {
                let mut y = kept(&hover);
                y[column] += h;
                let [w, phi, theta, psi, p, q, r] = y;
                let mut x = hover;
                turn(&mut x, [phi, theta, psi]);
                x[5] = w;
                x[10..13].copy_from_slice(&[p, q, r]);
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
                x[13..17].copy_from_slice(&[u[0].hypot(u[1]).sqrt(), u[2].sqrt(), u[3].sqrt(), u[0].atan2(u[1])]);
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

#[test]
fn a_loop_passes_through_90_degrees_of_pitch() {
    let mut scenario = scenario();
    scenario.plant.rotor_effectiveness = [0.0; 3];
    let dynamics = Dynamics::new(&scenario);
    let motion = Kinematics { attitude_rad: [0.0, 1.4, 0.0], rates_radps: [0.0, 5.0, 0.0], ..Kinematics::default() };
    let command = Actuation::default();
    let step = |x: StateVector| {
        let mut next = integrator::step(&x, 1e-3, |_, x| dynamics.derivative(x, &command, &SOUND(), &CALM()));
        normalise(&mut next);
        next
    };
    let end = (0..100).fold(assemble(&motion, &command), |x, _| step(x));
    let [roll, pitch, yaw] = kinematics(&end).attitude_rad;
    let over = std::f64::consts::PI - 1.9; // 1.4 rad of pitch and 0.5 rad more: the vehicle is on its back
    assert!((pitch - over).abs() < 1e-9 && (roll.abs() - std::f64::consts::PI).abs() < 1e-9, "{roll} {pitch}");
    assert!((yaw.abs() - std::f64::consts::PI).abs() < 1e-9, "{yaw}");
}

#[test]
fn products_of_inertia_couple_the_axes_and_a_centre_of_mass_off_the_arms_turns() {
    let coupled = rate_after(|scenario, _, outside| {
        scenario.plant.airframe.ixz_kgm2 = 0.002;
        outside.moment_nm = Vector3::new(0.01, 0.0, 0.0);
    });
    let determinant = 0.0239 * 0.012_73 - 0.002 * 0.002;
    assert!((coupled[10] - 0.01 * 0.012_73 / determinant).abs() < 1e-9);
    assert!((coupled[12] + 0.01 * 0.002 / determinant).abs() < 1e-9, "a roll moment yaws");
    let nose_heavy = rate_after(|scenario, _, _| scenario.plant.airframe.centre_of_mass_m = [0.01, 0.0, 0.0]);
    let lift_n = 1.1 * 9.81 * roll().cos();
    assert!((nose_heavy[11] + 0.01 * lift_n / 0.012_71).abs() < 1e-9, "{}: the nose sinks", nose_heavy[11]);
}

#[test]
fn the_true_vehicle_may_differ_from_the_model() {
    let heavy = rate_after(|scenario, _, _| scenario.plant.airframe.mass_kg = Some(1.32));
    assert!((heavy[5] - 9.81 * roll().cos() * (1.0 - 1.1 / 1.32)).abs() < 1e-9, "it sinks: {}", heavy[5]);
    let weak = rate_after(|scenario, _, _| scenario.plant.airframe.kf = Some(0.9 * 1.970e-6));
    assert!(weak[5] > 0.9, "a tenth of the lift is missing");
}
