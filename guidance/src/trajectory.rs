//! Trajectories: where to be at time t, how fast, and accelerating how.
//!
//! Legs join waypoints in straight lines; along a leg of duration T the way covered is a fraction s(t):
//!
//! | `ramp_s` | s |
//! |---|---|
//! | 0 | t / T |
//! | ta | trapezoid of velocity: ramps of ta, cruise at 1 / (T - ta) |
//! | `"min-jerk"` | 10 x^3 - 15 x^4 + 6 x^5 with x = t / T (Flash and Hogan, 1985) |

use contract::scenario::{Mission, Ramp, TrajectoryKind};
use nalgebra::Vector3;

/// The surveillance square: up 8 m, around, down.
const SURVEY_M: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [0.0, 0.0, -8.0],
    [8.0, 0.0, -8.0],
    [8.0, 8.0, -8.0],
    [0.0, 8.0, -8.0],
    [0.0, 0.0, -8.0],
    [0.0, 0.0, 0.0],
];
const SURVEY_LEG_S: f64 = 10.0;
/// The circle: climb, one lap, descend, each min-jerk.
const CIRCLE_RADIUS_M: f64 = 5.0;
const CIRCLE_HEIGHT_M: f64 = 10.0;
const CIRCLE_CLIMB_S: f64 = 10.0;
const CIRCLE_LAP_S: f64 = 40.0;

/// The reference at one instant, NED.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Setpoint {
    /// \[m\]
    pub position_m: [f64; 3],
    /// \[m/s\]
    pub velocity_mps: [f64; 3],
    /// \[m/s2\]
    pub acceleration_mps2: [f64; 3],
}

/// A mission's reference over time.
#[derive(Debug, Clone)]
pub struct Trajectory(Path);

#[derive(Debug, Clone)]
enum Path {
    Legs { waypoints: Vec<(f64, Vector3<f64>)>, ramp: Ramp },
    Step { to: [f64; 3], at_s: f64 },
    Circle,
}

impl Trajectory {
    /// The trajectory of `mission`.
    pub fn new(mission: &Mission) -> Self {
        let legs = |points: &[[f64; 3]], times: &mut dyn Iterator<Item = f64>| Path::Legs {
            waypoints: times.zip(points.iter().map(|p| Vector3::from(*p))).collect(),
            ramp: mission.ramp_s,
        };
        Self(match mission.trajectory {
            TrajectoryKind::Survey => legs(&SURVEY_M, &mut (0..).map(|i| f64::from(i) * SURVEY_LEG_S)),
            TrajectoryKind::Waypoints => legs(&mission.waypoints_m, &mut mission.times_s.iter().copied()),
            TrajectoryKind::Hover => Path::Step { to: [0.0; 3], at_s: 0.0 },
            TrajectoryKind::Step => Path::Step { to: mission.step_m, at_s: mission.step_at_s },
            TrajectoryKind::Circle => Path::Circle,
        })
    }

    /// The reference at `t_s`; before the first waypoint and after the last it stays there.
    pub fn at(&self, t_s: f64) -> Setpoint {
        match &self.0 {
            Path::Legs { waypoints, ramp } => along(waypoints, *ramp, t_s),
            Path::Step { to, at_s } => {
                Setpoint { position_m: if t_s >= *at_s { *to } else { [0.0; 3] }, ..Setpoint::default() }
            }
            Path::Circle => circle(t_s),
        }
    }
}

/// The way covered at one instant of a leg, and its derivatives in time.
struct Progress {
    s: f64,
    ds: f64,
    dds: f64,
}

fn along(waypoints: &[(f64, Vector3<f64>)], ramp: Ramp, t_s: f64) -> Setpoint {
    let Some(next) = waypoints.iter().position(|(at_s, _)| *at_s > t_s) else {
        let end = waypoints.last().map_or([0.0; 3], |(_, p)| (*p).into());
        return Setpoint { position_m: end, ..Setpoint::default() };
    };
    let Some(last) = next.checked_sub(1) else {
        return Setpoint { position_m: waypoints[next].1.into(), ..Setpoint::default() };
    };
    let ((from_s, from), (until_s, to)) = (waypoints[last], waypoints[next]);
    let duration_s = until_s - from_s;
    let progress = match ramp {
        Ramp::Named(_) => min_jerk(t_s - from_s, duration_s),
        Ramp::Seconds(ramp_s) => trapezoid(t_s - from_s, duration_s, ramp_s),
    };
    let way = to - from;
    Setpoint {
        position_m: (from + way * progress.s).into(),
        velocity_mps: (way * progress.ds).into(),
        acceleration_mps2: (way * progress.dds).into(),
    }
}

/// Each ramp begins at its instant: the acceleration there is already the new one.
fn trapezoid(t: f64, duration: f64, ramp: f64) -> Progress {
    let cruise = 1.0 / (duration - ramp);
    if t < ramp {
        Progress { s: cruise * t * t / (2.0 * ramp), ds: cruise * t / ramp, dds: cruise / ramp }
    } else if t < duration - ramp || ramp == 0.0 {
        Progress { s: cruise * (t - ramp / 2.0), ds: cruise, dds: 0.0 }
    } else {
        let left = duration - t;
        Progress { s: 1.0 - cruise * left * left / (2.0 * ramp), ds: cruise * left / ramp, dds: -cruise / ramp }
    }
}

fn min_jerk(t: f64, duration: f64) -> Progress {
    let x = (t / duration).clamp(0.0, 1.0);
    Progress {
        s: x * x * x * (10.0 + x * (-15.0 + x * 6.0)),
        ds: x * x * (30.0 + x * (-60.0 + x * 30.0)) / duration,
        dds: x * (60.0 + x * (-180.0 + x * 120.0)) / (duration * duration),
    }
}

/// Up above the origin, once around a centre 5 m to the east, and down again.
fn circle(t: f64) -> Setpoint {
    let lap_ends = CIRCLE_CLIMB_S + CIRCLE_LAP_S;
    let vertical = |p: &Progress, from: f64, to: f64| {
        let way = to - from;
        Setpoint {
            position_m: [0.0, 0.0, from + way * p.s],
            velocity_mps: [0.0, 0.0, way * p.ds],
            acceleration_mps2: [0.0, 0.0, way * p.dds],
        }
    };
    if t < CIRCLE_CLIMB_S {
        vertical(&min_jerk(t, CIRCLE_CLIMB_S), 0.0, -CIRCLE_HEIGHT_M)
    } else if t < lap_ends {
        lap(&min_jerk(t - CIRCLE_CLIMB_S, CIRCLE_LAP_S))
    } else {
        vertical(&min_jerk(t - lap_ends, CIRCLE_CLIMB_S), -CIRCLE_HEIGHT_M, 0.0)
    }
}

fn lap(p: &Progress) -> Setpoint {
    let [angle, rate, acceleration] = [p.s, p.ds, p.dds].map(|turns| turns * std::f64::consts::TAU);
    let (sin, cos) = libm::sincos(angle);
    let r = CIRCLE_RADIUS_M;
    Setpoint {
        position_m: [r * sin, r * (1.0 - cos), -CIRCLE_HEIGHT_M],
        velocity_mps: [r * rate * cos, r * rate * sin, 0.0],
        acceleration_mps2: [
            r * (acceleration * cos - rate * rate * sin),
            r * (acceleration * sin + rate * rate * cos),
            0.0,
        ],
    }
}
