//! Times of the controller's steps on a machine that also does other work.
//!
//! Every round runs each sequence through a new controller of each law and solver, in turns, and times every step. The
//! work of a step is the same in every round, so differences come from the machine: the time of a problem is its median
//! over the rounds. Steps follow each other without a pause, so caches are warm, unlike in a flight at 100 Hz.
//!
//! After each sequence a canary reads the clock in a loop for as long as the steps took, and looks for gaps:
//! interruptions by the machine. A single long step proves nothing if such a gap is as long.

use std::fmt::Write;
use std::hint::black_box;

use attitude_mpc::AttitudeMpc;
use attitude_mpc::law::mpc::condensed::Condensed;
use attitude_mpc::model::PredictionModel;
use contract::message::{Reference, SolveStatus, State};
use nalgebra::DVector;
use outcome::percentiles::{Percentiles, median_ns};
use runtime::realtime::now_ns;
use runtime::timed;
use serde::Serialize;
use settings::{Law, SolverName};

use super::problems::Sequence;

/// Controllers: name, law and solver; an MPC is named after its solver.
pub const CONTROLLERS: [(&str, Law, SolverName); 6] = [
    ("clarabel", Law::Mpc, SolverName::Clarabel),
    ("active-set", Law::Mpc, SolverName::ActiveSet),
    ("lqr", Law::Lqr, SolverName::Clarabel),
    ("pid", Law::Pid, SolverName::Clarabel),
    ("geometric", Law::Geometric, SolverName::Clarabel),
    ("indi", Law::Indi, SolverName::Clarabel),
];
/// Name of all sequences together, in place of a sequence's name.
pub const ALL: &str = "all";
/// Shortest watch of the canary \[ns\].
const CANARY_NS: u64 = 1_000_000;

/// Steps of one sequence with one controller.
#[derive(Debug, Clone)]
pub struct StepSeries {
    pub sequence: String,
    pub controller: &'static str,
    /// `true` if the controller is an MPC, whose steps have two paths.
    pub solves: bool,
    pub steps: Vec<Step>,
}

#[derive(Debug, Clone)]
pub struct Step {
    pub tick: u64,
    /// Status in the message, see [`SolveStatus`].
    pub status: u64,
    pub iterations: u64,
    /// One time for each round \[ns\].
    pub rounds_ns: Vec<u64>,
}

/// Selection of the steps of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Path {
    /// Steps whose unconstrained plan was inside the set.
    Explicit,
    /// Steps that needed the solver.
    Solver,
    All,
}

/// Times of the steps of one sequence, controller and path.
#[derive(Debug, Clone, Serialize)]
pub struct StepTimes {
    /// Name of the sequence, or [`ALL`].
    pub sequence: String,
    pub controller: &'static str,
    pub path: Path,
    /// Distribution over the steps; the time of each step is its median over the rounds.
    pub step: Percentiles,
    pub mean_us: f64,
    /// Longest step of all rounds \[us\].
    pub longest_us: f64,
    /// Median over the rounds of the step that was longest in one of them \[us\].
    pub longest_median_us: f64,
    pub iterations_mean: f64,
    pub iterations_max: u64,
    /// Steps that ended in anything but the explicit plan or the optimum.
    pub unsolved: usize,
}

impl Step {
    fn time_ns(&self) -> u64 {
        median_ns(self.rounds_ns.iter().copied())
    }
}

/// Lists every single time as CSV.
pub fn to_csv(series: &[StepSeries]) -> String {
    let mut csv = "sequence,controller,tick,status,iterations,round,ns\n".to_owned();
    for StepSeries { sequence, controller, steps, .. } in series {
        for Step { tick, status, iterations, rounds_ns, .. } in steps {
            for (round, ns) in rounds_ns.iter().enumerate() {
                // Writing to a String never fails.
                let _ = writeln!(csv, "{sequence},{controller},{tick},{status},{iterations},{round},{ns}");
            }
        }
    }
    csv
}

/// Times every step of `sequences` with each controller, `rounds` times. Returns one series for each sequence and
/// controller, and the longest gap seen by the canary \[ns\].
pub fn sample(sequences: &[Sequence], rounds: u32) -> (Vec<StepSeries>, u64) {
    let each = || sequences.iter().flat_map(|sequence| CONTROLLERS.map(|controller| (sequence, controller)));
    let mut series: Vec<StepSeries> = each().map(|(sequence, controller)| untimed(sequence, controller)).collect();
    let mut longest_stall_ns = 0;
    for _ in 0..rounds {
        for ((sequence, (_, law, solver)), series) in each().zip(&mut series) {
            let mut mpc = AttitudeMpc::new(&sequence.scenario_for(law, solver));
            let mut total_ns = CANARY_NS;
            for ((state, reference), step) in sequence.samples.iter().zip(&mut series.steps) {
                let (_, ns) = timed(|| black_box(mpc.step(state.stamp.tick, black_box(state), black_box(reference))));
                step.rounds_ns.push(ns);
                total_ns += ns;
            }
            longest_stall_ns = longest_stall_ns.max(longest_gap_ns(total_ns));
        }
    }
    (series, longest_stall_ns)
}

/// Makes a first pass, untimed: status and iterations of each step.
fn untimed(sequence: &Sequence, (controller, law, solver): (&'static str, Law, SolverName)) -> StepSeries {
    let mut mpc = AttitudeMpc::new(&sequence.scenario_for(law, solver));
    let step = |(state, reference): &(State, Reference)| {
        let controls = mpc.step(state.stamp.tick, state, reference);
        Step { tick: reference.stamp.tick, status: controls.status, iterations: controls.iterations, rounds_ns: vec![] }
    };
    StepSeries {
        sequence: sequence.name.clone(),
        controller,
        solves: law == Law::Mpc,
        steps: sequence.samples.iter().map(step).collect(),
    }
}

/// Reads the clock for `duration_ns` and does nothing else; returns the longest time between two readings \[ns\].
fn longest_gap_ns(duration_ns: u64) -> u64 {
    let start_ns = now_ns();
    let (mut last_ns, mut longest_ns) = (start_ns, 0);
    while last_ns - start_ns < duration_ns {
        let now = now_ns();
        longest_ns = longest_ns.max(now - last_ns);
        last_ns = now;
    }
    longest_ns
}

/// Time between two readings of the clock \[ns\].
pub fn clock_ns() -> u64 {
    median_ns([(); 10_000].map(|()| timed(|| ()).1))
}

/// Time of the bare matrix-vector product of the explicit path \[ns\].
pub fn floor_ns(sequence: &Sequence) -> anyhow::Result<f64> {
    const PRODUCTS: u32 = 1000;
    let Condensed { gain, .. } = Condensed::new(&PredictionModel::new(&sequence.scenario), &sequence.scenario)?;
    let gain = gain.given;
    let (given, mut plan) = (DVector::from_element(gain.ncols(), 0.5), DVector::zeros(gain.nrows()));
    let mut batch = || {
        for _ in 0..PRODUCTS {
            plan.gemv(1.0, black_box(&gain), black_box(&given), 0.0);
            black_box(&plan);
        }
    };
    Ok(median_ns([(); 101].map(|()| timed(&mut batch).1)) as f64 / f64::from(PRODUCTS))
}

/// Returns a row for each sequence, solver and path that has a step, then the rows over all sequences for each
/// controller.
pub fn step_times(series: &[StepSeries]) -> Vec<StepTimes> {
    let mut rows = vec![];
    for one in series.iter().filter(|series| series.solves) {
        for path in [Path::Explicit, Path::Solver] {
            rows.extend(StepTimes::of(&one.sequence, one.controller, path, &[one]));
        }
    }
    for (controller, law, _) in CONTROLLERS {
        let series: Vec<&StepSeries> = series.iter().filter(|series| series.controller == controller).collect();
        let paths: &[Path] = if law == Law::Mpc { &[Path::Explicit, Path::Solver, Path::All] } else { &[Path::All] };
        rows.extend(paths.iter().filter_map(|path| StepTimes::of(ALL, controller, *path, &series)));
    }
    rows
}

impl StepTimes {
    fn of(sequence: &str, controller: &'static str, path: Path, series: &[&StepSeries]) -> Option<Self> {
        let is_explicit = |step: &Step| step.status == SolveStatus::Explicit as u64;
        let on_path = |step: &&Step| path == Path::All || is_explicit(step) == (path == Path::Explicit);
        let steps: Vec<&Step> = series.iter().flat_map(|series| &series.steps).filter(on_path).collect();
        let times_ns: Vec<u64> = steps.iter().map(|step| step.time_ns()).collect();
        let longest = |step: &&&Step| step.rounds_ns.iter().max().copied().unwrap_or(0);
        let slowest = steps.iter().max_by_key(longest)?;
        let expected = [SolveStatus::Explicit as u64, SolveStatus::Solved as u64];
        Some(Self {
            sequence: sequence.to_owned(),
            controller,
            path,
            mean_us: times_ns.iter().sum::<u64>() as f64 / 1e3 / times_ns.len() as f64,
            step: Percentiles::of(times_ns)?,
            longest_us: longest(&slowest) as f64 / 1e3,
            longest_median_us: slowest.time_ns() as f64 / 1e3,
            iterations_mean: steps.iter().map(|step| step.iterations).sum::<u64>() as f64 / steps.len() as f64,
            iterations_max: steps.iter().map(|step| step.iterations).max()?,
            unsolved: steps.iter().filter(|step| !expected.contains(&step.status)).count(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(status: SolveStatus, iterations: u64, rounds_ns: [u64; 3]) -> Step {
        Step { tick: 0, status: status as u64, iterations, rounds_ns: rounds_ns.to_vec() }
    }

    #[test]
    fn a_row_has_the_median_and_the_longest_time() {
        let steps = vec![
            step(SolveStatus::Explicit, 0, [1000, 1100, 9000]),
            step(SolveStatus::Solved, 4, [5000, 5200, 5100]),
            step(SolveStatus::Fallback, 2, [3000, 3000, 3000]),
        ];
        let rows = step_times(&[StepSeries { sequence: "upset".into(), controller: "clarabel", solves: true, steps }]);
        let of = |sequence, path| rows.iter().find(|r| r.sequence == sequence && r.path == path).expect("a row");

        let explicit = of("upset", Path::Explicit);
        assert_eq!((explicit.step.n, explicit.step.max_us, explicit.unsolved), (1, 1.1, 0));
        assert_eq!((explicit.longest_us, explicit.longest_median_us), (9.0, 1.1));
        let solver = of("upset", Path::Solver);
        assert_eq!((solver.step.n, solver.iterations_mean, solver.iterations_max), (2, 3.0, 4));
        assert_eq!(solver.unsolved, 1);
        assert_eq!(of(ALL, Path::All).step.n, 3);
        assert!(rows.iter().all(|r| r.controller == "clarabel"), "no row of a controller that was not measured");
    }
}
