//! Errors that the filter expects of its sensors, and of its estimate at the start.
//!
//! The systematic error of a sensor is a first-order Gauss-Markov process ([`Wander`]), as in section 3.6 of Groves,
//! *Principles of GNSS, inertial, and multisensor integrated navigation systems* (2013): drift of the receiver, bias of
//! the barometer, and the vehicle's own field (hard iron). The declination is a constant.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::state::{
    ACCELERATION_BIAS, ATTITUDE, BAROMETER_BIAS, Covariance, DECLINATION, DRIFT, HARD_IRON, POSITION, RATES_BIAS,
    StateError, VELOCITY,
};

/// First-order Gauss-Markov process: `dx = -x / time dt + walk dW`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wander {
    /// Standard deviation at the start \[unit\].
    pub start: f64,
    /// Random walk \[unit / sqrt(s)\].
    pub walk: f64,
    /// Time constant \[s\]; infinite for a random walk.
    pub time_s: f64,
}

impl Wander {
    /// Returns a process that is stationary with a `deviation`, or stays as it began if `time_s` is infinite.
    pub fn stationary(deviation: f64, time_s: f64) -> Self {
        Self { start: deviation, walk: deviation * (2.0 / time_s).sqrt(), time_s }
    }

    /// Share of a value that is left after `dt_s`, and variance that the random walk adds in this time, to first order.
    pub(crate) fn step(&self, dt_s: f64) -> (f64, f64) {
        (libm::exp(-dt_s / self.time_s), self.walk * self.walk * dt_s)
    }
}

/// Standard deviations of the errors that the filter expects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpectedNoise {
    /// Specific force of one sample \[m/s2\].
    pub specific_force_mps2: f64,
    /// Body rates of one sample \[rad/s\].
    pub rates_radps: f64,
    /// Random walk of the accelerometer's bias \[m/s2 / sqrt(s)\].
    pub acceleration_bias_walk: f64,
    /// Random walk of the gyros' bias \[rad/s / sqrt(s)\].
    pub rates_bias_walk: f64,
    /// Position of the satellite receiver, NED \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity of the satellite receiver, NED \[m/s\].
    pub velocity_mps: Vector3<f64>,
    /// Height by the barometer \[m\].
    pub height_m: f64,
    /// Share of the dynamic pressure of the vehicle's velocity that the barometer takes for static pressure.
    pub wind_pressure: f64,
    /// Field by the magnetometer, as a share of the earth's.
    pub field: f64,
    /// Angle of the earth's field below the horizon, by the map \[rad\]: a known constant.
    pub inclination_rad: f64,
    /// Velocity over the ground \[m/s\].
    pub flow_mps: f64,
    /// Place of the receiver's antenna, each body axis \[m\].
    pub antenna_m: f64,
    /// Time of the receiver's measurements \[s\].
    pub clock_s: f64,
    /// Drift of the receiver's position, NED \[m\].
    pub drift: [Wander; 3],
    /// Bias of the barometer \[m\].
    pub barometer: Wander,
    /// The vehicle's own field on each body axis, as a share of the earth's.
    pub hard_iron: Wander,
}

impl ExpectedNoise {
    /// Processes of the error states from [`DRIFT`] up to [`DECLINATION`], which is not included.
    pub(crate) fn wandering(&self) -> [Wander; DECLINATION - DRIFT] {
        let Self { drift: [north, east, down], barometer, hard_iron, .. } = *self;
        [north, east, down, barometer, hard_iron, hard_iron, hard_iron]
    }
}

/// Standard deviations of the error at the start; the deviations of the wandering errors are in [`ExpectedNoise`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialErrors {
    /// Position, each axis \[m\].
    pub position_m: f64,
    /// Velocity, each axis \[m/s\].
    pub velocity_mps: f64,
    /// Roll and pitch \[rad\].
    pub tilt_rad: f64,
    /// Heading \[rad\].
    pub heading_rad: f64,
    /// Constant errors.
    pub constants: Constants,
}

/// Standard deviations of constant errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constants {
    /// Bias of the accelerometer, body \[m/s2\].
    pub acceleration_bias_mps2: Vector3<f64>,
    /// Bias of the gyros, body \[rad/s\].
    pub rates_bias_radps: Vector3<f64>,
    /// Declination \[rad\].
    pub declination_rad: f64,
}

impl InitialErrors {
    /// Covariance of the error about an `attitude`.
    pub fn covariance(&self, attitude: &UnitQuaternion<f64>, noise: &ExpectedNoise) -> Covariance {
        let Self { position_m, velocity_mps, tilt_rad, heading_rad, constants } = self;
        let axes = *attitude.to_rotation_matrix().matrix();
        let level = Matrix3::from_diagonal(&Vector3::new(*tilt_rad, *tilt_rad, *heading_rad));
        let level = level * axes;
        let mut covariance = constants.covariance(noise);
        let mut put =
            |from: usize, block: Matrix3<f64>| covariance.fixed_view_mut::<3, 3>(from, from).copy_from(&block);
        put(POSITION, Matrix3::from_diagonal_element(position_m * position_m));
        put(VELOCITY, Matrix3::from_diagonal_element(velocity_mps * velocity_mps));
        put(ATTITUDE, level.transpose() * level);
        covariance
    }
}

impl Constants {
    /// Covariance of a filter that knows the motion exactly, but of the sensors' errors only the deviations.
    pub(crate) fn covariance(&self, noise: &ExpectedNoise) -> Covariance {
        let Self { acceleration_bias_mps2, rates_bias_radps, declination_rad } = self;
        let mut deviations = StateError::zeros();
        for (from, part) in [
            (ACCELERATION_BIAS, *acceleration_bias_mps2),
            (RATES_BIAS, *rates_bias_radps),
            (DRIFT, noise.drift.map(|wander| wander.start).into()),
            (HARD_IRON, Vector3::repeat(noise.hard_iron.start)),
        ] {
            deviations.fixed_rows_mut::<3>(from).copy_from(&part);
        }
        (deviations[BAROMETER_BIAS], deviations[DECLINATION]) = (noise.barometer.start, *declination_rad);
        Covariance::from_diagonal(&deviations.component_mul(&deviations))
    }
}
