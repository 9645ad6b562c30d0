//! `measure mpc`: times the controller's steps, on problems recorded in flights.
//!
//! | module | holds |
//! |---|---|
//! | [`problems`] | recorded sequences of problems |
//! | [`steps`] | timing of the controller's steps, by sequence, solver and path |
//! | [`compare`](mod@compare) | the recorded problems for other solvers |
//!
//! Tests in `qp` and in `attitude-mpc/src/law/mpc/solver/tests.rs` check that the solvers find the optimum.

pub mod compare;
pub mod problems;
pub mod steps;

use std::path::PathBuf;

use flight::event::name;
use folder::files::write_whole;
use runtime::console::eprint_line;
use serde::Serialize;

use self::compare::{Comparison, Polygons};
use self::problems::Sequence;
use self::steps::{ALL, Path, StepTimes};
use crate::findings::{Findings, default_folder, make_folder};
use outcome::target::Target;
use view::table::{Table, cell};

/// Steps per second of the controller.
const RATE_HZ: f64 = 100.0;
/// Largest time of a step of the default solver \[us\].
const LONGEST_US: f64 = 2000.0;
/// Relative difference up to which two objectives count as equal.
const AGREES: f64 = 1e-6;

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
    /// Write the problems for other solvers, one JSON file per flight
    #[arg(long, value_name = "DIR")]
    pub export: Option<PathBuf>,
    /// Solve the same problems with DAQP, PIQP and OSQP in this Python (needs daqp piqp osqp numpy scipy)
    #[arg(long, value_name = "PYTHON")]
    pub compare: Option<PathBuf>,
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
    /// Results on the problems with the disc as a polygon: our solver, and others if the arguments ask for them.
    pub rivals: Vec<Comparison>,
}

/// Returns the exit code.
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
        rivals: compare(args, &out, &sequences)?,
    };
    let text = format!("{}\nwritten to {}\n", text(&results), out.display());
    let found = Findings::new(&results, targets(&results), false)?;
    found.conclude(Some(&out), "measure.json", args.json, &text)
}

/// Solves the polygon problems; exports them and runs other solvers on them if the arguments ask for it.
fn compare(args: &MpcArgs, out: &std::path::Path, sequences: &[Sequence]) -> anyhow::Result<Vec<Comparison>> {
    let polygons: Vec<Option<Polygons>> = sequences.iter().map(Polygons::of).collect::<Result<_, _>>()?;
    let polygons: Vec<Polygons> = polygons.into_iter().flatten().collect();
    let max_iterations = sequences[0].scenario.attitude.mpc.max_iterations;
    let solved: Vec<_> = polygons.iter().map(|polygon| polygon.solve(args.rounds, max_iterations)).collect();
    let all = solved.concat();
    let mut rivals = compare::ours(&all);
    let folder = match (&args.export, &args.compare) {
        (Some(folder), _) => folder.clone(),
        (None, Some(_)) => out.join("problems"),
        (None, None) => return Ok(rivals),
    };
    make_folder(&folder, "--export")?;
    for (i, (polygon, solved)) in polygons.iter().zip(&solved).enumerate() {
        let path = folder.join(format!("{i:02}-{}.json", polygon.name));
        write_whole(&path, polygon.to_json(solved).to_string().as_bytes())?;
    }
    if let Some(python) = &args.compare {
        eprint_line(&format!("solving the same problems with {}", python.display()));
        rivals.extend(compare::others(python, &folder, args.rounds, &all)?);
    }
    Ok(rivals)
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
    let rivals = Table::new(
        "The same problems with the disc as a polygon, limits of the moves only [us]",
        &["solver", "n", "mean", "p50", "p90", "p99", "max", "p50 active", "p99", "differs", "unsolved", "timed"],
        results.rivals.iter().map(rival_row).collect(),
    );
    format!(
        "{}floor, the bare matrix-vector product: {floor_us:.3} us\nclock, part of every time: {clock_us:.3} us\n\
         longest stall of an idle loop: {longest_stall_us:.1} us\n\n{}",
        steps.text(),
        rivals.text()
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

fn rival_row(rival: &Comparison) -> Vec<String> {
    let (all, active) = (rival.all_us, rival.constrained_us);
    let mut cells = vec![rival.solver.clone(), all.map_or(0, |d| d.n).to_string(), format!("{:.2}", rival.mean_us)];
    cells.extend(
        [all.map(|d| d.p50_us), all.map(|d| d.p90_us), all.map(|d| d.p99_us), all.map(|d| d.max_us)]
            .map(|us| cell(us, 2)),
    );
    cells.extend([active.map(|d| d.p50_us), active.map(|d| d.p99_us)].map(|us| cell(us, 1)));
    cells.push(rival.worst_difference.map_or("-".to_owned(), |difference| format!("{difference:.0e}")));
    cells.extend([rival.unsolved.to_string(), rival.timed.clone()]);
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
    targets.extend(against_daqp(&results.rivals));
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

/// Our solver against DAQP, both warm, over all problems.
fn against_daqp(rivals: &[Comparison]) -> [Target; 3] {
    let find = |name: &str| rivals.iter().find(|rival| rival.solver.starts_with(name));
    let (ours, theirs) = (find("active-set, warm"), find("daqp"));
    let agrees = theirs.is_some_and(|rival| rival.unsolved == 0 && rival.worst_difference.is_some_and(|d| d <= AGREES));
    let mean: fn(&Comparison) -> Option<f64> = |rival| Some(rival.mean_us);
    let figures = [("mean", mean), ("p50", |r| Some(r.all_us?.p50_us)), ("p99", |r| Some(r.all_us?.p99_us))];
    figures.map(|(name, of)| {
        let ratio = ours.and_then(of).zip(theirs.and_then(of)).map(|(ours, theirs)| ours / theirs);
        let figure = format!("active-set over DAQP, same problems, {name}");
        let target = Target::at_most(figure, ratio.filter(|_| agrees), 1.0, "");
        match theirs {
            None => target.noting("needs --compare PYTHON, a Python with daqp, piqp, osqp, numpy and scipy"),
            Some(_) if !agrees => target.noting("it found other optima"),
            Some(_) => target,
        }
    })
}
