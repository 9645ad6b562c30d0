//! Check of the heading by the receiver's velocity: the angle between the changes of velocity by the IMU and the
//! changes that the receiver measures.
//!
//! ```text
//! a = change of the level velocity between two fixes by the IMU, with the estimated attitude;  b = by the receiver
//! angle = atan2(sum a x b, sum a . b),   deviation = s / sqrt(sum a^2),   s^2 = max(residual / (2 n - 1), 2 noise^2)
//! ```
//!
//! This is the turn of least squares between two sets of vectors (Wahba's problem in the plane). It needs no initial
//! heading and holds for any angle, like the bank of filters of PX4's `EKFGSF_yaw`; the filter itself corrects only
//! small errors of the heading. If the vehicle does not accelerate, the angle is unknown, which its deviation shows.

use bytemuck::{Pod, Zeroable};
use libm::{atan2, hypot};
use nalgebra::Vector2;

/// Time constant with which changes of velocity are forgotten \[s\].
const FORGET_S: f64 = 10.0;
/// Largest deviation of an angle that is returned \[rad\].
const MAX_DEVIATION: f64 = 0.2;
/// Smallest count of changes of velocity that gives an angle.
const MIN_COUNT: f64 = 10.0;

/// Sums over the recent changes of velocity.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct YawCheck {
    /// Change of velocity by the IMU since the last fix, north and east, and the time since then \[m/s, s\].
    change_mps: Vector2<f64>,
    since_s: f64,
    /// Velocity of the last fix \[m/s\]; without meaning while `fixes` is 0.
    last_mps: Vector2<f64>,
    dot: f64,
    cross: f64,
    of_imu: f64,
    of_receiver: f64,
    count: f64,
    fixes: f64,
}

impl YawCheck {
    /// Adds a change of velocity by the IMU over `dt_s`.
    pub fn moved(&mut self, change_mps: &Vector2<f64>, dt_s: f64) {
        self.change_mps += change_mps;
        self.since_s += dt_s;
    }

    /// Receives a velocity of the receiver, north and east.
    pub fn fix(&mut self, velocity_mps: &Vector2<f64>) {
        let (a, b) = (self.change_mps, velocity_mps - self.last_mps);
        if self.fixes > 0.0 && self.since_s < 1.0 {
            let left = libm::exp(-self.since_s / FORGET_S);
            let sums = [&mut self.dot, &mut self.cross, &mut self.of_imu, &mut self.of_receiver, &mut self.count];
            let new = [a.dot(&b), a.perp(&b), a.norm_squared(), b.norm_squared(), 1.0];
            sums.into_iter().zip(new).for_each(|(sum, new)| *sum = *sum * left + new);
        }
        (self.change_mps, self.since_s, self.last_mps) = (Vector2::zeros(), 0.0, *velocity_mps);
        self.fixes = 1.0;
    }

    /// Angle by which the attitude must be turned about the vertical, and its standard deviation \[rad\]; `None` if the
    /// angle is not known well. The receiver's velocity has a noise of `noise_mps`.
    pub fn turn(&self, noise_mps: f64) -> Option<(f64, f64)> {
        let Self { dot, cross, of_imu, of_receiver, count, .. } = *self;
        let size = hypot(dot, cross);
        let residual = (of_receiver - size * size / of_imu).max(0.0);
        let variance = (residual / (2.0 * count - 1.0)).max(2.0 * noise_mps * noise_mps);
        let deviation = (variance / of_imu).sqrt();
        (count >= MIN_COUNT && deviation < MAX_DEVIATION).then(|| (atan2(cross, dot), deviation))
    }

    /// Forgets all changes, because they were computed with the attitude before it was turned.
    pub fn forget(&mut self) {
        *self = Self { last_mps: self.last_mps, fixes: self.fixes, ..Self::default() };
    }
}

#[cfg(test)]
mod tests;
