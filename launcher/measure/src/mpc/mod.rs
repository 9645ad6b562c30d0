//! `measure mpc`: times the controller's steps on problems recorded in flights, and the calls of the navigation unit.
//!
//! | module | holds |
//! |---|---|
//! | [`problems`] | recorded sequences of problems |
//! | [`steps`] | timing of the controller's steps, by sequence, solver and path |
//! | [`navigation`] | timing of the navigation unit, and of a tick of the plant with and without it |
//!
//! Tests in `qp` and in `attitude-mpc/src/law/mpc/solver/tests.rs` check that the solvers find the optimum.

pub mod navigation;
pub mod problems;
pub mod steps;

use std::path::PathBuf;

use flight::event::name;
use folder::files::write_whole;
use runtime::console::eprint_line;
use serde::Serialize;

use self::navigation::CallTimes;
use self::problems::Sequence;
use self::steps::{ALL, Path, StepTimes};
use crate::findings::{Findings, default_folder, make_folder};
use outcome::target::Target;
use view::table::Table;

/// Steps per second of the controller.
const RATE_HZ: f64 = 100.0;
/// Largest time of a step of the default solver \[us\].
const LONGEST_US: f64 = 2000.0;

#[derive(clap::Args)]
pub struct MpcArgs {
    /// Flights to measure instead of those that come with the program: a flight log, or the folder of a run
    #[arg(value_name = "LOG|RUN")]
    pub flights: Vec<PathBuf>,
    /// Rounds over every flight: the time of a step is its median over them
    #[arg(long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
    /// Folder for the samples and the results [default: runs/measure-mpc-TIME]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Clone, Serialize)]
pub struct MpcResults {
    pub rounds: u32,
    /// Time of the bare matrix-vector product of the explicit path \[us\].
    pub floor_us: f64,
    /// Time between two readings of the clock: part of every time here \[us\].
    pub clock_us: f64,
    /// Longest interruption of an idle loop by the machine \[us\].
    pub longest_stall_us: f64,
    pub rows: Vec<StepTimes>,
    /// Times of the navigation unit and the plant.
    pub navigation: Vec<CallTimes>,
}

/// Runs the measurement and returns the exit code.
pub fn measure(args: &MpcArgs) -> anyhow::Result<u8> {
    let out = args.out.clone().unwrap_or_else(|| default_folder("mpc"));
    make_folder(&out, "--out")?;
    let sequences: Vec<Sequence> = if args.flights.is_empty() {
        problems::shipped(&out)?
    } else {
        args.flights.iter().map(|path| problems::recorded(path)).collect::<Result<_, _>>()?
    };
    eprint_line(&format!("timing {} flights, {} rounds", sequences.len(), args.rounds));
    let (series, longest_stall_ns) = steps::sample(&sequences, args.rounds);
    write_whole(&out.join("samples.csv"), steps::to_csv(&series).as_bytes())?;
    let results = MpcResults {
        rounds: args.rounds,
        floor_us: steps::floor_ns(&sequences[0])? / 1e3,
        clock_us: steps::clock_ns() as f64 / 1e3,
        longest_stall_us: longest_stall_ns as f64 / 1e3,
        rows: steps::step_times(&series),
        navigation: navigation::times(args.rounds),
    };
    let text = format!("{}\nwritten to {}\n", text(&results), out.display());
    let found = Findings::new(&results, targets(&results), false)?;
    found.conclude(Some(&out), "measure.json", args.json, &text)
}

fn text(results: &MpcResults) -> String {
    let MpcResults { rounds, floor_us, clock_us, longest_stall_us, .. } = results;
    let steps = Table::new(
        &format!(
            "A step of the controller [us], median of {rounds} rounds, steps back to back; longest: of all rounds"
        ),
        &["flight", "controller", "path", "n", "p50", "p90", "p99", "p99.9", "max", "longest", "iter", "max"],
        results.rows.iter().map(step_row).collect(),
    );
    format!(
        "{}floor, the bare matrix-vector product: {floor_us:.3} us\nclock, part of every time: {clock_us:.3} us\n\
         longest stall of an idle loop: {longest_stall_us:.1} us\n\n{}",
        steps.text(),
        navigation::table(&results.navigation, *rounds).text()
    )
}

fn step_row(row: &StepTimes) -> Vec<String> {
    let d = row.step;
    let mut cells = vec![row.sequence.clone(), row.controller.to_owned(), name(row.path), d.n.to_string()];
    cells.extend([d.p50_us, d.p90_us, d.p99_us, d.p999_us, d.max_us].map(|us| format!("{us:.2}")));
    cells.extend([row.longest_us, row.iterations_mean].map(|value| format!("{value:.1}")));
    cells.push(row.iterations_max.to_string());
    cells
}

fn targets(results: &MpcResults) -> Vec<Target> {
    let row = |controller, path| {
        results.rows.iter().find(|r| r.sequence == ALL && r.controller == controller && r.path == path)
    };
    let explicit = || ["clarabel", "active-set"].into_iter().filter_map(|solver| row(solver, Path::Explicit));
    // Times without any solve tell nothing about the solver.
    let with_solves = |solver| row(solver, Path::Solver).and(row(solver, Path::All));
    let solves = |solver| match row(solver, Path::Solver) {
        Some(row) => format!("solves alone: p50 {:.1}, p99 {:.1} us", row.step.p50_us, row.step.p99_us),
        None => "no problem went to the solver".to_owned(),
    };
    let p99 = |row: Option<&StepTimes>| row.map(|r| r.step.p99_us);
    let (clarabel, active_set) = (with_solves("clarabel"), with_solves("active-set"));
    let explicit_p99_us = explicit().map(|r| r.step.p99_us).reduce(f64::max);
    let active_set_p50_us = active_set.map(|r| r.step.p50_us);
    let mut targets = vec![
        Target::at_most("explicit path, p99", explicit_p99_us, 5.0, "us"),
        Target::at_most("clarabel, p99", p99(clarabel), 300.0, "us").noting(solves("clarabel")),
        longest(clarabel, results.longest_stall_us),
        Target::at_most("active-set, p50", active_set_p50_us, 2.0, "us").noting(solves("active-set")),
        Target::at_most("active-set, p99", p99(active_set), 25.0, "us"),
    ];
    for solver in ["clarabel", "active-set"] {
        let row = row(solver, Path::All);
        let share = row.map(|r| r.mean_us * 1e-6 * RATE_HZ * 100.0);
        let unsolved = row.map(|r| r.unsolved as f64);
        targets.push(Target::at_most(format!("{solver}, share of one core at 100 Hz"), share, 1.0, "%"));
        targets.push(Target::at_most(format!("{solver}, steps without an optimum"), unsolved, 0.0, ""));
    }
    targets.extend(navigation::targets(&results.navigation));
    targets
}

/// Target for the longest step; inconclusive if a stall of the machine can explain it.
fn longest(row: Option<&StepTimes>, longest_stall_us: f64) -> Target {
    let longest_us = row.map(|r| r.longest_us);
    let target = Target::at_most("clarabel, the longest step of all rounds", longest_us, LONGEST_US, "us");
    let median_us = row.map_or(0.0, |r| r.longest_median_us);
    let why = format!(
        "median {median_us:.0} us; the machine took up to {longest_stall_us:.0} us from a loop that does nothing"
    );
    if median_us <= LONGEST_US && median_us + longest_stall_us > LONGEST_US { target.in_doubt(why) } else { target }
}
