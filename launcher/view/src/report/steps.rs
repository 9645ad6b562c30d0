//! Response to steps of the reference: rise time, overshoot and settling time of each axis.
//!
//! The definitions are the usual ones of a step response from `a` to `b` at the time `t0`:
//!
//! ```text
//! rise time       from 10 % to 90 % of b - a
//! overshoot       largest excess beyond b, as a share of b - a
//! settling time   from t0 until the response stays within 2 % of b - a around b
//! ```
//!
//! A step is a change of the mission's position, or of the heading reference, from one sample to the next by at least
//! [`LEAST_M`] or [`LEAST_RAD`], after which the reference stays constant for a second at least. The response is judged
//! until the reference changes again.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

use airframe::angle;
use contract::message::Truth;
use outcome::ticks::LoggedTick;

use crate::draw::{number, table};

/// Least change of a reference that is a step: far above that of a ramp from sample to sample.
const LEAST_M: f64 = 0.2;
const LEAST_RAD: f64 = 0.1;
/// Least time for which the reference stays constant \[s\].
const STAYS_S: f64 = 1.0;
/// Band around the end value in which the response has settled, as a share of the step.
const BAND: f64 = 0.02;

/// Axes: name, unit, and factor to that unit.
const AXES: [(&str, &str, f64); 4] =
    [("north", "m", 1.0), ("east", "m", 1.0), ("down", "m", 1.0), ("heading", "deg", 180.0 / std::f64::consts::PI)];

/// Steps of all axes, gathered tick by tick.
pub struct Steps {
    axes: [AxisSteps; AXES.len()],
}

#[derive(Default)]
struct AxisSteps {
    least: f64,
    wanted: Option<f64>,
    /// Step that is being followed.
    open: Option<Response>,
    done: Vec<Response>,
}

/// Response to one step. Shares are relative to the size of the step.
#[derive(Debug, Clone, PartialEq)]
struct Response {
    at_s: f64,
    size: f64,
    newest_s: f64,
    /// First times at or above 10 and 90 %.
    reached_s: [Option<f64>; 2],
    overshoot: f64,
    /// Time since which the response is within the band.
    settled_s: Option<f64>,
}

impl Response {
    fn new(at_s: f64, size: f64) -> Self {
        Self { at_s, size, newest_s: at_s, reached_s: [None; 2], overshoot: 0.0, settled_s: None }
    }

    /// Takes in the distance that is left to the end value.
    fn observe(&mut self, time_s: f64, left: f64) {
        let share = 1.0 - left / self.size;
        self.newest_s = time_s;
        for (reached_s, mark) in self.reached_s.iter_mut().zip([0.1, 0.9]) {
            if share >= mark {
                reached_s.get_or_insert(time_s);
            }
        }
        self.overshoot = self.overshoot.max(share - 1.0);
        if (share - 1.0).abs() <= BAND {
            self.settled_s.get_or_insert(time_s);
        } else {
            self.settled_s = None;
        }
    }

    fn cells(&self, &(axis, unit, factor): &(&str, &str, f64)) -> Vec<String> {
        let rise_s = self.reached_s[1].zip(self.reached_s[0]).map(|(high_s, low_s)| high_s - low_s);
        vec![
            axis.into(),
            number(self.at_s, 2),
            format!("{} {unit}", number(self.size * factor, 2)),
            number(rise_s, 2),
            number(100.0 * self.overshoot, 1),
            self.settled_s.map_or("not settled".into(), |settled_s| number(settled_s - self.at_s, 2)),
        ]
    }
}

impl AxisSteps {
    /// Takes in a sample: the reference, its change since the last sample, and the distance left to it.
    fn observe(&mut self, time_s: f64, wanted: f64, change: f64, left: f64) {
        if change != 0.0 && self.wanted.is_some() {
            self.close();
            self.open = (change.abs() >= self.least).then(|| Response::new(time_s, change));
        }
        self.wanted = Some(wanted);
        if let Some(open) = &mut self.open {
            open.observe(time_s, left);
        }
    }

    fn close(&mut self) {
        self.done.extend(self.open.take().filter(|open| open.newest_s - open.at_s >= STAYS_S));
    }
}

impl Steps {
    pub fn new() -> Self {
        let axis = |least| AxisSteps { least, ..AxisSteps::default() };
        Self { axes: [axis(LEAST_M), axis(LEAST_M), axis(LEAST_M), axis(LEAST_RAD)] }
    }

    /// Takes in the next tick. A tick without a TRUTH is skipped; without a REFERENCE, its heading is skipped.
    pub fn observe(&mut self, tick: &LoggedTick) {
        let (Some(Truth { actual, .. }), time_s) = (&tick.of.truth, tick.time_s()) else { return };
        for (axis, steps) in self.axes[..3].iter_mut().enumerate() {
            let wanted = tick.wanted_m[axis];
            let change = steps.wanted.map_or(0.0, |before| wanted - before);
            steps.observe(time_s, wanted, change, wanted - actual.position_m[axis]);
        }
        if let Some(reference) = &tick.of.reference {
            let (steps, wanted) = (&mut self.axes[3], reference.attitude_rad[2]);
            let change = steps.wanted.map_or(0.0, |before| angle::difference(wanted, before));
            steps.observe(time_s, wanted, change, angle::difference(wanted, actual.attitude_rad[2]));
        }
    }

    /// Makes the table of all steps; empty without a step.
    pub fn table(mut self) -> String {
        self.axes.iter_mut().for_each(AxisSteps::close);
        let rows: Vec<_> =
            AXES.iter().zip(&self.axes).flat_map(|(of, axis)| axis.done.iter().map(|step| step.cells(of))).collect();
        if rows.is_empty() {
            return String::new();
        }
        let headings = ["axis", "at [s]", "step", "rise time [s]", "overshoot [%]", "settling time [s]"];
        format!(
            "<h3>Steps of the reference</h3>{}<p class=\"hint\">Rise: from 10 to 90 % of the step. Overshoot: the largest \
             excess beyond the new value, as a share of the step. Settling: until the response stays within 2 % of the \
             step around the new value. Judged until the reference changes again.</p>",
            table(&headings, rows)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of an axis whose reference changes at 1 s to `size`. The answer is `response`, a share of `size` over the
    /// time since then \[s\].
    fn flown(size: f64, until_s: f64, response: impl Fn(f64) -> f64) -> Vec<Response> {
        let mut axis = AxisSteps { least: LEAST_M, ..AxisSteps::default() };
        for tick in 0..(until_s * 100.0) as u64 {
            let time_s = tick as f64 / 100.0;
            let wanted = if time_s < 1.0 { 0.0 } else { size };
            let change = axis.wanted.map_or(0.0, |before| wanted - before);
            let is = if time_s < 1.0 { 0.0 } else { size * response(time_s - 1.0) };
            axis.observe(time_s, wanted, change, wanted - is);
        }
        axis.close();
        axis.done
    }

    #[test]
    fn a_second_order_response_has_the_overshoot_and_times_of_the_textbook() {
        // Damping 0.5 at 2 rad/s: overshoot exp(-pi d / sqrt(1 - d^2)) = 16.3 %, settling about 4 / (d w) = 4 s.
        let (damping, natural_radps) = (0.5_f64, 2.0_f64);
        let root = (1.0 - damping * damping).sqrt();
        let response = |t: f64| {
            let (decay, turn) = ((-damping * natural_radps * t).exp(), natural_radps * root * t);
            1.0 - decay * (turn.cos() + damping / root * turn.sin())
        };
        for size in [10.0, -3.0] {
            let steps = flown(size, 12.0, response);
            let [Response { size: found, at_s, overshoot, settled_s, reached_s, .. }] = &steps[..] else {
                panic!("{steps:?}")
            };
            assert_eq!((*found, *at_s), (size, 1.0));
            assert!((overshoot - 0.163).abs() < 1e-3, "{overshoot}");
            assert!((settled_s.unwrap() - 1.0 - 4.04).abs() < 0.1, "{settled_s:?}");
            assert!((reached_s[1].unwrap() - reached_s[0].unwrap() - 0.82).abs() < 0.03, "{reached_s:?}");
        }
    }

    #[test]
    fn a_response_that_leaves_the_band_again_has_not_settled() {
        let steps = flown(1.0, 5.0, |t| if t < 3.0 { 1.0 } else { 1.1 });
        assert_eq!(steps[0].settled_s, None);
        assert!((steps[0].overshoot - 0.1).abs() < 1e-12);
    }

    #[test]
    fn a_small_change_and_one_that_does_not_stay_are_no_steps() {
        assert!(flown(0.1, 5.0, |_| 1.0).is_empty(), "too small");
        assert!(flown(1.0, 1.5, |_| 1.0).is_empty(), "the flight ends");
        assert_eq!(flown(1.0, 2.5, |_| 0.5)[0].reached_s[1], None, "never there");
    }
}
