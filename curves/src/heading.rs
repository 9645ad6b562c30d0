//! Heading over time: what each part of a plan asks for, at a limited rate.
//!
//! | rule | wanted heading |
//! |---|---|
//! | keep | the one at which the part before ends |
//! | fixed | one value |
//! | waypoints | min-jerk from waypoint to waypoint, each the short way |
//! | track | the direction of the horizontal velocity, above [`SLOW_MPS`] |
//! | centre | the direction to the centre of the figure |
//!
//! Below [`SLOW_MPS`] a direction means little, and at rest there is none. There the heading wanted along track is the
//! next one that has a meaning, so that the vehicle turns before it leaves; after the last one it is kept.
//!
//! The heading turns towards the wanted one the short way, no faster than its limit. That makes it depend on the past,
//! so it is computed before the flight, every [`STEP_S`], and interpolated.

use airframe::angle;

use crate::curve::{Curve, Shape};
use crate::progress::min_jerk;
use crate::setpoint::Setpoint;

/// Horizontal speed below which a track has no direction \[m/s\].
pub const SLOW_MPS: f64 = 0.5;
/// Interval of the computed headings \[s\].
pub const STEP_S: f64 = 0.05;
/// Time after which the heading stays \[s\]: a day, the longest flight.
const MAX_S: f64 = 86_400.0;

/// Heading that a part of a plan asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Rule {
    /// The heading before.
    Keep,
    /// One heading \[rad\].
    Fixed(f64),
    /// Heading at each waypoint \[rad\], except the first, where the part begins.
    Waypoints(Vec<f64>),
    /// The direction of flight.
    Track,
    /// The direction to the centre of the figure; that of flight for any other curve.
    Centre,
}

/// Headings of a plan.
#[derive(Debug, Clone)]
pub struct Headings {
    /// Heading at each step, without jumps of whole turns \[rad\].
    heading_rad: Vec<f64>,
    /// Largest change from step to step \[rad\].
    most_rad: f64,
}

impl Headings {
    /// Starts with `heading_rad`; the rate is limited to `rate_radps`, or not at all if that is 0.
    pub fn new(heading_rad: f64, rate_radps: f64) -> Self {
        let most_rad = if rate_radps > 0.0 { rate_radps * STEP_S } else { f64::INFINITY };
        Self { heading_rad: vec![heading_rad], most_rad }
    }

    /// Heading at `t_s`, in (-pi, pi] \[rad\]; before the beginning and after the end that of there.
    pub fn at(&self, t_s: f64) -> f64 {
        let steps = (t_s / STEP_S).max(0.0);
        let last = self.heading_rad.len() - 1;
        let before = (steps as usize).min(last);
        let [from, to] = [before, (before + 1).min(last)].map(|step| self.heading_rad[step]);
        angle::wrapped(from + (to - from) * (steps - before as f64).min(1.0))
    }

    /// Continues with a `curve` that begins at `begins_s`, up to its end.
    pub fn extend(&mut self, curve: &Curve, begins_s: f64, rule: &Rule) {
        let ends_s = begins_s + curve.duration_s();
        let steps = self.heading_rad.len()..(ends_s.min(MAX_S) / STEP_S) as usize + 1;
        let times_s = steps.map(|step| step as f64 * STEP_S - begins_s);
        let before_rad = self.heading_rad.last().copied().unwrap_or(0.0);
        let wanted: Vec<f64> = match rule {
            Rule::Keep => times_s.map(|_| before_rad).collect(),
            Rule::Fixed(heading_rad) => times_s.map(|_| *heading_rad).collect(),
            Rule::Waypoints(headings_rad) => {
                let headings_rad = [&[before_rad], headings_rad.as_slice()].concat();
                let at_s = curve.times_s();
                times_s.map(|t_s| between(&at_s, &headings_rad, t_s)).collect()
            }
            Rule::Track => tracked(times_s.map(|t_s| course(&curve.at(t_s))).collect(), before_rad),
            Rule::Centre => tracked(times_s.map(|t_s| to_centre(curve, &curve.at(t_s))).collect(), before_rad),
        };
        let mut heading_rad = before_rad;
        for wanted_rad in wanted {
            heading_rad += angle::difference(wanted_rad, heading_rad).clamp(-self.most_rad, self.most_rad);
            self.heading_rad.push(heading_rad);
        }
    }
}

/// Heading at `t_s` between waypoints that are passed at the times `at_s`.
fn between(at_s: &[f64], headings_rad: &[f64], t_s: f64) -> f64 {
    let next = at_s.iter().position(|at_s| *at_s > t_s).unwrap_or(at_s.len()).min(headings_rad.len());
    let Some(last) = next.checked_sub(1) else { return headings_rad[0] };
    let Some(to_rad) = headings_rad.get(next) else { return headings_rad[last] };
    let progress = min_jerk(t_s - at_s[last], at_s[next] - at_s[last]);
    headings_rad[last] + angle::difference(*to_rad, headings_rad[last]) * progress.s
}

/// Direction of flight \[rad\]; `None` if it is too slow to have one.
fn course(setpoint: &Setpoint) -> Option<f64> {
    let [north, east, _] = setpoint.velocity_mps;
    (libm::hypot(north, east) >= SLOW_MPS).then(|| libm::atan2(east, north))
}

/// Direction to the centre of a figure \[rad\]; `None` at the centre itself.
fn to_centre(curve: &Curve, setpoint: &Setpoint) -> Option<f64> {
    let Shape::Figure(figure) = &curve.shape else { return course(setpoint) };
    let centre = figure.centre();
    let [north, east] = [centre.x - setpoint.position_m[0], centre.y - setpoint.position_m[1]];
    (libm::hypot(north, east) > 1e-6 * figure.radius_m).then(|| libm::atan2(east, north))
}

/// Fills the gaps between known directions with the next one, and the end with the last one.
fn tracked(known: Vec<Option<f64>>, before_rad: f64) -> Vec<f64> {
    let last = known.iter().rev().find_map(|known| *known).unwrap_or(before_rad);
    let mut next = last;
    let mut filled: Vec<f64> = known
        .into_iter()
        .rev()
        .map(|known| {
            next = known.unwrap_or(next);
            next
        })
        .collect();
    filled.reverse();
    filled
}
