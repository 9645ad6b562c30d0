//! Work of the controller's solver in a flight: the `solver` section of run.json.
//!
//! Everything but `solve_us` is a function of the flight and repeats with it. `solve_us` is wall time around the solver
//! alone, measured in every mode, also in-process; it includes interruptions by whatever else ran on the machine.

use contract::message::{Controls, SolveStatus};
use hdrhistogram::Histogram;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::percentiles::{Percentiles, histogram, percentiles};

/// The `solver` section of run.json: ticks by the status of their solve, and what the solves took.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SolverRecord {
    /// Ticks whose unconstrained optimum satisfies every constraint.
    pub explicit: u64,
    /// Ticks with the constrained optimum, to the solver's tolerance.
    pub solved: u64,
    /// Ticks on which the solver ran out of iterations or time.
    pub limit_reached: u64,
    /// Ticks on which the solver found nothing, and the unconstrained plan was projected.
    pub fallback: u64,
    /// Ticks with an input that was not finite: the previous demand was repeated.
    pub bad_input: u64,
    /// Ticks without a fresh state: the previous demand was repeated.
    pub stale: u64,
    /// Ticks without a reference of the tick.
    pub no_reference: u64,
    /// Iterations of the solves.
    pub iterations: Iterations,
    /// Ticks whose published plan touches a constraint.
    pub ticks_with_active_constraints: u64,
    /// Wall time of a solve; null without a solve.
    pub solve_us: Option<Percentiles>,
}

/// Iterations over the solved ticks.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Iterations {
    /// Most iterations of a solve.
    pub max: u64,
    /// Mean iterations of a solve; null without a solved tick.
    pub mean: Option<f64>,
}

pub struct Solves {
    /// Ticks by [`SolveStatus`], in its order.
    ticks: [u64; 7],
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
        Self { ticks: [0; 7], iterations_max: 0, iterations: 0, touching: 0, times: histogram() }
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

    /// Returns the section of run.json.
    pub fn record(&self) -> SolverRecord {
        let [explicit, solved, limit_reached, fallback, bad_input, stale, no_reference] = self.ticks;
        let mean = (solved > 0).then(|| self.iterations as f64 / solved as f64);
        SolverRecord {
            explicit,
            solved,
            limit_reached,
            fallback,
            bad_input,
            stale,
            no_reference,
            iterations: Iterations { max: self.iterations_max, mean },
            ticks_with_active_constraints: self.touching,
            solve_us: (!self.times.is_empty()).then(|| percentiles(&self.times)),
        }
    }
}

impl SolverRecord {
    /// Describes the solves in one line for people; rare statuses are named only if they occurred.
    pub fn describe(&self) -> String {
        let Self { explicit, solved, fallback, .. } = self;
        let iterations = if *solved > 0 { format!(" (max {} iterations)", self.iterations.max) } else { String::new() };
        let rare = [
            (self.limit_reached, "stopped at a limit"),
            (self.bad_input, "with bad input"),
            (self.stale, "without a fresh state"),
            (self.no_reference, "without a fresh reference"),
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
        let record = solves.record();
        let counts = (record.explicit, record.solved, record.limit_reached, record.fallback, record.bad_input);
        assert_eq!((counts, record.stale, record.no_reference), ((2, 2, 1, 1, 1), 0, 0));
        assert_eq!(record.iterations, Iterations { max: 6, mean: Some(4.5) });
        assert_eq!(record.ticks_with_active_constraints, 1);
        let solve = record.solve_us.unwrap();
        let near = |got: f64, us: f64| (got / us - 1.0).abs() < 2e-3;
        assert!(solve.n == 2 && near(solve.p50_us, 100.0) && near(solve.max_us, 300.0), "{solve:?}");
        let line = "2 explicit, 2 solved (max 6 iterations), 1 stopped at a limit, 1 with bad input, 1 fallbacks";
        assert_eq!(record.describe(), line);
        assert_eq!(Solves::new().record(), SolverRecord::default());
    }
}
