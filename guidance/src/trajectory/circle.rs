//! Circle: a climb above the origin, laps around a centre to the east, and a descent.
//!
//! n laps take n T, with T = `mission.period_s`. The first half lap is the first half of a min-jerk lap of duration T1,
//! and the last half lap its second half. Between them the rate is constant, at that of a min-jerk lap in its middle,
//! 15/8 of its mean, where its angular acceleration is zero:
//!
//! ```text
//! n T = T1 + (n - 1) 8/15 T1,   T1 = 15 n T / (8 n + 7)
//! ```
//!
//! So velocity and acceleration are continuous. A single lap is the min-jerk lap, T1 = T. With many laps T1 tends to
//! 15/8 T.

use contract::scenario::Mission;

use super::progress::{Progress, min_jerk};
use super::setpoint::Setpoint;

/// Duration of the climb and of the descent, each min-jerk \[s\].
const CLIMB_S: f64 = 10.0;
/// Ratio of the rate of a min-jerk motion in its middle to its mean rate.
const PEAK: f64 = 15.0 / 8.0;

/// Circle of a mission.
#[derive(Debug, Clone, Copy)]
pub struct Circle {
    radius_m: f64,
    height_m: f64,
    laps: f64,
    /// Duration of all laps together \[s\].
    turning_s: f64,
    /// Duration `T1` \[s\].
    ends_s: f64,
}

impl Circle {
    /// Builds the circle of `mission`.
    pub fn new(mission: &Mission) -> Self {
        let (laps, period_s) = (f64::from(mission.laps), mission.period_s);
        Self {
            radius_m: mission.radius_m,
            height_m: mission.height_m,
            laps,
            turning_s: laps * period_s,
            ends_s: period_s * (15.0 * laps) / (8.0 * laps + 7.0),
        }
    }

    /// Reference at `t_s`; before 0 and after the descent it rests at the origin.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let lap_ends = CLIMB_S + self.turning_s;
        if t_s < CLIMB_S {
            vertical(&min_jerk(t_s, CLIMB_S), 0.0, -self.height_m)
        } else if t_s < lap_ends {
            self.turned(&self.turns(t_s - CLIMB_S))
        } else {
            vertical(&min_jerk(t_s - lap_ends, CLIMB_S), -self.height_m, 0.0)
        }
    }

    /// Number of turns `t` after the climb.
    fn turns(&self, t: f64) -> Progress {
        let half_s = self.ends_s / 2.0;
        if t < half_s {
            min_jerk(t, self.ends_s)
        } else if t < self.turning_s - half_s {
            let rate = PEAK / self.ends_s;
            Progress { s: 0.5 + rate * (t - half_s), ds: rate, dds: 0.0 }
        } else {
            let last = min_jerk(t - (self.turning_s - self.ends_s), self.ends_s);
            Progress { s: self.laps - 1.0 + last.s, ..last }
        }
    }

    /// Reference after a number of turns.
    fn turned(&self, turns: &Progress) -> Setpoint {
        let [angle, rate, acceleration] = [turns.s, turns.ds, turns.dds].map(|turns| turns * std::f64::consts::TAU);
        let (sin, cos) = libm::sincos(angle);
        let r = self.radius_m;
        Setpoint {
            position_m: [r * sin, r * (1.0 - cos), -self.height_m],
            velocity_mps: [r * rate * cos, r * rate * sin, 0.0],
            acceleration_mps2: [
                r * (acceleration * cos - rate * rate * sin),
                r * (acceleration * sin + rate * rate * cos),
                0.0,
            ],
        }
    }
}

/// Reference on a climb or a descent above the origin.
fn vertical(progress: &Progress, from_m: f64, to_m: f64) -> Setpoint {
    let way = to_m - from_m;
    Setpoint {
        position_m: [0.0, 0.0, from_m + way * progress.s],
        velocity_mps: [0.0, 0.0, way * progress.ds],
        acceleration_mps2: [0.0, 0.0, way * progress.dds],
    }
}
