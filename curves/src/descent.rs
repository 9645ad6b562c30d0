//! Landing: down at a constant sink rate, to below the ground.
//!
//! The vehicle stands before the descent ends. Then the reference still sinks, from which the mixer detects the
//! landing. The sink rate begins and ends with a ramp of one second, `10 x^3 - 15 x^4 + 6 x^5`, so that velocity and
//! acceleration are continuous.

use nalgebra::Vector3;

use crate::progress::{LegProgress, min_jerk};
use crate::setpoint::Setpoint;

/// Depth below the ground at which the descent ends \[m\].
pub const DEPTH_M: f64 = 0.2;
/// Duration of each ramp of the sink rate \[s\].
const RAMP_S: f64 = 1.0;

/// Descent in time.
#[derive(Debug, Clone, Copy)]
pub struct Descent {
    from: Vector3<f64>,
    sink_mps: f64,
    cruise_s: f64,
}

impl Descent {
    /// Makes the descent from `from` to [`DEPTH_M`] below `standing_down_m`, the down position of a standing vehicle.
    /// The sink rate is `sink_mps`, or less if the ground is too near to reach this rate.
    pub fn new(from: Vector3<f64>, standing_down_m: f64, sink_mps: f64) -> Self {
        let way_m = (standing_down_m + DEPTH_M - from.z).max(0.0);
        let sink_mps = sink_mps.min(way_m / RAMP_S);
        let cruise_s = if sink_mps > 0.0 { way_m / sink_mps - RAMP_S } else { 0.0 };
        Self { from, sink_mps, cruise_s }
    }

    /// Duration \[s\].
    pub fn duration_s(&self) -> f64 {
        self.cruise_s + 2.0 * RAMP_S
    }

    /// Times at which ramps begin and end \[s\].
    pub fn times_s(&self) -> [f64; 4] {
        [0.0, RAMP_S, RAMP_S + self.cruise_s, self.duration_s()]
    }

    /// Reference at `t_s`; at rest before 0 and after the end.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let left_s = self.duration_s() - t_s;
        let (sunk_s, rate) = if t_s < RAMP_S {
            (ramped_s(t_s), min_jerk(t_s, RAMP_S))
        } else if left_s > RAMP_S {
            (t_s - RAMP_S / 2.0, LegProgress { s: 1.0, ds: 0.0, dds: 0.0 })
        } else {
            let rate = min_jerk(left_s, RAMP_S);
            (self.cruise_s + RAMP_S - ramped_s(left_s), LegProgress { ds: -rate.ds, ..rate })
        };
        let down = Vector3::z() * self.sink_mps;
        Setpoint {
            position_m: (self.from + down * sunk_s).into(),
            velocity_mps: (down * rate.s).into(),
            acceleration_mps2: (down * rate.ds).into(),
        }
    }
}

/// Integral of the ramp from 0 to `t_s` \[s\].
fn ramped_s(t_s: f64) -> f64 {
    let x = (t_s / RAMP_S).clamp(0.0, 1.0);
    let x2 = x * x;
    RAMP_S * x2 * x2 * (2.5 + x * (x - 3.0))
}
