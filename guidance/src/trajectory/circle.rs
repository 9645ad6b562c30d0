//! Circle: a climb above the origin, laps around a centre to the east, and a descent. [`Laps`] has the turns over time.

use contract::scenario::Mission;
use curves::Setpoint;
use curves::progress::{Laps, Progress, min_jerk};

/// Duration of the climb and of the descent, each min-jerk \[s\].
const CLIMB_S: f64 = 10.0;

/// Circle of a mission.
#[derive(Debug, Clone, Copy)]
pub struct Circle {
    radius_m: f64,
    height_m: f64,
    laps: Laps,
}

impl Circle {
    /// Builds the circle of `mission`.
    pub fn new(mission: &Mission) -> Self {
        Self { radius_m: mission.radius_m, height_m: mission.height_m, laps: Laps::new(mission.laps, mission.period_s) }
    }

    /// Reference at `t_s`; before 0 and after the descent it rests at the origin.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let lap_ends = CLIMB_S + self.laps.turning_s;
        if t_s < CLIMB_S {
            vertical(&min_jerk(t_s, CLIMB_S), 0.0, -self.height_m)
        } else if t_s < lap_ends {
            self.turned(&self.laps.turns(t_s - CLIMB_S))
        } else {
            vertical(&min_jerk(t_s - lap_ends, CLIMB_S), -self.height_m, 0.0)
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
