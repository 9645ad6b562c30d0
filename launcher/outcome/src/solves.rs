//! Work of the controller's solver in a flight: the `solver` section of run.json.
//!
//! Everything but `solve_us` is a function of the flight and repeats with it. That is wall time around the solver
//! alone, taken in every mode, in process too; what else ran on the machine is in it.

use contract::message::{Controls, SolveStatus};
use hdrhistogram::Histogram;
use serde_json::{Value, json};

use crate::percentiles::{histogram, percentiles};

/// The statuses of [`SolveStatus`], in its order.
const STATUSES: [&str; 7] = ["explicit", "solved", "limit_reached", "fallback", "bad_input", "stale", "no_reference"];

pub struct Solves {
    /// Ticks by status.
    ticks: [u64; STATUSES.len()],
    iterations_max: u64,
    /// Sum of the iterations over the solved ticks.
    iterations: u64,
    /// Ticks whose published plan touches a constraint.
    touching: u64,
    times: Histogram<u64>,
}

impl Solves {
    #[expect(clippy::new_without_default, reason = "an empty record is made on purpose, never by default")]
    pub fn new() -> Self {
        Self { ticks: [0; STATUSES.len()], iterations_max: 0, iterations: 0, touching: 0, times: histogram() }
    }

    /// Takes in a message. A status that the contract does not know is not counted.
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

    /// Number of solves that a limit of time or iterations stopped.
    pub fn stopped(&self) -> u64 {
        self.ticks[SolveStatus::LimitReached as usize]
    }

    pub fn to_json(&self) -> Value {
        let solved = self.ticks[SolveStatus::Solved as usize];
        let mean = (solved > 0).then(|| self.iterations as f64 / solved as f64);
        let mut told = json!({
            "iterations": { "max": self.iterations_max, "mean": mean },
            "ticks_with_active_constraints": self.touching,
            "solve_us": (!self.times.is_empty()).then(|| percentiles(&self.times)),
        });
        for (status, ticks) in STATUSES.into_iter().zip(self.ticks) {
            told[status] = ticks.into();
        }
        told
    }

    /// Describes the solves in one line for people; rare statuses are told only if they occurred.
    pub fn describe(&self) -> String {
        let [explicit, solved, limit_reached, fallback, bad_input, stale, no_reference] = self.ticks;
        let iterations = if solved > 0 { format!(" (max {} iterations)", self.iterations_max) } else { String::new() };
        let rare = [
            (limit_reached, "stopped at a limit"),
            (bad_input, "with bad input"),
            (stale, "without a fresh state"),
            (no_reference, "without a fresh reference"),
        ];
        let rare: Vec<_> =
            rare.iter().filter(|(count, _)| *count > 0).map(|(count, words)| format!(", {count} {words}")).collect();
        format!("{explicit} explicit, {solved} solved{iterations}{}, {fallback} fallbacks", rare.concat())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_counted_by_status_and_iterations_over_the_solved() {
        let controls = |status: SolveStatus, iterations, solve_ns, active_constraints| Controls {
            status: status as u64,
            iterations,
            solve_ns,
            active_constraints,
            ..Controls::default()
        };
        let mut solves = Solves::new();
        for message in [
            controls(SolveStatus::Explicit, 0, 0, 0),
            controls(SolveStatus::Explicit, 0, 0, 0),
            controls(SolveStatus::Solved, 6, 100_000, 2),
            controls(SolveStatus::Solved, 3, 0, 0),
            controls(SolveStatus::LimitReached, 100, 0, 0),
            controls(SolveStatus::Fallback, 50, 300_000, 0),
            controls(SolveStatus::BadInput, 0, 0, 0),
            Controls { status: 99, ..Controls::default() },
            Controls { status: u64::MAX, ..Controls::default() },
        ] {
            solves.observe(&message);
        }
        let json = solves.to_json();
        assert_eq!(json!(STATUSES.map(|status| &json[status])), json!([2, 2, 1, 1, 1, 0, 0]));
        assert_eq!(json["iterations"], json!({ "max": 6, "mean": 4.5 }));
        assert_eq!(json["ticks_with_active_constraints"], 1);
        let near = |key, us: f64| (json["solve_us"][key].as_f64().unwrap() / us - 1.0).abs() < 2e-3;
        assert!(json["solve_us"]["n"] == 2 && near("p50_us", 100.0) && near("max_us", 300.0), "{json}");
        let line = "2 explicit, 2 solved (max 6 iterations), 1 stopped at a limit, 1 with bad input, 1 fallbacks";
        assert_eq!(solves.describe(), line);
        let none = Solves::new().to_json();
        assert_eq!([&none["iterations"], &none["solve_us"]], [&json!({ "max": 0, "mean": null }), &Value::Null]);
    }
}
