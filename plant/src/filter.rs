//! Complementary filter behind the sensors: gyros at high frequencies, attitude and position measurements at low ones.
//!
//! ```text
//! e      = rotation vector from the estimate to the measured attitude, body
//! R'     = R [p q r - b + 2 w e]x,   b' = -w^2 e
//! x'     = R v + w (x_measured - x)
//! ```
//!
//! w is the bandwidth. This is the nonlinear complementary filter on rotations with an estimate of the gyros' bias
//! (Mahony, Hamel and Pflimlin, IEEE Transactions on Automatic Control 53(5), 2008), critically damped, with a
//! first-order filter for the position. The velocity is not filtered.

use contract::message::Kinematics;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::memory::Tape;

/// Complementary filter with its estimates.
#[derive(Debug, Clone)]
pub struct ComplementaryFilter {
    /// Bandwidth w \[rad/s\].
    bandwidth: f64,
    sample_s: f64,
    estimate: Option<Estimate>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Estimate {
    attitude: UnitQuaternion<f64>,
    /// Bias of the gyros \[rad/s\].
    bias: Vector3<f64>,
    position: Vector3<f64>,
    /// Body velocity \[m/s\].
    velocity: Vector3<f64>,
    /// Rates without the bias \[rad/s\].
    rates: Vector3<f64>,
}

impl ComplementaryFilter {
    /// Builds a filter of a `bandwidth` \[rad/s\] for samples `sample_s` apart; it starts at the first sample.
    pub fn new(bandwidth: f64, sample_s: f64) -> Self {
        Self { bandwidth, sample_s, estimate: None }
    }

    /// Writes or reads the estimates.
    pub fn remember(&mut self, tape: &mut Tape) {
        tape.option(&mut self.estimate, |tape, Estimate { attitude, bias, position, velocity, rates }| {
            let mut turned: [f64; 4] = attitude.coords.into();
            tape.numbers(&mut turned);
            *attitude = UnitQuaternion::new_unchecked(Quaternion::from(turned));
            for vector in [bias, position, velocity, rates] {
                tape.numbers(vector.as_mut_slice());
            }
        });
    }

    /// Updates the estimate by a sample of the sensors and returns it.
    pub fn update(&mut self, raw: &Kinematics) -> Kinematics {
        let [roll, pitch, yaw] = raw.attitude_rad;
        let measured = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let (position, rates) = (Vector3::from(raw.position_m), Vector3::from(raw.rates_radps));
        let (w, dt) = (self.bandwidth, self.sample_s);
        let next = match self.estimate {
            None => Estimate {
                attitude: measured,
                bias: Vector3::zeros(),
                position,
                velocity: raw.velocity_mps.into(),
                rates,
            },
            Some(Estimate { attitude, bias, position: before, velocity, rates: last }) => {
                let turned = attitude * UnitQuaternion::from_scaled_axis((last + rates - bias) * (dt / 2.0));
                let error = (turned.inverse() * measured).scaled_axis();
                let moved = before + turned * velocity * dt;
                let bias = bias - error * (w * w * dt);
                Estimate {
                    attitude: turned * UnitQuaternion::from_scaled_axis(error * (2.0 * w * dt)),
                    bias,
                    position: moved + (position - moved) * (w * dt),
                    velocity: raw.velocity_mps.into(),
                    rates: rates - bias,
                }
            }
        };
        self.estimate = Some(next);
        let (roll, pitch, yaw) = next.attitude.euler_angles();
        Kinematics {
            position_m: next.position.into(),
            velocity_mps: raw.velocity_mps,
            attitude_rad: [roll, pitch, yaw],
            rates_radps: next.rates.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 0.01;

    /// Last truth and estimate of a flight ahead at 2 m/s with a turn of 0.5 rad/s, with the sensors of `measure`.
    fn follow(samples: u32, mut measure: impl FnMut(Kinematics, u32) -> Kinematics) -> (Kinematics, Kinematics) {
        let mut filter = ComplementaryFilter::new(1.0, DT_S);
        let (rate, speed) = (0.5, 2.0);
        let truth = |k: u32| {
            let yaw = rate * DT_S * f64::from(k);
            Kinematics {
                position_m: [speed / rate * yaw.sin(), speed / rate * (1.0 - yaw.cos()), -3.0],
                velocity_mps: [speed, 0.0, 0.0],
                attitude_rad: [0.0, 0.0, airframe::angle::wrapped(yaw)],
                rates_radps: [0.0, 0.0, rate],
            }
        };
        let estimates = (0..samples).map(|k| filter.update(&measure(truth(k), k)));
        (truth(samples - 1), estimates.last().expect("some samples"))
    }

    #[test]
    fn the_estimate_follows_a_full_turn() {
        let (truth, estimate) = follow(3000, |truth, _| truth);
        for (a, b) in [(truth.position_m, estimate.position_m), (truth.attitude_rad, estimate.attitude_rad)] {
            assert!((0..3).all(|i| (a[i] - b[i]).abs() < 0.02), "{a:?} and {b:?}");
        }
    }

    #[test]
    fn the_filter_finds_the_bias_of_the_gyros() {
        let (truth, estimate) = follow(3000, |mut truth, _| {
            truth.rates_radps[0] += 0.05;
            truth
        });
        assert!((0..3).all(|i| (truth.rates_radps[i] - estimate.rates_radps[i]).abs() < 1e-3));
        assert!(estimate.attitude_rad[0].abs() < 1e-3);
    }

    #[test]
    fn noise_of_the_attitude_is_reduced_and_a_step_is_followed() {
        let (_, estimate) = follow(3000, |mut truth, k| {
            truth.attitude_rad[0] += if k % 2 == 0 { 0.05 } else { -0.05 };
            truth
        });
        assert!(estimate.attitude_rad[0].abs() < 0.003, "{:?}", estimate.attitude_rad);
        let (_, estimate) = follow(3000, |mut truth, k| {
            truth.position_m[2] = if k < 1500 { 0.0 } else { -1.0 };
            truth
        });
        assert!((estimate.position_m[2] + 1.0).abs() < 1e-3);
    }
}
