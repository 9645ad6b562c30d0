//! What the samples amount to: one row per sequence, solver and path.

use contract::message::SolveStatus;
use serde::Serialize;

use super::distribution::Distribution;
use super::sampling::{Samples, Series, Step};

/// Name of the row that holds every sequence.
pub const ALL: &str = "all";

/// Which steps a row holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Path {
    /// The unconstrained plan was inside the set.
    Explicit,
    /// The solver was asked.
    Solver,
    /// Both.
    All,
}

/// One row.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Name of the sequence, or [`ALL`].
    pub sequence: String,
    /// Name of the solver.
    pub solver: &'static str,
    /// Which of its steps.
    pub path: Path,
    /// The whole step, median over the rounds of each.
    pub step: Distribution,
    /// The longest of all rounds \[us\].
    pub longest_us: f64,
    /// What that step takes as a rule \[us\].
    pub longest_as_a_rule_us: f64,
    /// Mean over the steps.
    pub iterations_mean: f64,
    /// The most of any.
    pub iterations_max: u64,
    /// The most blocks of memory a step asked for; nothing where they were not counted.
    pub allocations_max: Option<u64>,
    /// Steps that ended in anything but the explicit plan or the optimum.
    pub unsolved: usize,
}

/// Every row that holds something, the joint ones last.
pub fn rows(samples: &Samples) -> Vec<Row> {
    let mut rows = vec![];
    for series in &samples.series {
        for path in [Path::Explicit, Path::Solver] {
            rows.extend(row(&series.sequence, series.solver, path, &[series]));
        }
    }
    for solver in super::sampling::SOLVERS.map(|(_, name)| name) {
        let series: Vec<&Series> = samples.series.iter().filter(|series| series.solver == solver).collect();
        for path in [Path::Explicit, Path::Solver, Path::All] {
            rows.extend(row(ALL, solver, path, &series));
        }
    }
    rows
}

impl Path {
    fn holds(self, step: &Step) -> bool {
        let explicit = step.status == SolveStatus::Explicit as u64;
        match self {
            Self::Explicit => explicit,
            Self::Solver => !explicit,
            Self::All => true,
        }
    }
}

fn row(sequence: &str, solver: &'static str, path: Path, series: &[&Series]) -> Option<Row> {
    let steps: Vec<&Step> = series.iter().flat_map(|series| &series.steps).filter(|step| path.holds(step)).collect();
    let distribution = Distribution::of(steps.iter().map(|step| step.time_ns()))?;
    let longest = |step: &&&Step| step.rounds_ns.iter().max().copied().unwrap_or(0);
    let slowest = steps.iter().max_by_key(longest)?;
    let iterations = steps.iter().map(|step| step.iterations);
    let expected = [SolveStatus::Explicit as u64, SolveStatus::Solved as u64];
    Some(Row {
        sequence: sequence.to_owned(),
        solver,
        path,
        step: distribution,
        longest_us: longest(&slowest) as f64 / 1e3,
        longest_as_a_rule_us: slowest.time_ns() as f64 / 1e3,
        iterations_mean: iterations.clone().sum::<u64>() as f64 / steps.len() as f64,
        iterations_max: iterations.max()?,
        allocations_max: steps.iter().map(|step| step.allocations).collect::<Option<Vec<u64>>>().and_then(most),
        unsolved: steps.iter().filter(|step| !expected.contains(&step.status)).count(),
    })
}

fn most(counts: Vec<u64>) -> Option<u64> {
    counts.into_iter().max()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(status: SolveStatus, iterations: u64, rounds_ns: [u64; 3]) -> Step {
        Step {
            tick: 0,
            status: status as u64,
            iterations,
            allocations: Some(iterations),
            rounds_ns: rounds_ns.to_vec(),
        }
    }

    #[test]
    fn a_row_tells_the_usual_time_and_the_longest() {
        let steps = vec![
            step(SolveStatus::Explicit, 0, [1000, 1100, 9000]),
            step(SolveStatus::Solved, 4, [5000, 5200, 5100]),
            step(SolveStatus::Fallback, 2, [3000, 3000, 3000]),
        ];
        let series = vec![Series { sequence: "upset".into(), solver: "clarabel", steps }];
        let rows = rows(&Samples { series, longest_stall_ns: 0 });
        let of = |sequence, path| rows.iter().find(|r| r.sequence == sequence && r.path == path).expect("a row");

        let explicit = of("upset", Path::Explicit);
        assert_eq!((explicit.step.n, explicit.step.max_us, explicit.unsolved), (1, 1.1, 0));
        assert_eq!((explicit.longest_us, explicit.longest_as_a_rule_us), (9.0, 1.1));
        let solver = of("upset", Path::Solver);
        assert_eq!((solver.step.n, solver.iterations_mean, solver.iterations_max), (2, 3.0, 4));
        assert_eq!((solver.allocations_max, solver.unsolved), (Some(4), 1));
        assert_eq!(of(ALL, Path::All).step.n, 3);
        assert!(rows.iter().all(|r| r.solver == "clarabel"), "no row of a solver that was not measured");
    }
}
