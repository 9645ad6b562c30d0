//! Alignment of a unit that stands still: attitude and biases from the means of its sensors' measurements.
//!
//! ```text
//! d = -f / |f|,   e = d x m / |d x m|,   n = e x d        down, east and north in body axes (TRIAD)
//! e_t = -(G x e_f) / g^2,   G = -f                        error of the tilt by the error e_f of the specific force f
//! e_h = (m_z n . e_t + e . e_m) / m_x + e_d               error of the heading by the errors e_m of the field,
//!                                                         (m_x, 0, m_z) by the map, and e_d of the declination
//! ```
//!
//! The rows of the rotation `R` from body to NED are n, e and d: three vectors from two, Shuster and Oh, *Three-axis
//! attitude determination from vector observations* (1981), section III. The error of the tilt comes from the
//! accelerometer's bias. Standing still does not separate tilt and bias, so the covariance has both and their
//! correlation. The same holds for the error of the heading, the vehicle's own field and the declination. The place
//! where the vehicle stands is known, so receiver and barometer measure their own errors there. The rotation of the
//! earth is left out.

use nalgebra::{Matrix3, Rotation3, RowVector3, UnitQuaternion, Vector3};

use crate::Aiding;
use crate::filter::MIN_HORIZONTAL;
use crate::noise::{Constants, ExpectedNoise, Wander};
use crate::state::{
    ACCELERATION_BIAS, ATTITUDE, BAROMETER_BIAS, Covariance, DECLINATION, DRIFT, HARD_IRON, Imu, POSITION, RATES_BIAS,
    State, VELOCITY,
};

/// Standard deviations of position and velocity of a vehicle that stands \[m, m/s\].
const STILL_M: f64 = 1e-3;
const STILL_MPS: f64 = 0.01;

/// Mean of a number of measurements.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: Vector3<f64>,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: &Vector3<f64>) {
        self.sum += value;
        self.count += 1.0;
    }

    fn value(&self) -> Option<Vector3<f64>> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }
}

/// Measurements of a unit that stands still.
#[derive(Debug, Clone, Copy, Default)]
pub struct Standstill {
    specific_force: Mean,
    rates: Mean,
    field: Mean,
    position: Mean,
    height: Mean,
}

impl Standstill {
    /// Receives a sample of the IMU and the other measurements at its end.
    pub fn add(&mut self, imu: &Imu, aiding: &Aiding) {
        self.specific_force.add(&imu.specific_force_mps2);
        self.rates.add(&imu.rates_radps);
        aiding.field.iter().for_each(|field| self.field.add(field));
        aiding.position_m.iter().for_each(|position_m| self.position.add(position_m));
        aiding.height_m.iter().for_each(|height_m| self.height.add(&Vector3::repeat(*height_m)));
    }

    /// Returns state and covariance after an alignment at `position_m`, NED, over `time_s`, of sensors with
    /// `constants`. `None` without a fix, a field or a specific force. The less horizontal the field is, the larger is
    /// the deviation of the heading.
    pub fn aligned(
        &self,
        position_m: Vector3<f64>,
        time_s: f64,
        noise: &ExpectedNoise,
        constants: &Constants,
        g_mps2: f64,
    ) -> Option<(State, Covariance)> {
        let (force, field) = (self.specific_force.value()?, self.field.value()?);
        let down = -force.try_normalize(0.0)?;
        let level = down.cross(&field);
        let east = level.try_normalize(0.0)?;
        // The Jacobian must be the filter's. A Jacobian at the measured field would differ, which would make the
        // heading observable at rest.
        let inclination_rad = noise.inclination_rad;
        let horizontal = libm::cos(inclination_rad).max(MIN_HORIZONTAL);
        let north = east.cross(&down);
        let axes = Matrix3::from_rows(&[north.transpose(), east.transpose(), down.transpose()]);
        let height_m = self.height.value().map_or(-position_m.z, |height| height.x);
        let state = State {
            position_m,
            attitude: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
            rates_bias_radps: self.rates.value()?,
            drift_m: self.position.value()? - position_m,
            barometer_bias_m: height_m + position_m.z,
            ..State::default()
        };

        let diagonal = Matrix3::from_diagonal_element;
        let of_biases = constants.acceleration_bias_mps2.map(|bias| bias * bias);
        let of_biases = Matrix3::from_diagonal(&of_biases);
        let of_force = diagonal(white(noise.specific_force_mps2, &self.specific_force)) + of_biases;
        let of_iron = noise.hard_iron.start * noise.hard_iron.start;
        let of_field = white(noise.field, &self.field) + of_iron;
        let of_declination = constants.declination_rad * constants.declination_rad;
        let tilt = down.cross_matrix() * (-1.0 / g_mps2);
        let turned: RowVector3<f64> = north.transpose() * tilt * libm::tan(inclination_rad);
        let by_force = tilt + down * turned;
        let by_field = down * east.transpose() / horizontal;

        let mut covariance = constants.covariance(noise);
        let mut put = |row: usize, column: usize, block: Matrix3<f64>| {
            covariance.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
            covariance.fixed_view_mut::<3, 3>(column, row).copy_from(&block.transpose());
        };
        put(POSITION, POSITION, diagonal(STILL_M * STILL_M));
        put(VELOCITY, VELOCITY, diagonal(STILL_MPS * STILL_MPS));
        put(
            ATTITUDE,
            ATTITUDE,
            by_force * of_force * by_force.transpose()
                + by_field * by_field.transpose() * of_field
                + down * down.transpose() * of_declination,
        );
        put(ATTITUDE, ACCELERATION_BIAS, by_force * of_biases);
        put(ATTITUDE, HARD_IRON, by_field * of_iron);
        put(RATES_BIAS, RATES_BIAS, diagonal(white(noise.rates_radps, &self.rates)));
        let drift = Vector3::from_fn(|i, _| since(noise.position_m[i], &noise.drift[i], &self.position, time_s));
        put(DRIFT, DRIFT, Matrix3::from_diagonal(&drift));
        covariance.fixed_view_mut::<3, 1>(ATTITUDE, DECLINATION).copy_from(&(down * of_declination));
        covariance.fixed_view_mut::<1, 3>(DECLINATION, ATTITUDE).copy_from(&(down * of_declination).transpose());
        if self.height.count > 0.0 {
            // The start deviation remains: the errors by the pressure of rotors and wind begin with the flight.
            covariance[(BAROMETER_BIAS, BAROMETER_BIAS)] +=
                since(noise.height_m, &noise.barometer, &self.height, time_s);
        }
        Some((state, covariance))
    }
}

/// Variance of a mean of measurements with white noise of the standard deviation `deviation`.
fn white(deviation: f64, mean: &Mean) -> f64 {
    deviation * deviation / mean.count
}

/// Variance of the error with which a mean over `time_s`, with white noise, estimates the end of a random walk.
fn since(deviation: f64, wander: &Wander, mean: &Mean, time_s: f64) -> f64 {
    white(deviation, mean) + wander.walk * wander.walk * time_s / 3.0
}

#[cfg(test)]
mod tests;
