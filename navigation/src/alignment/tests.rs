use nalgebra::SMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::state::turn;
use crate::tests::{G_MPS2, NOISE, check_mean, draw};

/// Samples of the IMU, of which every tenth has a fix and a field.
const SAMPLES: u32 = 1000;
const BIAS_MPS2: f64 = 0.03;

/// Truth of a vehicle that stands somehow, and what a unit makes of its sensors.
fn stand(seed: u64) -> (State, State, Covariance) {
    let random = &mut ChaCha8Rng::seed_from_u64(seed);
    let truth = State {
        position_m: draw(random) * 10.0,
        attitude: turn(draw(random)),
        acceleration_bias_mps2: draw(random) * BIAS_MPS2,
        rates_bias_radps: draw(random) * 0.01,
        ..State::default()
    };
    let back = truth.attitude.inverse();
    let field = back * Vector3::new(0.4, 0.0, 0.9);
    let mut standstill = Standstill::default();
    for sample in 0..SAMPLES {
        let force = back * Vector3::new(0.0, 0.0, -G_MPS2) + truth.acceleration_bias_mps2;
        let imu = Imu {
            specific_force_mps2: force + draw(random) * NOISE.specific_force_mps2,
            rates_radps: truth.rates_bias_radps + draw(random) * NOISE.rates_radps,
        };
        let aiding = Aiding {
            position_m: Some(truth.position_m + draw(random).component_mul(&NOISE.position_m)),
            field: Some(field + draw(random) * NOISE.field),
            ..Aiding::default()
        };
        standstill.add(&imu, &if sample % 10 == 0 { aiding } else { Aiding::default() });
    }
    let (state, covariance) = standstill.aligned(&NOISE, BIAS_MPS2, G_MPS2).expect("all sensors are there");
    (truth, state, covariance)
}

#[test]
fn val_errors_are_as_large_as_the_covariance_says() {
    let seeds = 200;
    // Attitude with the bias of the accelerometer that it goes with; position; bias of the gyros.
    let (mut together, mut others) = (0.0, [0.0; 2]);
    for seed in 0..seeds {
        let (truth, state, covariance) = stand(seed);
        let error = state.error_to(&truth);
        let nees = |error: Vector3<f64>, from: usize| {
            let block = covariance.fixed_view::<3, 3>(from, from).into_owned();
            error.dot(&block.cholesky().expect("positive").solve(&error)) / seeds as f64
        };
        others[0] += nees(error.fixed_rows::<3>(POSITION).into_owned(), POSITION);
        others[1] += nees(error.fixed_rows::<3>(RATES_BIAS).into_owned(), RATES_BIAS);
        let block: SMatrix<f64, 6, 6> = covariance.fixed_view::<6, 6>(ATTITUDE, ATTITUDE).into_owned();
        let error = error.fixed_rows::<6>(ATTITUDE).into_owned();
        together += error.dot(&block.cholesky().expect("positive").solve(&error)) / seeds as f64;
    }
    check_mean("NEES of attitude and bias", together, 6.0, seeds as f64);
    check_mean("NEES of the position", others[0], 3.0, seeds as f64);
    check_mean("NEES of the gyros", others[1], 3.0, seeds as f64);
}

#[test]
fn a_unit_without_a_field_or_a_fix_is_not_aligned() {
    let (imu, field) = (Imu { specific_force_mps2: Vector3::z() * -9.81, ..Imu::default() }, Vector3::x());
    for aiding in [Aiding { field: Some(field), ..Aiding::default() }, Aiding::default()] {
        let mut standstill = Standstill::default();
        standstill.add(&imu, &aiding);
        assert!(standstill.aligned(&NOISE, BIAS_MPS2, G_MPS2).is_none());
    }
}
