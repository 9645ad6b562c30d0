//! Heading over time: the headings that the parts of a plan ask for, followed at a limited rate.
//!
//! | rule | wanted heading |
//! |---|---|
//! | steps | one value after the other, each from its time on; without steps the heading of the part before |
//! | waypoints | min-jerk from waypoint to waypoint, turning the short way |
//! | track | the direction of the horizontal velocity, above [`SLOW_MPS`] |
//! | centre | the direction to the centre of the figure |
//!
//! Below [`SLOW_MPS`] a direction means little, and at rest there is none. In both cases the heading wanted along track
//! is the next direction above this speed, so that the vehicle turns before it leaves. After the last such direction
//! the heading is kept.
//!
//! The heading turns towards the wanted heading the short way, no faster than its limit. Without a limit the heading
//! steps: a step of 90 degrees then turns the vehicle at 8.4 rad/s, where the paper's (51) allows 6.28. Towards a value
//! that changes, a limited heading depends on the past, so it is computed before the flight, every [`STEP_S`], and
//! interpolated.

use airframe::angle;

use crate::curve::{Curve, CurveShape};
use crate::progress::min_jerk;
use crate::setpoint::Setpoint;

/// Horizontal speed below which a track has no direction \[m/s\].
pub const SLOW_MPS: f64 = 0.5;
/// Interval of the computed headings \[s\].
pub const STEP_S: f64 = 0.05;
/// Time after which a computed heading stays constant \[s\]: a day, the longest flight.
const MAX_S: f64 = 86_400.0;

/// Heading that a part of a plan asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Rule {
    /// Times since the beginning of the part \[s\], sorted, each with the heading from then on \[rad\].
    Steps(Vec<(f64, f64)>),
    /// Heading at each waypoint \[rad\], except the first, where the part begins.
    Waypoints(Vec<f64>),
    /// The direction of flight.
    Track,
    /// The direction to the centre of the figure; the direction of flight for any other curve.
    Centre,
}

impl Rule {
    /// Rule that keeps the heading of the part before.
    pub const KEEP: Self = Self::Steps(Vec::new());
}

/// Headings of a plan.
#[derive(Debug, Clone)]
pub struct Headings {
    pieces: Vec<Piece>,
    /// Largest rate of a turn \[rad/s\]; 0 makes the heading step.
    rate_radps: f64,
}

/// Headings from a time on.
#[derive(Debug, Clone)]
struct Piece {
    from_s: f64,
    heading: Heading,
}

#[derive(Debug, Clone)]
enum Heading {
    /// Turn through the angle `by_rad` that ends at `to_rad`.
    Turn { by_rad: f64, to_rad: f64 },
    /// Heading at each step from `first` on, without jumps of whole turns \[rad\].
    Computed { first: usize, heading_rad: Vec<f64> },
}

impl Headings {
    /// Starts with `heading_rad`; turns are limited to `rate_radps`, or not at all if it is 0.
    pub fn new(heading_rad: f64, rate_radps: f64) -> Self {
        let start = Piece { from_s: 0.0, heading: Heading::Turn { by_rad: 0.0, to_rad: heading_rad } };
        Self { pieces: vec![start], rate_radps }
    }

    /// Heading at `t_s`, in (-pi, pi] \[rad\]. Before the beginning it is the first heading; after the end it turns to
    /// the last wanted heading and stays.
    pub fn at(&self, t_s: f64) -> f64 {
        let Piece { from_s, heading } =
            self.pieces.iter().rev().find(|piece| piece.from_s <= t_s).unwrap_or(&self.pieces[0]);
        match heading {
            Heading::Turn { by_rad, to_rad } => {
                let left_rad = by_rad.abs() - self.rate_radps * (t_s - from_s);
                let is_turning = self.rate_radps > 0.0 && left_rad > 0.0;
                angle::wrapped(if is_turning { to_rad - left_rad.copysign(*by_rad) } else { *to_rad })
            }
            Heading::Computed { first, heading_rad } => {
                let steps = (t_s / STEP_S).max(0.0);
                let last = heading_rad.len() - 1;
                let before = (steps as usize).saturating_sub(*first).min(last);
                let [from, to] = [before, (before + 1).min(last)].map(|step| heading_rad[step]);
                angle::wrapped(from + (to - from) * (steps - (first + before) as f64).min(1.0))
            }
        }
    }

    /// Continues with a `curve` that begins at `begins_s`, up to its end.
    pub fn extend(&mut self, curve: &Curve, begins_s: f64, rule: &Rule) {
        let first = (begins_s.min(MAX_S) / STEP_S) as usize;
        let first_s = first as f64 * STEP_S;
        let before_rad = self.at(first_s);
        let ends_s = begins_s + curve.duration_s();
        let times_s = (first + 1..=(ends_s.min(MAX_S) / STEP_S) as usize).map(|step| step as f64 * STEP_S - begins_s);
        let wanted: Vec<f64> = match rule {
            Rule::Steps(steps) => {
                for (after_s, to_rad) in steps {
                    let (from_s, to_rad) = (begins_s + after_s, *to_rad);
                    let by_rad = angle::difference(to_rad, self.at(from_s));
                    self.pieces.push(Piece { from_s, heading: Heading::Turn { by_rad, to_rad } });
                }
                return;
            }
            Rule::Waypoints(headings_rad) => {
                let headings_rad = [&[before_rad], headings_rad.as_slice()].concat();
                let at_s = curve.times_s();
                times_s.map(|t_s| between(&at_s, &headings_rad, t_s)).collect()
            }
            Rule::Track => tracked(times_s.map(|t_s| course(&curve.at(t_s))).collect(), before_rad),
            Rule::Centre => tracked(times_s.map(|t_s| to_centre(curve, &curve.at(t_s))).collect(), before_rad),
        };
        let most_rad = if self.rate_radps > 0.0 { self.rate_radps * STEP_S } else { f64::INFINITY };
        let mut heading_rad = vec![before_rad];
        for wanted_rad in wanted {
            let last_rad = heading_rad[heading_rad.len() - 1];
            heading_rad.push(last_rad + angle::difference(wanted_rad, last_rad).clamp(-most_rad, most_rad));
        }
        self.pieces.push(Piece { from_s: first_s, heading: Heading::Computed { first, heading_rad } });
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

/// Direction of flight \[rad\]; `None` below [`SLOW_MPS`].
fn course(setpoint: &Setpoint) -> Option<f64> {
    let [north, east, _] = setpoint.velocity_mps;
    (libm::hypot(north, east) >= SLOW_MPS).then(|| libm::atan2(east, north))
}

/// Direction to the centre of a figure \[rad\]; `None` at the centre. For any other curve, the direction of flight.
fn to_centre(curve: &Curve, setpoint: &Setpoint) -> Option<f64> {
    let CurveShape::Figure(figure) = &curve.shape else { return course(setpoint) };
    let centre = figure.centre();
    let [north, east] = [centre.x - setpoint.position_m[0], centre.y - setpoint.position_m[1]];
    (libm::hypot(north, east) > 1e-6 * figure.radius_m).then(|| libm::atan2(east, north))
}

/// Fills the gaps before known directions with the next direction, and the end with the last direction; `before_rad` if
/// no direction is known.
fn tracked(mut known: Vec<Option<f64>>, before_rad: f64) -> Vec<f64> {
    let mut next = known.iter().flatten().last().copied().unwrap_or(before_rad);
    known.iter_mut().rev().for_each(|known| next = *known.get_or_insert(next));
    known.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Headings of a rest of 20 s with these steps \[s, deg\].
    fn stepped(from_deg: f64, steps: &[(f64, f64)], limit_dps: f64) -> impl Fn(f64) -> f64 {
        let mut headings = Headings::new(from_deg.to_radians(), limit_dps.to_radians());
        let rule = Rule::Steps(steps.iter().map(|(t_s, deg)| (*t_s, deg.to_radians())).collect());
        headings.extend(&CurveShape::Rest(Vector3::zeros(), 20.0).into(), 0.0, &rule);
        move |t_s| headings.at(t_s).to_degrees()
    }

    #[test]
    fn without_a_limit_headings_step() {
        let degrees = [0.0, 0.99, 1.0, 1.99, 2.0, 60.0].map(stepped(0.0, &[(1.0, 90.0), (2.0, 180.0)], 0.0));
        assert_eq!(degrees, [0.0, 0.0, 90.0, 90.0, 180.0, 180.0]);
    }

    #[test]
    fn with_a_limit_turns_have_that_rate_and_may_interrupt_one_another() {
        let at = stepped(0.0, &[(1.0, 90.0), (1.5, -90.0)], 90.0);
        for (t_s, deg) in [(0.9, 0.0), (1.2, 18.0), (1.5, 45.0), (2.0, 0.0), (2.5, -45.0), (3.0, -90.0), (9.0, -90.0)] {
            assert!((at(t_s) - deg).abs() < 1e-9, "{} and not {deg} at {t_s} s", at(t_s));
        }
    }

    #[test]
    fn from_170_to_minus_170_is_20_degrees() {
        let at = stepped(170.0, &[(10.0, -170.0)], 10.0);
        for (t_s, deg) in [(10.5, 175.0), (11.5, -175.0), (12.0, -170.0), (99.0, -170.0)] {
            assert!((at(t_s) - deg).abs() < 1e-9, "{} and not {deg} at {t_s} s", at(t_s));
        }
    }

    #[test]
    fn the_first_turn_begins_where_the_vehicle_stands() {
        let at = stepped(180.0, &[(0.0, 180.0)], 90.0);
        assert!([0.0, 0.1, 5.0].iter().all(|t_s| (at(*t_s) - 180.0).abs() < 1e-9));
        let at = stepped(45.0, &[(0.0, 0.0)], 90.0);
        assert!((at(0.0) - 45.0).abs() < 1e-9 && (at(0.25) - 22.5).abs() < 1e-9 && at(0.5).abs() < 1e-9);
    }

    #[test]
    fn a_turn_goes_on_in_the_next_part_and_a_track_begins_within_it() {
        let rest = Curve::from(CurveShape::Rest(Vector3::zeros(), 1.0));
        let mut headings = Headings::new(0.0, 1.0);
        headings.extend(&rest, 0.0, &Rule::Steps(vec![(0.0, 3.0)]));
        headings.extend(&rest, 1.0, &Rule::Steps(vec![]));
        assert!((headings.at(2.0) - 2.0).abs() < 1e-9 && (headings.at(9.0) - 3.0).abs() < 1e-9);
        headings.extend(&rest, 2.0, &Rule::Waypoints(vec![2.0]));
        for t_s in [2.0, 2.02, 2.7, 3.0, 9.0] {
            assert!((headings.at(t_s) - 2.0).abs() < 1e-9, "{} at {t_s} s", headings.at(t_s));
        }
    }
}
