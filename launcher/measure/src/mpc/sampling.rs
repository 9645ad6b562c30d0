//! Timing steps on a machine that is not ours alone.
//!
//! Every round takes each sequence through a new controller of each solver, in turns, and times every step. The work of a
//! step is the same in every round, so what differs is the machine: the time of a problem is its median over the
//! rounds. Steps follow each other without a pause, so caches are warm, as they are not in a flight at 100 Hz.
//!
//! After each sequence a canary spins on the clock for as long as the steps took, and looks for gaps: time that the
//! machine took away from a loop that does nothing. It tells how far a single long step can be believed.

use std::fmt::Write;
use std::hint::black_box;

use attitude_mpc::AttitudeMpc;
use contract::message::{Reference, State};
use contract::scenario::Solver;
use nalgebra::{DMatrix, DVector};
use runtime::realtime::now_ns;
use runtime::timed;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region};

use super::distribution::median;
use super::problems::Sequence;

/// Both solvers, and what the settings call them.
pub const SOLVERS: [(Solver, &str); 2] = [(Solver::Clarabel, "clarabel"), (Solver::ActiveSet, "active-set")];

/// The canary watches at least this long each time \[ns\].
const CANARY_NS: u64 = 1_000_000;

/// All that was timed.
#[derive(Debug, Clone)]
pub struct Samples {
    /// One per sequence and solver.
    pub series: Vec<Series>,
    /// The longest gap the canary saw \[ns\].
    pub longest_stall_ns: u64,
}

/// The steps of one sequence with one solver.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name of the sequence.
    pub sequence: String,
    /// Name of the solver.
    pub solver: &'static str,
    /// What each step was, and took.
    pub steps: Vec<Step>,
}

/// One step of the controller.
#[derive(Debug, Clone)]
pub struct Step {
    /// Sample number.
    pub tick: u64,
    /// As in the message, see [`SolveStatus`](contract::message::SolveStatus).
    pub status: u64,
    /// Of the solver.
    pub iterations: u64,
    /// Blocks of memory it asked for; nothing where the program does not count them.
    pub allocations: Option<u64>,
    /// What it took in each round \[ns\].
    pub rounds_ns: Vec<u64>,
}

impl Step {
    /// The time of this step \[ns\].
    pub fn time_ns(&self) -> u64 {
        median(&self.rounds_ns)
    }
}

impl Samples {
    /// Every single time as a table for other programs.
    pub fn to_csv(&self) -> String {
        let mut csv = "sequence,solver,tick,status,iterations,round,ns\n".to_owned();
        for Series { sequence, solver, steps } in &self.series {
            for Step { tick, status, iterations, rounds_ns, .. } in steps {
                for (round, ns) in rounds_ns.iter().enumerate() {
                    let _ = writeln!(csv, "{sequence},{solver},{tick},{status},{iterations},{round},{ns}"); // a String
                }
            }
        }
        csv
    }
}

/// Times every step of `sequences` with each solver, `rounds` times.
pub fn sample(sequences: &[Sequence], rounds: u32) -> Samples {
    let each = || sequences.iter().flat_map(|sequence| SOLVERS.map(|solver| (sequence, solver)));
    let mut series: Vec<Series> = each().map(|(sequence, (solver, name))| look(sequence, solver, name)).collect();
    let mut longest_stall_ns = 0;
    for _ in 0..rounds {
        for ((sequence, (solver, _)), series) in each().zip(&mut series) {
            let mut mpc = AttitudeMpc::new(&sequence.scenario_for(solver));
            let mut total_ns = CANARY_NS;
            for ((state, reference), step) in sequence.samples.iter().zip(&mut series.steps) {
                let (_, ns) = timed(|| black_box(mpc.step(state.stamp.tick, black_box(state), black_box(reference))));
                step.rounds_ns.push(ns);
                total_ns += ns;
            }
            longest_stall_ns = longest_stall_ns.max(watch(total_ns));
        }
    }
    Samples { series, longest_stall_ns }
}

/// What two readings of the clock take, one after the other: part of every time told here \[ns\].
pub fn clock_ns() -> u64 {
    median(&[(); 10_000].map(|()| timed(|| ()).1))
}

/// The floor under every step: the bare matrix-vector product, as the controller does it \[ns\].
pub fn floor_ns(gain: &DMatrix<f64>, given: &DVector<f64>) -> f64 {
    const PRODUCTS: u32 = 1000;
    let mut plan = DVector::zeros(gain.nrows());
    let mut batch = || {
        for _ in 0..PRODUCTS {
            plan.gemv(1.0, black_box(gain), black_box(given), 0.0);
            black_box(&plan);
        }
    };
    median(&[(); 101].map(|()| timed(&mut batch).1)) as f64 / f64::from(PRODUCTS)
}

/// A first pass, untimed: what each step is, and what it allocates.
fn look(sequence: &Sequence, solver: Solver, name: &'static str) -> Series {
    let mut mpc = AttitudeMpc::new(&sequence.scenario_for(solver));
    let counts = allocations_of(|| black_box(Box::new(0_u8))).1 > 0;
    let look = |(state, reference): &(State, Reference)| {
        let (controls, allocations) = allocations_of(|| mpc.step(state.stamp.tick, state, reference));
        Step {
            tick: reference.stamp.tick,
            status: controls.status,
            iterations: controls.iterations,
            allocations: counts.then_some(allocations),
            rounds_ns: vec![],
        }
    };
    Series { sequence: sequence.name.clone(), solver: name, steps: sequence.samples.iter().map(look).collect() }
}

/// How often `work` asked for memory. The program's allocator counts for all threads; here there is but one.
fn allocations_of<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let region = Region::new(&INSTRUMENTED_SYSTEM);
    let result = work();
    let change = region.change();
    (result, (change.allocations + change.reallocations) as u64)
}

/// Reads the clock for `duration_ns` and does nothing else; the longest time between two readings \[ns\].
fn watch(duration_ns: u64) -> u64 {
    let start_ns = now_ns();
    let (mut last_ns, mut longest_ns) = (start_ns, 0);
    while last_ns - start_ns < duration_ns {
        let now = now_ns();
        longest_ns = longest_ns.max(now - last_ns);
        last_ns = now;
    }
    longest_ns
}
