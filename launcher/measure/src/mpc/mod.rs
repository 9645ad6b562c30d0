//! `measure mpc`: how long a step of the controller takes, on problems that flights have met.
//!
//! | module | holds |
//! |---|---|
//! | [`problems`] | recorded sequences of problems |
//! | [`sampling`] | timing steps on a shared machine |
//! | [`distribution`], [`figures`] | percentiles, and one row per sequence, solver and path |
//! | [`matrices`] | the problems as matrices |
//! | [`agreement`] | whether both solvers find the same optimum |
//! | [`random`] | a million random problems |
//! | [`polygon`], [`compare`] | the problems for other solvers, and what those make of them |
//! | [`table`], [`targets`] | what is printed |

pub mod agreement;
pub mod compare;
pub mod distribution;
pub mod figures;
pub mod matrices;
pub mod polygon;
pub mod problems;
pub mod random;
pub mod sampling;
pub mod table;
pub mod targets;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use serde::Serialize;

use self::agreement::Agreement;
use self::compare::Rival;
use self::figures::Row;
use self::matrices::Problems;
use self::polygon::{Polygon, Solved};
use self::problems::Sequence;
use self::random::Random;
use super::Findings;
use flight::files::write_whole;
use runtime::console::eprint_line;

/// Arguments of `measure mpc`.
#[derive(clap::Args)]
pub struct MpcArgs {
    /// Flights to measure instead of those that come with the program: a flight log, or the folder of a run
    #[arg(value_name = "LOG|RUN")]
    pub flights: Vec<PathBuf>,
    /// Rounds over every flight: the time of a step is its median over them
    #[arg(long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
    /// Random problems for the active-set solver, 0 for none
    #[arg(long, default_value_t = 1_000_000)]
    pub random: u64,
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

/// All that was measured.
#[derive(Debug, Clone, Serialize)]
pub struct Results {
    /// Rounds over every sequence.
    pub rounds: u32,
    /// Rows and columns of the bare matrix-vector product, and its time \[us\].
    pub floor: (usize, usize, f64),
    /// Two readings of the clock: part of every time told \[us\].
    pub clock_us: f64,
    /// The longest time the machine took from a loop that does nothing \[us\].
    pub longest_stall_us: f64,
    /// Steps of the controller.
    pub rows: Vec<Row>,
    /// Both solvers against each other.
    pub agreement: Agreement,
    /// Random problems, unless left out.
    pub random: Option<Random>,
    /// The problems with the disc as a polygon: our own solver, and others where they were asked.
    pub rivals: Vec<Rival>,
}

/// Measures as the arguments say; the exit code.
pub fn measure(args: &MpcArgs) -> anyhow::Result<u8> {
    let out = args.out.clone().unwrap_or_else(default_folder);
    make(&out, "--out")?;
    let sequences: Vec<Sequence> = if args.flights.is_empty() {
        problems::shipped(&out)?
    } else {
        args.flights.iter().map(|path| problems::recorded(path)).collect::<Result<_, _>>()?
    };
    let results = results(args, &out, &sequences)?;
    let targets = targets::targets(&results);
    let table = format!("{}\nwritten to {}\n", table::table(&results), out.display());
    let found = Findings::new(&results, targets, false)?;
    found.save(&out, "measure.json")?;
    found.conclude(args.json, &table)
}

fn results(args: &MpcArgs, out: &Path, sequences: &[Sequence]) -> anyhow::Result<Results> {
    eprint_line(&format!("timing {} flights, {} rounds", sequences.len(), args.rounds));
    let samples = sampling::sample(sequences, args.rounds);
    write_whole(&out.join("samples.csv"), samples.to_csv().as_bytes())?;

    let problems: Vec<Problems> = sequences.iter().map(Problems::of).collect::<Result<_, _>>()?;
    let first = &problems[0];
    let floor_us = sampling::floor_ns(&first.gain, &first.ticks[0].given) / 1e3;
    let mut agreement = Agreement::default();
    for (sequence, problems) in sequences.iter().zip(&problems) {
        agreement.compare(sequence, problems);
    }
    let rivals = rivals(args, out, sequences, &problems)?;
    let random = (args.random > 0).then(|| {
        eprint_line(&format!("solving {} random problems", args.random));
        Random::solve(args.random)
    });
    Ok(Results {
        rounds: args.rounds,
        floor: (first.gain.nrows(), first.gain.ncols(), floor_us),
        clock_us: sampling::clock_ns() as f64 / 1e3,
        longest_stall_us: samples.longest_stall_ns as f64 / 1e3,
        rows: figures::rows(&samples),
        agreement,
        random,
        rivals,
    })
}

/// The polygon problems: solved by us, exported, and solved by others, as far as the arguments ask for it.
fn rivals(args: &MpcArgs, out: &Path, sequences: &[Sequence], problems: &[Problems]) -> anyhow::Result<Vec<Rival>> {
    let named = sequences.iter().zip(problems);
    let polygons: Vec<Polygon> = named.filter_map(|(s, problems)| Polygon::of(&s.name, problems)).collect();
    let max_iterations = sequences[0].scenario.mpc.max_iterations;
    let solved: Vec<Solved> = polygons.iter().map(|polygon| polygon.solve(args.rounds, max_iterations)).collect();
    let mut rivals = compare::ours(&solved);
    let folder = match (&args.export, &args.compare) {
        (Some(folder), _) => folder.clone(),
        (None, Some(_)) => out.join("problems"),
        (None, None) => return Ok(rivals),
    };
    make(&folder, "--export")?;
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

/// Makes a folder that can be written to.
fn make(folder: &Path, option: &str) -> anyhow::Result<()> {
    let probe = folder.join("measure.part");
    let made = fs::create_dir_all(folder).and_then(|()| fs::write(&probe, "")).and_then(|()| fs::remove_file(&probe));
    made.with_context(|| format!("cannot write to the folder {}; choose another with {option}", folder.display()))
}

fn default_folder() -> PathBuf {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Path::new("runs").join(format!("measure-mpc-{}", since_epoch.as_millis()))
}
