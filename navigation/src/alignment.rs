//! Alignment of a unit that stands still: attitude and biases from the means of what its sensors measure.
//!
//! ```text
//! d = -f / |f|,   e = d x m / |d x m|,   n = e x d        down, east and north in body axes (TRIAD)
//! e_t = -(G x e_f) / g^2,   G = -f                        error of the tilt by that of the specific force f
//! e_h = (m_z n . e_t + e . e_m) / m_x                     error of the heading by that of the field m = (m_x, 0, m_z)
//! ```
//!
//! The rows of `R` are n, e and d: three vectors from two, Shuster and Oh, *Three-axis attitude determination from
//! vector observations* (1981), section III. The error of the tilt is that of the accelerometer's bias, which standing
//! still does not tell apart: the covariance has both, and that they go together. The rotation of the earth is left
//! out.

use nalgebra::{Matrix3, Rotation3, RowVector3, UnitQuaternion, Vector3};

use crate::Aiding;
use crate::filter::{MIN_HORIZONTAL, Noise};
use crate::state::{ACCELERATION_BIAS, ATTITUDE, Covariance, Imu, POSITION, RATES_BIAS, State, VELOCITY};

/// Standard deviation of the velocity of a vehicle that stands \[m/s\].
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
    /// Receives a sample of the IMU and what was measured at its end.
    pub fn add(&mut self, imu: &Imu, aiding: &Aiding) {
        self.specific_force.add(&imu.specific_force_mps2);
        self.rates.add(&imu.rates_radps);
        aiding.field.iter().for_each(|field| self.field.add(field));
        aiding.position_m.iter().for_each(|position_m| self.position.add(position_m));
        aiding.height_m.iter().for_each(|height_m| self.height.add(&Vector3::repeat(*height_m)));
    }

    /// Mean position, NED \[m\], and mean height \[m\]; 0 without a measurement.
    pub fn place(&self) -> (Vector3<f64>, f64) {
        (self.position.value().unwrap_or_default(), self.height.value().unwrap_or_default().x)
    }

    /// Returns state and covariance after the alignment, with an accelerometer whose bias has the deviation
    /// `bias_mps2`. `None` without a fix, a field or a specific force. The less horizontal the field is, the larger is
    /// the deviation of the heading.
    pub fn aligned(&self, noise: &Noise, bias_mps2: f64, g_mps2: f64) -> Option<(State, Covariance)> {
        let (force, field) = (self.specific_force.value()?, self.field.value()?);
        let down = -force.try_normalize(0.0)?;
        let level = down.cross(&field);
        let (east, horizontal) = (level.try_normalize(0.0)?, level.norm().max(MIN_HORIZONTAL));
        let north = east.cross(&down);
        let axes = Matrix3::from_rows(&[north.transpose(), east.transpose(), down.transpose()]);
        let state = State {
            position_m: self.position.value()?,
            attitude: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
            rates_bias_radps: self.rates.value()?,
            ..State::default()
        };

        let tilt = down.cross_matrix() * (-1.0 / g_mps2);
        let turned: RowVector3<f64> = north.transpose() * tilt * (field.dot(&down) / horizontal);
        let by_force = tilt + down * turned;
        let by_field = down * east.transpose() / horizontal;
        let variance = |white: f64, mean: &Mean| white * white / mean.count;
        let of_bias = bias_mps2 * bias_mps2;
        let of_force = variance(noise.specific_force_mps2, &self.specific_force) + of_bias;
        let of_field = variance(noise.field, &self.field);
        let mut covariance = Covariance::zeros();
        let mut put = |row: usize, column: usize, block: Matrix3<f64>| {
            covariance.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        };
        let diagonal = Matrix3::from_diagonal_element;
        put(POSITION, POSITION, Matrix3::from_diagonal(&noise.position_m.map(|white| variance(white, &self.position))));
        put(VELOCITY, VELOCITY, diagonal(STILL_MPS * STILL_MPS));
        put(
            ATTITUDE,
            ATTITUDE,
            by_force * by_force.transpose() * of_force + by_field * by_field.transpose() * of_field,
        );
        put(ATTITUDE, ACCELERATION_BIAS, by_force * of_bias);
        put(ACCELERATION_BIAS, ATTITUDE, by_force.transpose() * of_bias);
        put(ACCELERATION_BIAS, ACCELERATION_BIAS, diagonal(of_bias));
        put(RATES_BIAS, RATES_BIAS, diagonal(variance(noise.rates_radps, &self.rates)));
        Some((state, covariance))
    }
}

#[cfg(test)]
mod tests;
