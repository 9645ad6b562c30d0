//! Rotors and tilt servo: first-order lag with amplitude and rate limits.
//!
//! The paper models the actuators "as first order transfer functions including amplitude and rate limits" and bounds
//! them by (52)-(53), `0 < Omega_i < 2 Omega_i,trim` and `|mu| < pi/2`:
//!
//! ```text
//! ds/dt = clip((clip(command, min, max) - s) / tau, -rate, rate)
//! ```

use contract::actuation::Actuation;

use crate::parameters::Parameters;
use crate::trim::Trim;

/// Amplitude limits (52)-(53), the same in the plant, the controller and the mixer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatorLimits {
    /// Lowest rotor speed (idle) \[rotor speed unit\].
    pub rotor_speed_min: f64,
    /// Highest rotor speed, one per rotor \[rotor speed unit\].
    pub rotor_speed_max: [f64; 3],
    /// Largest tilt either way \[rad\].
    pub tilt_max_rad: f64,
}

impl ActuatorLimits {
    /// Limits whose highest speed is `max_ratio` times the trim speed (52), which is taken without the tilt reaction.
    pub fn new(vehicle: &Parameters, rotor_speed_min: f64, max_ratio: f64, tilt_max_rad: f64) -> Self {
        let trim = Trim::solve(vehicle, false).actuation.rotor_speed;
        Self { rotor_speed_min, rotor_speed_max: trim.map(|omega| max_ratio * omega), tilt_max_rad }
    }

    /// Least and largest thrust with which the moments still vanish, as shares of the thrust of the hover `trim`: the
    /// squared rotor speeds are then in proportion to those of hover.
    pub fn thrust_range(&self, trim: &Actuation) -> [f64; 2] {
        let share = |limit: f64, omega: f64| (limit / omega) * (limit / omega);
        let least = trim.rotor_speed.map(|omega| share(self.rotor_speed_min, omega));
        let most = [0, 1, 2].map(|i| share(self.rotor_speed_max[i], trim.rotor_speed[i]));
        [least.into_iter().fold(0.0, f64::max), most.into_iter().fold(f64::INFINITY, f64::min)]
    }

    /// Returns the nearest position inside the limits; a NaN becomes the lower limit, a NaN tilt zero.
    pub fn clip(&self, command: &Actuation) -> Actuation {
        let mut rotor_speed = command.rotor_speed;
        for (omega, max) in rotor_speed.iter_mut().zip(self.rotor_speed_max) {
            *omega = omega.max(self.rotor_speed_min).min(max);
        }
        let tilt = if command.tilt_rad.is_nan() { 0.0 } else { command.tilt_rad };
        Actuation { rotor_speed, tilt_rad: tilt.clamp(-self.tilt_max_rad, self.tilt_max_rad) }
    }
}

/// First-order lag of all four actuators.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatorLaw {
    /// Amplitude limits, applied to the command.
    pub limits: ActuatorLimits,
    /// Time constant of the rotors \[s\]; 0 means no lag. [`advance`](Self::advance) accepts 0, `rate` does not.
    pub rotor_lag_s: f64,
    /// Time constant of the tilt servo \[s\]; 0 means no lag, for [`advance`](Self::advance) only.
    pub servo_lag_s: f64,
    /// Rate limit of the rotors \[rotor speed unit / s\].
    pub rotor_rate_limit: f64,
    /// Rate limit of the tilt servo \[rad/s\].
    pub servo_rate_limit_radps: f64,
}

impl ActuatorLaw {
    /// Rate of change of `position` under an already clipped `command`, per second; the lags must be positive.
    #[inline]
    pub fn rate(&self, position: &Actuation, command: &Actuation) -> Actuation {
        self.each(position, command, |s, to, tau_s, rate| ((to - s) / tau_s).clamp(-rate, rate))
    }

    /// Position after `command` was held for `dt_s`, in closed form: first at the rate limit, then exponential.
    pub fn advance(&self, position: &Actuation, command: &Actuation, dt_s: f64) -> Actuation {
        let command = self.limits.clip(command);
        self.each(position, &command, |s, to, tau_s, rate| first_order(s, to, tau_s, rate, dt_s))
    }

    /// Computes the `response` of each actuator to its position, command, lag and rate limit.
    #[inline]
    fn each(
        &self,
        position: &Actuation,
        command: &Actuation,
        response: impl Fn(f64, f64, f64, f64) -> f64,
    ) -> Actuation {
        let rotor = |i: usize| {
            response(position.rotor_speed[i], command.rotor_speed[i], self.rotor_lag_s, self.rotor_rate_limit)
        };
        let tilt_rad = response(position.tilt_rad, command.tilt_rad, self.servo_lag_s, self.servo_rate_limit_radps);
        Actuation { rotor_speed: std::array::from_fn(rotor), tilt_rad }
    }
}

/// Rate-limited first-order response from `s` towards `to` after `dt_s`.
fn first_order(s: f64, to: f64, tau_s: f64, rate: f64, dt_s: f64) -> f64 {
    let gap = to - s;
    // While the gap exceeds rate * tau the rate limit is active, and the position changes at that rate.
    let straight_s = ((gap.abs() - rate * tau_s) / rate).clamp(0.0, dt_s);
    let left = gap - gap.signum() * rate * straight_s;
    if tau_s > 0.0 { to - left * libm::exp(-(dt_s - straight_s) / tau_s) } else { to - left }
}
