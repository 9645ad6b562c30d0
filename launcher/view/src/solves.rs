//! What the controller's solver did in a flight: the `solver` section of run.json.
//!
//! Everything but `solve_us` is a function of the flight and repeats with it. That is wall time around the solver alone,
//! taken in every mode, in process too; what else ran on the machine is in it.

use contract::message::{Controls, SolveStatus};
use hdrhistogram::Histogram;
use serde_json::{Value, json};

use crate::percentiles::{histogram, percentiles};

pub struct Solves {
    /// Ticks by status, in the order of [`SolveStatus`].
    ticks: [u64; 7],
    iterations_max: u64,
    /// Sum over the solved ticks.
    iterations: u64,
    /// Ticks whose published plan touches a constraint.
    touching: u64,
    times: Histogram<u64>,
}

impl Solves {
    #[expect(clippy::new_without_default, reason = "an empty record is made on purpose, never by default")]
    pub fn new() -> Self {
        Self { ticks: [0; 7], iterations_max: 0, iterations: 0, touching: 0, times: histogram() }
    }

    /// Takes one message in. A status that the contract does not know is not counted.
    pub fn observe(&mut self, controls: &Controls) {
        if let Some(ticks) = self.ticks.get_mut(controls.status as usize) {
            *ticks += 1;
        }
        if controls.status == SolveStatus::Solved as u64 {
            self.iterations_max = self.iterations_max.max(controls.iterations);
            self.iterations = self.iterations.saturating_add(controls.iterations);
        }
        self.touching += u64::from(controls.active_constraints > 0);
        if controls.solve_ns > 0 {
            self.times.saturating_record(controls.solve_ns);
        }
    }

    pub fn ticks(&self, status: SolveStatus) -> u64 {
        self.ticks[status as usize]
    }

    pub fn to_json(&self) -> Value {
        let solved = self.ticks(SolveStatus::Solved);
        let mean = (solved > 0).then(|| self.iterations as f64 / solved as f64);
        json!({
            "explicit": self.ticks(SolveStatus::Explicit),
            "solved": solved,
            "limit_reached": self.ticks(SolveStatus::LimitReached),
            "fallback": self.ticks(SolveStatus::Fallback),
            "bad_input": self.ticks(SolveStatus::BadInput),
            "stale": self.ticks(SolveStatus::Stale),
            "no_reference": self.ticks(SolveStatus::NoReference),
            "iterations": { "max": self.iterations_max, "mean": mean },
            "ticks_with_active_constraints": self.touching,
            "solve_us": (!self.times.is_empty()).then(|| percentiles(&self.times)),
        })
    }

    /// One line for people; what is rare is told only when it happened.
    pub fn describe(&self) -> String {
        let [explicit, solved, limit_reached, fallback, bad_input, stale, no_reference] = self.ticks;
        let told = |count: u64, text: String| if count > 0 { text } else { String::new() };
        let iterations = told(solved, format!(" (max {} iterations)", self.iterations_max));
        let limit_reached = told(limit_reached, format!(", {limit_reached} stopped at a limit"));
        let bad_input = told(bad_input, format!(", {bad_input} with bad input"));
        let stale = told(stale, format!(", {stale} without a fresh state"));
        let no_reference = told(no_reference, format!(", {no_reference} without a fresh reference"));
        format!(
            "{explicit} explicit, {solved} solved{iterations}{limit_reached}{bad_input}{stale}{no_reference}, {fallback} fallbacks"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controls(status: SolveStatus, iterations: u64, solve_ns: u64) -> Controls {
        Controls { status: status as u64, iterations, solve_ns, ..Controls::default() }
    }

    #[test]
    fn ticks_are_counted_by_status_and_iterations_over_the_solved() {
        let mut solves = Solves::new();
        for message in [
            controls(SolveStatus::Explicit, 0, 0),
            controls(SolveStatus::Explicit, 0, 0),
            Controls { active_constraints: 2, ..controls(SolveStatus::Solved, 6, 0) },
            controls(SolveStatus::Solved, 3, 0),
            controls(SolveStatus::LimitReached, 100, 0),
            controls(SolveStatus::Fallback, 50, 0),
            controls(SolveStatus::BadInput, 0, 0),
            Controls { status: 99, ..Controls::default() },
            Controls { status: u64::MAX, ..Controls::default() },
        ] {
            solves.observe(&message);
        }
        let json = solves.to_json();
        let count = |key: &str| json[key].as_u64();
        assert_eq!(
            ["explicit", "solved", "limit_reached", "fallback", "bad_input"].map(count),
            [2, 2, 1, 1, 1].map(Some)
        );
        assert_eq!(json["iterations"], json!({ "max": 6, "mean": 4.5 }));
        assert_eq!(json["ticks_with_active_constraints"], 1);
        assert_eq!(json["solve_us"], Value::Null, "no time was taken");
        let line = "2 explicit, 2 solved (max 6 iterations), 1 stopped at a limit, 1 with bad input, 1 fallbacks";
        assert_eq!(solves.describe(), line);
    }

    #[test]
    fn a_flight_without_a_solve_has_no_mean() {
        assert_eq!(Solves::new().to_json()["iterations"], json!({ "max": 0, "mean": null }));
    }

    #[test]
    fn times_are_those_of_the_solves() {
        let mut solves = Solves::new();
        solves.observe(&controls(SolveStatus::Explicit, 0, 0));
        solves.observe(&controls(SolveStatus::Solved, 5, 100_000));
        solves.observe(&controls(SolveStatus::Fallback, 9, 300_000));
        let times = &solves.to_json()["solve_us"];
        assert_eq!(times["n"], 2);
        let near =
            |key: &str, us: f64| assert!((times[key].as_f64().unwrap() / us - 1.0).abs() < 2e-3, "{key}: {times}");
        near("p50_us", 100.0);
        near("max_us", 300.0);
    }
}
