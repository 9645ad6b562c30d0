//! Whether the numbers of a message can be true, as far as the message alone tells.

use super::{Actuators, Controls, Kinematics, Reference, State};

/// Largest position \[m\] and velocity \[m/s\]: twenty times the 500 m at which a flight counts as diverged.
const MAX_POSITION_M_VELOCITY_MPS: f64 = 1e4;
/// Largest Euler angle, heading reference or tilt \[rad\]: some sixteen turns. Angles are kept within a few.
const MAX_ANGLE_RAD: f64 = 100.0;
/// Largest body rate \[rad/s\]: ten times the rate at which a flight counts as diverged.
const MAX_RATE_RADPS: f64 = 1e3;
/// Largest force \[N\], moment \[N m\] and rotor speed \[rotor speed unit\]: hundreds of times what the actuators do.
const MAX_DEMAND: f64 = 1e6;

/// A message whose numbers can be judged without any other.
pub trait Plausible {
    /// Whether every number that a receiver computes with is finite and within the limits above.
    fn plausible(&self) -> bool;
}

impl Plausible for State {
    /// Attitude and rates must be there: without them no controller can fly. A position or velocity that is NaN is a
    /// sensor that is off, and the nodes that need it handle that.
    fn plausible(&self) -> bool {
        let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = &self.measured;
        let off = |value: &f64| value.is_nan() || within(&[*value], MAX_POSITION_M_VELOCITY_MPS);
        position_m.iter().chain(velocity_mps).all(off)
            && within(attitude_rad, MAX_ANGLE_RAD)
            && within(rates_radps, MAX_RATE_RADPS)
            && within(&self.command_in_force.rotor_speed, MAX_DEMAND)
            && within(&[self.command_in_force.tilt_rad], MAX_ANGLE_RAD)
    }
}

impl Plausible for Reference {
    fn plausible(&self) -> bool {
        within(&self.attitude_rad, MAX_ANGLE_RAD)
            && within(&self.rates_radps, MAX_RATE_RADPS)
            && within(&[self.w_mps], MAX_POSITION_M_VELOCITY_MPS)
    }
}

impl Plausible for Controls {
    fn plausible(&self) -> bool {
        within(&self.demand, MAX_DEMAND)
    }
}

impl Plausible for Actuators {
    fn plausible(&self) -> bool {
        within(&self.command.rotor_speed, MAX_DEMAND) && within(&[self.command.tilt_rad], MAX_ANGLE_RAD)
    }
}

/// Whether all are finite and no larger than `bound` either way.
fn within(values: &[f64], bound: f64) -> bool {
    values.iter().all(|value| value.abs() <= bound) // false for NaN
}
