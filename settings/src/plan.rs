//! Plan of a mission: its curves, and the limits of the vehicle. Survey and hover begin at the origin; parts begin at
//! the initial position.
//!
//! | limit | from |
//! |---|---|
//! | tilt | `guidance.angle_limit_deg`, about trim |
//! | thrust | rotor speeds of `[plant]`, with the moments of hover balanced: `u = s u_trim` |
//! | vertical speed | `guidance.climb_limit_mps` |
//! | body rate | `attitude.mpc.rates_limit_dps` of roll and pitch: the paper's bound (51) |
//! | drag | `plant.drag_linear_nspm`, the largest of the three, and `plant.drag_quadratic_ns2pm2` |
//!
//! The check of a scenario and guidance build the same plan.

use airframe::Trim;
pub use curves::Planned;
use curves::heading::Rule;
pub use curves::limits::Demand;
use curves::plan::{Least, Start};
pub use curves::stray::{Offer, Stray, range_m};
use curves::{MissionPlan, PartMotion, VehicleLimits, figure, named};

use crate::table::mission::{Ramp, RampName, TrajectoryKind};
use crate::table::part::{CurveKind, HeadingRule, MissionPart, PartHeading, PartKind};
use crate::table::run::Scenario;

/// Sink rate of a landing that gives no sink rate \[m/s\]: the default of PX4, `MPC_LAND_SPEED`.
const SINK_MPS: f64 = 0.7;
/// Direction of a figure that gives no direction \[deg\]: east.
const DIRECTION_DEG: f64 = 90.0;

/// Limits on the curves of a mission: those of the vehicle, and the speed and acceleration of `mission.limits`.
pub fn limits(scenario: &Scenario) -> VehicleLimits {
    let (vehicle, plant, own) = (&scenario.airframe, &scenario.plant, &scenario.mission.limits);
    let trim = Trim::solve(vehicle, plant.tilt_reaction).actuation;
    let drag_nspm = plant.drag_linear_nspm.into_iter().fold(0.0, f64::max);
    let [roll_dps, pitch_dps, _] = scenario.attitude.mpc.rates_limit_dps;
    VehicleLimits {
        g_mps2: vehicle.g_mps2,
        drag_linear_1ps: drag_nspm / vehicle.mass_kg,
        drag_quadratic_1pm: plant.drag_quadratic_ns2pm2 / vehicle.mass_kg,
        most: Demand {
            speed_mps: own.speed_mps.unwrap_or(f64::INFINITY),
            acceleration_mps2: own.acceleration_mps2.unwrap_or(f64::INFINITY),
            vertical_mps: scenario.guidance.climb_limit_mps,
            tilt_rad: scenario.guidance.angle_limit_deg.to_radians(),
            thrust_mps2: scenario.limits().thrust_range(&trim).map(|share| share * vehicle.g_mps2),
            turn_radps: roll_dps.min(pitch_dps).to_radians(),
        },
    }
}

/// Builds the plan of the mission.
pub fn build(scenario: &Scenario) -> MissionPlan {
    let mission = &scenario.mission;
    let named = |motion| {
        let heading = Rule::Steps(vec![(0.0, mission.heading_deg.to_radians())]);
        ([0.0; 3], vec![curves::PlanPart { motion, heading }])
    };
    let (position_m, parts) = match mission.trajectory {
        TrajectoryKind::Survey => named(named::survey(match mission.ramp_s {
            Ramp::Seconds(ramp_s) => Some(ramp_s),
            Ramp::Named(RampName::MinJerk) => None,
        })),
        TrajectoryKind::Hover => named(named::hover()),
        TrajectoryKind::Parts => {
            (scenario.initial.position_m, mission.part.iter().map(|part| read(part, scenario)).collect())
        }
    };
    let start = Start {
        position_m,
        heading_rad: scenario.initial.attitude_deg[2].to_radians(),
        heading_rate_radps: scenario.guidance.heading_rate_limit_dps.to_radians(),
        limits: limits(scenario).share(mission.limits.share),
    };
    MissionPlan::new(&start, &parts)
}

/// Finds out whether a smooth curve of `part` goes beyond the box of its points by more than the longest leg.
pub fn stray(scenario: &Scenario, part: &MissionPart, planned: &Planned) -> Option<Stray> {
    let PartMotion::Through { points_m, least, .. } = read(part, scenario).motion else { return None };
    let points_m = [vec![planned.curve.at(0.0).position_m], points_m].concat();
    Stray::find(&planned.curve, &points_m, least, &limits(scenario).share(scenario.mission.limits.share))
}

/// Reads the keys of a part; missing keys, which the check refuses, are 0.
fn read(part: &MissionPart, scenario: &Scenario) -> curves::PlanPart {
    let [height_m, radius_m, climb_m, duration_s] =
        [part.height_m, part.radius_m, part.climb_m, part.duration_s].map(Option::unwrap_or_default);
    let figure = |shape| PartMotion::Figure {
        shape,
        radius_m,
        period_s: part.period_s,
        laps: part.laps.unwrap_or(1),
        climb_m,
        direction_rad: part.direction_deg.unwrap_or(DIRECTION_DEG).to_radians(),
    };
    let points_m = || part.points_m.clone().unwrap_or_default();
    let smooth = |least| PartMotion::Through { points_m: points_m(), times_s: part.times_s.clone(), least };
    let straight =
        |ramp_s| PartMotion::Legs { points_m: points_m(), times_s: part.times_s.clone().unwrap_or_default(), ramp_s };
    let motion = match part.kind {
        PartKind::Takeoff => PartMotion::Climb(height_m, part.duration_s),
        PartKind::Waypoints => match part.curve.unwrap_or_default() {
            CurveKind::MinSnap => smooth(Least::Snap),
            CurveKind::Quintic | CurveKind::Spline => smooth(Least::Jerk),
            CurveKind::Line => straight(Some(0.0)),
            CurveKind::Trapezoid => straight(Some(part.ramp_s.unwrap_or_default())),
            CurveKind::MinJerk => straight(None),
        },
        PartKind::Jump => PartMotion::Rest { at_m: part.point_m, duration_s },
        PartKind::Circle | PartKind::Helix => figure(figure::FigureShape::Circle),
        PartKind::FigureEight => figure(figure::FigureShape::Eight),
        PartKind::Loiter => PartMotion::Rest { at_m: None, duration_s },
        PartKind::Landing => PartMotion::Land {
            standing_down_m: scenario.plant.ground.standing_down_m(),
            sink_mps: part.sink_mps.unwrap_or(SINK_MPS),
        },
    };
    let heading = match &part.heading_deg {
        None => Rule::KEEP,
        Some(PartHeading::Constant(deg)) => Rule::Steps(vec![(0.0, deg.to_radians())]),
        Some(PartHeading::Steps(all)) => Rule::Steps(all.iter().map(|(t_s, deg)| (*t_s, deg.to_radians())).collect()),
        Some(PartHeading::Points(all)) => Rule::Waypoints(all.iter().map(|deg| deg.to_radians()).collect()),
        Some(PartHeading::Named(HeadingRule::AlongTrack)) => Rule::Track,
        Some(PartHeading::Named(HeadingRule::Centre)) => Rule::Centre,
    };
    curves::PlanPart { motion, heading }
}
