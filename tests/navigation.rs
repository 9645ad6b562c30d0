//! The estimator in whole flights: its errors are as large as it says, with every error of the shipped sensors.

use contract::message::{Kinematics, Navigation, State};
use nalgebra::{UnitQuaternion, Vector3};

use crate::harness::fly;

/// Numbers of an error: position and velocity NED, attitude as turns about the body axes.
const ERRORS: usize = 9;

/// Error of the estimate in a sample, and the deviations that the unit expects.
fn error(state: &State) -> [(f64, f64); ERRORS] {
    let parts = |motion: &Kinematics| {
        let [roll, pitch, yaw] = motion.attitude_rad;
        let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        (Vector3::from(motion.position_m), attitude * Vector3::from(motion.velocity_mps), attitude)
    };
    let (estimated, actual) = (parts(&state.measured), parts(&state.actual));
    let off = [estimated.0 - actual.0, estimated.1 - actual.1, (actual.2.inverse() * estimated.2).scaled_axis()];
    let of = &state.navigation;
    let expected = [of.position_m, of.velocity_mps, of.attitude_rad];
    std::array::from_fn(|i| (off[i / 3][i % 3], expected[i / 3][i % 3]))
}

#[test]
fn val_errors_stay_inside_three_deviations_with_the_shipped_sensors() {
    for (scenario, preset) in [("dryden", "typical"), ("fast-legs", "typical"), ("dryden", "good")] {
        let mut samples = 0.0;
        let mut inside = [0.0; ERRORS];
        let mut squares = [(0.0, 0.0); ERRORS];
        for seed in 1..=5 {
            let [file, sensors, seed] = [
                format!("scenarios/{scenario}.toml"),
                format!("plant.sensors.preset={preset}"),
                format!("run.seed={seed}"),
            ];
            let of = ["--mode", "inprocess", "--set", "bounds.max_position_error_m=inf", "--set", "run.duration_s=30"];
            let outcome = fly(&[&[file.as_str(), "--set", &sensors, "--set", &seed], &of[..]].concat());
            let log = flight::log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
            for state in &log.states {
                samples += 1.0;
                for (i, (off, expected)) in error(state).into_iter().enumerate() {
                    inside[i] += f64::from(u8::from(off.abs() <= 3.0 * expected));
                    squares[i] = (squares[i].0 + off * off, squares[i].1 + expected * expected);
                }
                assert_eq!(state.navigation.resets, 0);
            }
        }
        for (i, (inside, (found, expected))) in inside.into_iter().zip(squares).enumerate() {
            let (share, ratio) = (inside / samples, (found / expected).sqrt());
            let words = format!("{scenario}, {preset}, error {i}: {share:.3} inside, {ratio:.2} of the expected size");
            // Constant errors are drawn once a flight, so five flights tell little of their size.
            assert!(share > 0.95 && (0.05..1.6).contains(&ratio), "{words}");
        }
    }
}

#[test]
fn without_the_kalman_filter_nothing_is_said_of_the_errors() {
    let outcome = fly(&["scenarios/dryden.toml", "--mode", "inprocess", "--set", "run.duration_s=1"]);
    let log = flight::log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert!(!log.states.is_empty() && log.states.iter().all(|state| state.navigation == Navigation::default()));
}
