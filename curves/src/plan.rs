//! Plan: the parts of a mission one after the other. Each begins where and when the part before ends, at rest.

use nalgebra::Vector3;

use crate::curve::{Curve, SAMPLES, Shape};
use crate::descent::Descent;
use crate::fastest;
use crate::figure::{self, Figure};
use crate::heading::{Headings, Rule};
use crate::limits::{Demand, Limits};
use crate::min_snap::MinSnap;
use crate::progress::Laps;
use crate::setpoint::Setpoint;
use crate::spline::Spline;

/// Motion of one part.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// Straight up by a height \[m\], in a duration \[s\]; `None` = as fast as the limits allow.
    Climb(f64, Option<f64>),
    /// Through waypoints.
    Through {
        /// Waypoints after the place of beginning, NED \[m\].
        points_m: Vec<[f64; 3]>,
        /// Times since the beginning \[s\]; `None` = as fast as the limits allow.
        times_s: Option<Vec<f64>>,
        /// Derivative of which the curve has as little as possible.
        least: Least,
    },
    /// Circle, helix or figure eight.
    Figure {
        /// Shape.
        shape: figure::Shape,
        /// Radius, or length of a loop \[m\].
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
    /// Rest for a time \[s\].
    Rest(f64),
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
pub struct Part {
    /// Motion.
    pub motion: Motion,
    /// Heading.
    pub heading: Rule,
}

/// Part of a plan.
#[derive(Debug, Clone)]
pub struct Planned {
    /// Time at which the part begins \[s\].
    pub begins_s: f64,
    /// Curve from then on.
    pub curve: Curve,
}

impl Planned {
    /// Demand of the whole part on a vehicle with `limits`.
    pub fn demand(&self, limits: &Limits) -> Demand {
        limits.demand_of(&self.curve.legs(SAMPLES))
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
    pub limits: Limits,
}

/// Parts of a mission one after the other.
#[derive(Debug, Clone)]
pub struct Plan {
    parts: Vec<Planned>,
    headings: Headings,
    begins_m: [f64; 3],
}

impl Plan {
    /// Builds `parts` from `start` on.
    pub fn new(start: &Start, parts: &[Part]) -> Self {
        let mut headings = Headings::new(start.heading_rad, start.heading_rate_radps);
        let (mut at_m, mut begins_s) = (start.position_m, 0.0);
        let mut planned = vec![];
        for part in parts {
            let curve = build(&part.motion, at_m.into(), &start.limits);
            headings.extend(&curve, begins_s, &part.heading);
            let duration_s = curve.duration_s();
            at_m = curve.at(duration_s).position_m;
            planned.push(Planned { begins_s, curve });
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

    /// Reference at `t_s`; before the first part and after the last it rests.
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
fn build(motion: &Motion, from: Vector3<f64>, limits: &Limits) -> Curve {
    match motion {
        Motion::Climb(height_m, duration_s) => {
            paced(*duration_s, limits, |duration_s| Shape::Line(from, from - Vector3::z() * *height_m, duration_s))
        }
        Motion::Through { points_m, times_s, least } => {
            let waypoints: Vec<Vector3<f64>> =
                std::iter::once(from).chain(points_m.iter().map(|p| (*p).into())).collect();
            let solve = |waypoints: &[(f64, Vector3<f64>)]| match least {
                Least::Snap => Shape::MinSnap(MinSnap::new(waypoints)),
                Least::Jerk => Shape::Spline(Spline::new(waypoints)),
            };
            match times_s {
                None => fastest::through(&waypoints, limits, solve),
                Some(times_s) => {
                    let at_s = std::iter::once(0.0).chain(times_s.iter().copied());
                    solve(&at_s.zip(waypoints).collect::<Vec<_>>()).into()
                }
            }
        }
        Motion::Figure { shape, radius_m, period_s, laps, climb_m, direction_rad } => {
            paced(*period_s, limits, |period_s| {
                Shape::Figure(Figure {
                    shape: *shape,
                    from,
                    radius_m: *radius_m,
                    climb_m: *climb_m,
                    direction_rad: *direction_rad,
                    laps: Laps::new(*laps, period_s),
                })
            })
        }
        Motion::Rest(duration_s) => Shape::Rest(from, *duration_s).into(),
        Motion::Land { standing_down_m, sink_mps } => {
            Shape::Descent(Descent::new(from, *standing_down_m, *sink_mps)).into()
        }
    }
}

/// Builds a curve of the given duration, or the fastest one.
fn paced(duration_s: Option<f64>, limits: &Limits, shape: impl Fn(f64) -> Shape) -> Curve {
    let curve = Curve::from(shape(duration_s.unwrap_or(1.0)));
    let stretch = if duration_s.is_some() { 1.0 } else { limits.least_stretch(&curve.legs(SAMPLES)) };
    Curve { stretch, ..curve }
}
