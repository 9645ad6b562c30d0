//! Trajectories: position, velocity and acceleration over time.
//!
//! Legs join waypoints in straight lines; on a leg of duration T the covered fraction is s(t):
//!
//! | `ramp_s` | s |
//! |---|---|
//! | 0 | t / T |
//! | ta | trapezoid of velocity: ramps of ta, cruise at 1 / (T - ta) |
//! | `"min-jerk"` | 10 x^3 - 15 x^4 + 6 x^5 with x = t / T (Flash and Hogan, 1985) |
//!
//! With `ramp_s = "spline"` one curve passes all waypoints instead: [`Spline`]. The circle is in `circle`. A mission of
//! parts has the curves of its [`Plan`], which the check before the flight has built too.

mod circle;

pub use curves::Setpoint;

use contract::Scenario;
use contract::scenario::{Ramp, RampName, TrajectoryKind, plan};
use curves::Plan;
use curves::progress::{min_jerk, trapezoid};
use curves::spline::Spline;
use nalgebra::Vector3;

use circle::Circle;

/// Waypoints of the surveillance square: up 8 m, around, down.
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

/// Height above a vehicle that stands from which a reference asks for a take-off \[m\]. A smooth mission then climbs at
/// some speed already, so that the vehicle, which follows from there, need not wait for it near the ground.
const HIGH_M: f64 = 0.1;
/// Depth below the ground from which a reference that rests asks for a landing, and not for standing \[m\].
const LOW_M: f64 = 0.01;

/// Reference of a mission over time.
#[derive(Debug, Clone)]
pub struct Trajectory {
    path: Path,
    /// Down position of a vehicle that stands \[m\]; infinite without a ground.
    standing_down_m: f64,
}

#[derive(Debug, Clone)]
enum Path {
    /// Legs between the waypoints; the second field is the ramp of each leg \[s\], `None` for min-jerk.
    Legs(Vec<(f64, Vector3<f64>)>, Option<f64>),
    Spline(Spline),
    Step {
        to: [f64; 3],
        at_s: f64,
    },
    Circle(Circle),
    Parts(Plan),
}

impl Trajectory {
    /// Builds the trajectory of the mission of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let mission = &scenario.mission;
        let through = |points: &[[f64; 3]], times: &mut dyn Iterator<Item = f64>| {
            let waypoints: Vec<_> = times.zip(points.iter().map(|p| Vector3::from(*p))).collect();
            match mission.ramp_s {
                Ramp::Named(RampName::Spline) => Path::Spline(Spline::new(&waypoints)),
                Ramp::Named(RampName::MinJerk) => Path::Legs(waypoints, None),
                Ramp::Seconds(ramp_s) => Path::Legs(waypoints, Some(ramp_s)),
            }
        };
        let path = match mission.trajectory {
            TrajectoryKind::Survey => through(&SURVEY_M, &mut (0..).map(|i| f64::from(i) * SURVEY_LEG_S)),
            TrajectoryKind::Waypoints => through(&mission.waypoints_m, &mut mission.times_s.iter().copied()),
            TrajectoryKind::Hover => Path::Step { to: [0.0; 3], at_s: 0.0 },
            TrajectoryKind::Step => Path::Step { to: mission.step_m, at_s: mission.step_at_s },
            TrajectoryKind::Circle => Path::Circle(Circle::new(mission)),
            TrajectoryKind::Parts => Path::Parts(plan::build(scenario)),
        };
        let ground = &scenario.plant.ground;
        Self { path, standing_down_m: if ground.present { plan::standing_down_m(ground) } else { f64::INFINITY } }
    }

    /// Plan of a mission of parts, which has the headings too; `None` for any other trajectory.
    pub fn plan(&self) -> Option<&Plan> {
        match &self.path {
            Path::Parts(plan) => Some(plan),
            _ => None,
        }
    }

    /// Reference at `t_s` of a vehicle whose measured down position is `down_m`. It is [`Self::at`], or lower if that
    /// rests below the ground, as after a landing, and the vehicle is measured below the ground too. The height is then
    /// wrong by as much. A vehicle that would hover above the ground sinks until it stands, and one whose height drifts
    /// on the ground is not asked to climb.
    pub fn for_vehicle_at(&self, down_m: f64, t_s: f64) -> Setpoint {
        let mut setpoint = self.at(t_s);
        let [_, _, rests_down_m] = setpoint.position_m;
        if setpoint.velocity_mps == [0.0; 3] && rests_down_m > self.standing_down_m + LOW_M {
            setpoint.position_m[2] += (down_m - self.standing_down_m).max(0.0);
        }
        setpoint
    }

    /// Returns whether the reference at `t_s` is above the ground.
    pub fn is_above_ground(&self, t_s: f64) -> bool {
        self.at(t_s).position_m[2] < self.standing_down_m - HIGH_M
    }

    /// Reference at `t_s`; before the first waypoint and after the last it rests there.
    pub fn at(&self, t_s: f64) -> Setpoint {
        match &self.path {
            Path::Legs(waypoints, ramp_s) => {
                let place = |(at_s, position): &(f64, Vector3<f64>)| (*at_s, (*position).into());
                Setpoint::along(waypoints, place, t_s, |from, to| leg(*from, *to, *ramp_s, t_s))
            }
            Path::Spline(spline) => spline.at(t_s),
            Path::Step { to, at_s } => Setpoint::at_rest(if t_s >= *at_s { *to } else { [0.0; 3] }),
            Path::Circle(circle) => circle.at(t_s),
            Path::Parts(plan) => plan.at(t_s),
        }
    }
}

/// Reference at `t_s` on the straight leg between two waypoints.
fn leg(
    (from_s, from): (f64, Vector3<f64>),
    (until_s, to): (f64, Vector3<f64>),
    ramp_s: Option<f64>,
    t_s: f64,
) -> Setpoint {
    let duration_s = until_s - from_s;
    let progress = match ramp_s {
        None => min_jerk(t_s - from_s, duration_s),
        Some(ramp_s) => trapezoid(t_s - from_s, duration_s, ramp_s),
    };
    let way = to - from;
    Setpoint {
        position_m: (from + way * progress.s).into(),
        velocity_mps: (way * progress.ds).into(),
        acceleration_mps2: (way * progress.dds).into(),
    }
}
