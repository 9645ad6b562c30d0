//! `measure mpc`: how long a step of the controller takes, on problems that flights have met.
//!
//! | module | holds |
//! |---|---|
//! | [`problems`] | recorded sequences of problems |
//! | [`steps`] | timing of the controller's steps, by sequence, solver and path |
//! | [`compare`] | the same problems for other solvers |
//! | [`report`] | tables and targets |
//!
//! Whether the solvers find the optimum is tested in `qp` and in `attitude-mpc/src/solver/tests.rs`.

pub mod compare;
pub mod problems;
pub mod report;
pub mod steps;

use std::path::{Path, PathBuf};

use flight::files::write_whole;
use runtime::console::eprint_line;
use serde::Serialize;

use self::compare::{Comparison, Polygons};
use self::problems::Sequence;
use self::steps::StepTimes;
use crate::findings::Findings;
use crate::findings::{default_folder, make_folder};

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
    /// Solve the same problems with DAQP, PIQP and OSQP: a Python that has them (packages daqp piqp osqp numpy scipy)
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
    /// Longest time that the machine took from a loop that does nothing \[us\].
    pub longest_stall_us: f64,
    pub rows: Vec<StepTimes>,
    /// The problems with the disc as a polygon: our solver, and others where the arguments ask for them.
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
    let samples = steps::sample(&sequences, args.rounds);
    write_whole(&out.join("samples.csv"), samples.to_csv().as_bytes())?;
    let results = MpcResults {
        rounds: args.rounds,
        floor_us: steps::floor_ns(&sequences[0])? / 1e3,
        clock_us: steps::clock_ns() as f64 / 1e3,
        longest_stall_us: samples.longest_stall_ns as f64 / 1e3,
        rows: steps::step_times(&samples),
        rivals: compare(args, &out, &sequences)?,
    };
    let text = format!("{}\nwritten to {}\n", report::text(&results), out.display());
    let found = Findings::new(&results, report::targets(&results), false)?;
    found.save(&out, "measure.json")?;
    found.conclude(args.json, &text)
}

/// Solves the polygon problems, exports them, and has others solve them, as the arguments ask.
fn compare(args: &MpcArgs, out: &Path, sequences: &[Sequence]) -> anyhow::Result<Vec<Comparison>> {
    let polygons: Vec<Option<Polygons>> = sequences.iter().map(Polygons::of).collect::<Result<_, _>>()?;
    let polygons: Vec<Polygons> = polygons.into_iter().flatten().collect();
    let max_iterations = sequences[0].scenario.mpc.max_iterations;
    let solved: Vec<_> = polygons.iter().map(|polygon| polygon.solve(args.rounds, max_iterations)).collect();
    let mut rivals = compare::ours(&solved);
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
        rivals.extend(compare::others(python, &folder, args.rounds, &solved)?);
    }
    Ok(rivals)
}
