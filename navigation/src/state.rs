//! Nominal state of the vehicle, and its motion over one sample of the IMU.
//!
//! ```text
//! a  = R Exp(w dt / 2) (f - b_a) + g,   w = w_m - b_g
//! p += v dt + a dt^2 / 2,   v += a dt,   R = R Exp(w dt)
//! ```
//!
//! This is eq. 260 (section 5.4) of Sola, *Quaternion kinematics for the error-state Kalman filter*, arXiv 1711.02508,
//! with the attitude at the middle of the sample: an IMU gives means over its sample.

use bytemuck::{Pod, Zeroable};
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

/// Number of error states.
pub const ERRORS: usize = 23;
/// First error state of the position.
pub const POSITION: usize = 0;
/// First error state of the velocity.
pub const VELOCITY: usize = 3;
/// First error state of the attitude.
pub const ATTITUDE: usize = 6;
/// First error state of the accelerometer's bias.
pub const ACCELERATION_BIAS: usize = 9;
/// First error state of the gyros' bias.
pub const RATES_BIAS: usize = 12;
/// First error state of the receiver's drift.
pub const DRIFT: usize = 15;
/// Error state of the barometer's bias.
pub const BAROMETER_BIAS: usize = 18;
/// First error state of the vehicle's own field.
pub const HARD_IRON: usize = 19;
/// Error state of the declination.
pub const DECLINATION: usize = 22;

/// Error of a [`State`]: position and velocity NED, attitude as a rotation vector in body axes, biases of the sensors.
pub type StateError = SVector<f64, ERRORS>;
/// Covariance of a [`StateError`].
pub type Covariance = SMatrix<f64, ERRORS, ERRORS>;

/// Sample of the IMU: means since the sample before.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Imu {
    /// Specific force, body \[m/s2\].
    pub specific_force_mps2: Vector3<f64>,
    /// Body rates \[rad/s\].
    pub rates_radps: Vector3<f64>,
}

/// Estimate of the motion and of the sensors' systematic errors.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct State {
    /// Rotation from body to NED axes.
    pub attitude: UnitQuaternion<f64>,
    /// Position, NED \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity, NED \[m/s\].
    pub velocity_mps: Vector3<f64>,
    /// Bias of the accelerometer, body \[m/s2\].
    pub acceleration_bias_mps2: Vector3<f64>,
    /// Bias of the gyros, body \[rad/s\].
    pub rates_bias_radps: Vector3<f64>,
    /// Drift of the receiver's position, NED \[m\].
    pub drift_m: Vector3<f64>,
    /// The vehicle's own field, body, as shares of the strength of the earth's.
    pub hard_iron: Vector3<f64>,
    /// Bias of the barometer's height \[m\].
    pub barometer_bias_m: f64,
    /// Azimuth of the earth's field, beyond the azimuth by the map \[rad\].
    pub declination_rad: f64,
}

impl State {
    /// Returns the state after a sample of the IMU of `dt_s`, with gravity `g_mps2` down.
    #[must_use]
    pub fn moved(&self, imu: &Imu, dt_s: f64, g_mps2: f64) -> Self {
        let half = turn((imu.rates_radps - self.rates_bias_radps) * (dt_s / 2.0));
        let middle = self.attitude * half;
        let acceleration =
            middle * (imu.specific_force_mps2 - self.acceleration_bias_mps2) + Vector3::new(0.0, 0.0, g_mps2);
        Self {
            position_m: self.position_m + self.velocity_mps * dt_s + acceleration * (dt_s * dt_s / 2.0),
            velocity_mps: self.velocity_mps + acceleration * dt_s,
            attitude: UnitQuaternion::new_normalize((middle * half).into_inner()),
            ..*self
        }
    }

    /// Jacobian of [`moved`](Self::moved) by the error at its start, to first order in `dt_s` (eqs. 268 to 270).
    pub fn transition(&self, imu: &Imu, dt_s: f64) -> Transition {
        let half = turn((imu.rates_radps - self.rates_bias_radps) * (dt_s / 2.0));
        let force = half * (imu.specific_force_mps2 - self.acceleration_bias_mps2);
        let rotation = *self.attitude.to_rotation_matrix().matrix();
        Transition {
            dt_s,
            velocity_attitude: -rotation * force.cross_matrix() * dt_s,
            velocity_bias: -rotation * half.to_rotation_matrix().matrix() * dt_s,
            attitude: *(half * half).inverse().to_rotation_matrix().matrix(),
        }
    }

    /// Adds an error (eq. 283).
    #[must_use]
    pub fn plus(&self, error: &StateError) -> Self {
        let part = |from: usize| error.fixed_rows::<3>(from).into_owned();
        Self {
            position_m: self.position_m + part(POSITION),
            velocity_mps: self.velocity_mps + part(VELOCITY),
            attitude: UnitQuaternion::new_normalize((self.attitude * turn(part(ATTITUDE))).into_inner()),
            acceleration_bias_mps2: self.acceleration_bias_mps2 + part(ACCELERATION_BIAS),
            rates_bias_radps: self.rates_bias_radps + part(RATES_BIAS),
            drift_m: self.drift_m + part(DRIFT),
            barometer_bias_m: self.barometer_bias_m + error[BAROMETER_BIAS],
            hard_iron: self.hard_iron + part(HARD_IRON),
            declination_rad: self.declination_rad + error[DECLINATION],
        }
    }

    /// Error that [`plus`](Self::plus) needs to reach `truth`.
    pub fn error_to(&self, truth: &Self) -> StateError {
        let mut error = StateError::zeros();
        for (from, part) in [
            (POSITION, truth.position_m - self.position_m),
            (VELOCITY, truth.velocity_mps - self.velocity_mps),
            (ATTITUDE, (self.attitude.inverse() * truth.attitude).scaled_axis()),
            (ACCELERATION_BIAS, truth.acceleration_bias_mps2 - self.acceleration_bias_mps2),
            (RATES_BIAS, truth.rates_bias_radps - self.rates_bias_radps),
            (DRIFT, truth.drift_m - self.drift_m),
            (HARD_IRON, truth.hard_iron - self.hard_iron),
        ] {
            error.fixed_rows_mut::<3>(from).copy_from(&part);
        }
        error[BAROMETER_BIAS] = truth.barometer_bias_m - self.barometer_bias_m;
        error[DECLINATION] = truth.declination_rad - self.declination_rad;
        error
    }
}

/// Rotation by a rotation vector.
pub fn turn(vector: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(vector)
}

/// Transition matrix of the error by its blocks. All other blocks are those of the identity; the decay of the wandering
/// errors is not included.
#[derive(Debug, Clone, Copy)]
pub struct Transition {
    dt_s: f64,
    velocity_attitude: Matrix3<f64>,
    velocity_bias: Matrix3<f64>,
    attitude: Matrix3<f64>,
}

impl Transition {
    /// Multiplies from the left: `F m`, without the zeros of F.
    pub fn times(&self, m: &Covariance) -> Covariance {
        let rows = |from: usize| m.fixed_rows::<3>(from);
        let mut product = *m;
        let mut put = |from: usize, value| product.fixed_rows_mut::<3>(from).copy_from(&value);
        put(POSITION, rows(POSITION) + rows(VELOCITY) * self.dt_s);
        put(
            VELOCITY,
            rows(VELOCITY) + self.velocity_attitude * rows(ATTITUDE) + self.velocity_bias * rows(ACCELERATION_BIAS),
        );
        put(ATTITUDE, self.attitude * rows(ATTITUDE) - rows(RATES_BIAS) * self.dt_s);
        product
    }
}
