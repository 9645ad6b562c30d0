use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::state::{ERRORS, StateError, turn};
use crate::tests::{G_MPS2, NOISE, START, check_mean, draw};

/// Number of IMU samples, of which every tenth has a fix, a height and a field.
const SAMPLES: u32 = 1000;
const TIME_S: f64 = 5.0;

/// Truth of a vehicle that stands in a random attitude, and the state and covariance that the unit estimates.
fn stand(seed: u64) -> (State, State, Covariance) {
    let random = &mut ChaCha8Rng::seed_from_u64(seed);
    let truth = State {
        position_m: draw(random) * 10.0,
        attitude: turn(draw(random)),
        acceleration_bias_mps2: draw(random).component_mul(&START.constants.acceleration_bias_mps2),
        rates_bias_radps: draw(random) * 0.01,
        drift_m: draw(random),
        barometer_bias_m: draw(random).x,
        hard_iron: draw(random) * NOISE.hard_iron.start,
        declination_rad: draw(random).x * START.constants.declination_rad,
        velocity_mps: draw(random) * STILL_MPS,
    };
    let back = truth.attitude.inverse();
    let turned = turn(Vector3::z() * truth.declination_rad);
    let field = back * (turned * Vector3::new(0.4, 0.0, 0.9)) + truth.hard_iron;
    let mut standstill = Standstill::default();
    for sample in 0..SAMPLES {
        let force = back * Vector3::new(0.0, 0.0, -G_MPS2) + truth.acceleration_bias_mps2;
        let imu = Imu {
            specific_force_mps2: force + draw(random) * NOISE.specific_force_mps2,
            rates_radps: truth.rates_bias_radps + draw(random) * NOISE.rates_radps,
        };
        let aiding = Aiding {
            position_m: Some(truth.position_m + truth.drift_m + draw(random).component_mul(&NOISE.position_m)),
            height_m: Some(truth.barometer_bias_m - truth.position_m.z + draw(random).x * NOISE.height_m),
            field: Some(field + draw(random) * NOISE.field),
            ..Aiding::default()
        };
        standstill.add(&imu, &if sample % 10 == 0 { aiding } else { Aiding::default() });
    }
    let position_m = truth.position_m + draw(random) * STILL_M;
    let (state, covariance) = standstill
        .aligned(position_m, TIME_S, &still(&NOISE), &START.constants, G_MPS2)
        .expect("all sensors are there");
    (truth, state, covariance)
}

/// Noise of sensors whose drift and bias do not wander while the vehicle stands.
fn still(noise: &ExpectedNoise) -> ExpectedNoise {
    let constant = Wander::stationary(0.0, f64::INFINITY);
    ExpectedNoise { drift: [constant; 3], barometer: constant, ..*noise }
}

#[test]
fn val_errors_are_as_large_as_the_covariance_says() {
    let seeds = 200;
    let mut nees = 0.0;
    for seed in 0..seeds {
        let (truth, state, covariance) = stand(seed);
        let error: StateError = state.error_to(&truth);
        // The fixes correlate position with drift and height with bias, so the NEES is computed for the whole error.
        nees += error.dot(&covariance.cholesky().expect("positive").solve(&error)) / seeds as f64;
    }
    check_mean("NEES", nees, ERRORS as f64, seeds as f64);
}

#[test]
fn a_unit_without_a_field_or_a_fix_is_not_aligned() {
    let (imu, field) = (Imu { specific_force_mps2: Vector3::z() * -9.81, ..Imu::default() }, Vector3::x());
    for aiding in [Aiding { field: Some(field), ..Aiding::default() }, Aiding::default()] {
        let mut standstill = Standstill::default();
        standstill.add(&imu, &aiding);
        assert!(standstill.aligned(Vector3::zeros(), TIME_S, &NOISE, &START.constants, G_MPS2).is_none());
    }
}
