//! Straight legs from waypoint to waypoint, with a pace of their own: of a leg of duration T the share s is covered at
//! time t ([`progress`](crate::progress)).
//!
//! | ramp | s |
//! |---|---|
//! | 0 | t / T |
//! | ta | trapezoid of velocity: ramps of ta, cruise at 1 / (T - ta) |
//! | `None` | 10 x^3 - 15 x^4 + 6 x^5 with x = t / T: min-jerk |

use nalgebra::Vector3;

use crate::progress::{min_jerk, trapezoid};
use crate::setpoint::Setpoint;

/// Straight legs between waypoints.
#[derive(Debug, Clone)]
pub struct Legs {
    /// Waypoints, each with the time at which it is reached \[s\], increasing.
    pub waypoints: Vec<(f64, Vector3<f64>)>,
    /// Ramp of the velocity at both ends of each leg \[s\], at most half the duration of the leg; `None` = min-jerk.
    pub ramp_s: Option<f64>,
}

impl Legs {
    /// Reference at `t_s`; at rest before the first waypoint and after the last.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let place = |(at_s, position): &(f64, Vector3<f64>)| (*at_s, (*position).into());
        Setpoint::along(&self.waypoints, place, t_s, |(from_s, from), (until_s, to)| {
            let (since_s, duration_s) = (t_s - from_s, until_s - from_s);
            let progress = match self.ramp_s {
                None => min_jerk(since_s, duration_s),
                Some(ramp_s) => trapezoid(since_s, duration_s, ramp_s),
            };
            let way = to - from;
            Setpoint {
                position_m: (from + way * progress.s).into(),
                velocity_mps: (way * progress.ds).into(),
                acceleration_mps2: (way * progress.dds).into(),
            }
        })
    }
}
