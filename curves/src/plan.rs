//! Plan: the parts of a mission one after the other. Each part begins when the part before ends and, except for a jump,
//! at the place where that part ends.

use nalgebra::Vector3;

use crate::curve::{Curve, CurveShape, Leg, SAMPLES};
use crate::descent::Descent;
use crate::fastest;
use crate::figure::{self, Figure};
use crate::heading::{Headings, Rule};
use crate::legs::Legs;
use crate::limits::{Demand, VehicleLimits};
use crate::min_snap;
use crate::progress::Laps;
use crate::setpoint::Setpoint;
use crate::spline;

/// Motion of one part.
#[derive(Debug, Clone, PartialEq)]
pub enum PartMotion {
    /// Straight up by a height \[m\], in a duration \[s\]; `None` = as fast as the limits allow.
    Climb(f64, Option<f64>),
    /// Through waypoints.
    Through {
        /// Waypoints after the place where the part begins, NED \[m\].
        points_m: Vec<[f64; 3]>,
        /// Times of the waypoints since the beginning of the part \[s\]; `None` = as fast as the limits allow.
        times_s: Option<Vec<f64>>,
        /// Derivative whose integral of squares is least.
        least: Least,
    },
    /// Along straight legs.
    Legs {
        /// Waypoints after the place where the part begins, NED \[m\].
        points_m: Vec<[f64; 3]>,
        /// Times of the waypoints since the beginning of the part \[s\].
        times_s: Vec<f64>,
        /// Ramp of the velocity at both ends of each leg \[s\]; `None` = min-jerk.
        ramp_s: Option<f64>,
    },
    /// Circle, helix or figure eight.
    Figure {
        /// Shape of the figure.
        shape: figure::FigureShape,
        /// Radius of a circle, or length of a loop of an eight \[m\].
        radius_m: f64,
        /// Mean duration of a lap \[s\]; `None` = as fast as the limits allow.
        period_s: Option<f64>,
        /// Number of laps.
        laps: u32,
        /// Height gained by all laps together \[m\].
        climb_m: f64,
        /// Direction of the centre, or of the first loop, from north over east \[rad\].
        direction_rad: f64,
    },
    /// Rest.
    Rest {
        /// Place to which the reference jumps, NED \[m\]; `None` = where the part begins.
        at_m: Option<[f64; 3]>,
        /// Duration \[s\].
        duration_s: f64,
    },
    /// Down to the ground.
    Land {
        /// Down coordinate of a vehicle that stands \[m\].
        standing_down_m: f64,
        /// Sink rate \[m/s\].
        sink_mps: f64,
    },
}

/// Derivative of which a curve through waypoints has the least integral of squares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Least {
    /// The fourth derivative.
    Snap,
    /// The third derivative.
    Jerk,
}

/// Part of a plan before it is built.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanPart {
    /// Motion over the part.
    pub motion: PartMotion,
    /// Rule of the heading over the part.
    pub heading: Rule,
}

/// Part of a plan, with its time and its curve.
#[derive(Debug, Clone)]
pub struct Planned {
    /// Time at which the part begins \[s\].
    pub begins_s: f64,
    /// Curve from this time on.
    pub curve: Curve,
    /// Distance from the end of the previous part, or from the start, to the beginning of the part \[m\]; above 0 for a
    /// jump.
    pub jump_m: f64,
}

impl Planned {
    /// Legs of the part, from which its demands are computed.
    pub fn legs(&self) -> Vec<Leg> {
        self.curve.legs(SAMPLES)
    }

    /// Demand of the whole part on a vehicle with `limits`.
    pub fn demand(&self, limits: &VehicleLimits) -> Demand {
        limits.demand_of(&self.legs())
    }
}

/// Place, heading and limits from which a plan begins.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Position, NED \[m\].
    pub position_m: [f64; 3],
    /// Heading \[rad\].
    pub heading_rad: f64,
    /// Limit of the rate of the heading \[rad/s\]; 0 = none.
    pub heading_rate_radps: f64,
    /// Limits within which curves without given times are as fast as possible.
    pub limits: VehicleLimits,
}

/// Parts of a mission one after the other.
#[derive(Debug, Clone)]
pub struct MissionPlan {
    parts: Vec<Planned>,
    headings: Headings,
    begins_m: [f64; 3],
}

impl MissionPlan {
    /// Builds `parts` from `start` on.
    pub fn new(start: &Start, parts: &[PlanPart]) -> Self {
        let mut headings = Headings::new(start.heading_rad, start.heading_rate_radps);
        let (mut at_m, mut begins_s) = (start.position_m, 0.0);
        let mut planned = vec![];
        for part in parts {
            let curve = build(&part.motion, at_m.into(), &start.limits);
            headings.extend(&curve, begins_s, &part.heading);
            let duration_s = curve.duration_s();
            let jump_m = (Vector3::from(curve.at(0.0).position_m) - Vector3::from(at_m)).norm();
            at_m = curve.at(duration_s).position_m;
            planned.push(Planned { begins_s, curve, jump_m });
            begins_s += duration_s;
        }
        Self { parts: planned, headings, begins_m: start.position_m }
    }

    /// Parts in order.
    pub fn parts(&self) -> &[Planned] {
        &self.parts
    }

    /// Duration of all parts \[s\].
    pub fn duration_s(&self) -> f64 {
        self.parts.last().map_or(0.0, |last| last.begins_s + last.curve.duration_s())
    }

    /// Largest jump of the reference from part to part \[m\]; 0 without a jump.
    pub fn jump_m(&self) -> f64 {
        self.parts.iter().map(|part| part.jump_m).fold(0.0, f64::max)
    }

    /// Reference at `t_s`; at rest before the first part and after the last.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let begun = self.parts.iter().rev().find(|part| part.begins_s <= t_s).or(self.parts.first());
        begun.map_or(Setpoint::at_rest(self.begins_m), |part| part.curve.at(t_s - part.begins_s))
    }

    /// Heading at `t_s`, in (-pi, pi] \[rad\].
    pub fn heading_at(&self, t_s: f64) -> f64 {
        self.headings.at(t_s)
    }
}

/// Builds the curve of a motion that begins at `from`.
fn build(motion: &PartMotion, from: Vector3<f64>, limits: &VehicleLimits) -> Curve {
    match motion {
        PartMotion::Climb(height_m, duration_s) => {
            let to = from - Vector3::z() * *height_m;
            let waypoints = |duration_s| vec![(0.0, from), (duration_s, to)];
            paced(*duration_s, limits, |duration_s| {
                CurveShape::Legs(Legs { waypoints: waypoints(duration_s), ramp_s: None })
            })
        }
        PartMotion::Through { points_m, times_s, least } => {
            let waypoints = waypoints(from, points_m);
            let through = match least {
                Least::Snap => min_snap::through,
                Least::Jerk => spline::through,
            };
            let solve = |waypoints: &[(f64, Vector3<f64>)]| CurveShape::Through(through(waypoints));
            match times_s {
                None => fastest::through(&waypoints, limits, solve),
                Some(times_s) => solve(&timed(waypoints, times_s)).into(),
            }
        }
        PartMotion::Legs { points_m, times_s, ramp_s } => {
            CurveShape::Legs(Legs { waypoints: timed(waypoints(from, points_m), times_s), ramp_s: *ramp_s }).into()
        }
        PartMotion::Figure { shape, radius_m, period_s, laps, climb_m, direction_rad } => {
            paced(*period_s, limits, |period_s| {
                CurveShape::Figure(Figure {
                    shape: *shape,
                    from,
                    radius_m: *radius_m,
                    climb_m: *climb_m,
                    direction_rad: *direction_rad,
                    laps: Laps::new(*laps, period_s),
                })
            })
        }
        PartMotion::Rest { at_m, duration_s } => CurveShape::Rest(at_m.map_or(from, Vector3::from), *duration_s).into(),
        PartMotion::Land { standing_down_m, sink_mps } => {
            CurveShape::Descent(Descent::new(from, *standing_down_m, *sink_mps)).into()
        }
    }
}

/// Joins the place where a part begins with its points.
fn waypoints(from: Vector3<f64>, points_m: &[[f64; 3]]) -> Vec<Vector3<f64>> {
    std::iter::once(from).chain(points_m.iter().map(|point| (*point).into())).collect()
}

/// Pairs each waypoint with its time; the first time is 0.
fn timed(waypoints: Vec<Vector3<f64>>, times_s: &[f64]) -> Vec<(f64, Vector3<f64>)> {
    std::iter::once(0.0).chain(times_s.iter().copied()).zip(waypoints).collect()
}

/// Builds a curve of the given duration, or the fastest curve within `limits`.
fn paced(duration_s: Option<f64>, limits: &VehicleLimits, shape: impl Fn(f64) -> CurveShape) -> Curve {
    let curve = Curve::from(shape(duration_s.unwrap_or(1.0)));
    let stretch = if duration_s.is_some() { 1.0 } else { limits.least_stretch(&curve.legs(SAMPLES)) };
    Curve { stretch, ..curve }
}
