//! `measure timing`: measures the latency of the stack, and of simpler programs on the same machine at the same time.
//!
//! | module | holds |
//! |---|---|
//! | [`raw`] | the runs, with their order and durations |
//! | [`rings`], [`ring_peer`] | rings of four processes that only pass a token, and a bare loop |
//! | [`timed_flights`], [`cycles`] | the stack itself, cycle by cycle |
//! | [`canary`] | a check whether the host delayed a process |
//! | [`machine`] | processors, load, processor time, and `cyclictest`, the reference for the bare loop |
//! | [`series`], [`results`] | distributions, ratios, misses |
//! | [`report`] | the tables and the targets |
//!
//! Programs that are compared run in turns. Figures of two runs are compared by their ratio in each round, and the
//! median of the ratios is judged. The canaries watch from the first run to the last.

pub mod canary;
pub mod cycles;
pub mod machine;
pub mod raw;
pub mod report;
pub mod results;
pub mod ring_peer;
pub mod rings;
pub mod series;
pub mod timed_flights;

use std::path::PathBuf;

use self::raw::{Raw, Rounds};
use self::results::TimingResults;
use self::series::MeasuredTimes;
use crate::findings::{Findings, default_folder, make_folder};
use flight::duration::seconds;
use flight::interrupts::catch_interrupts;
use folder::files::write_whole;
use view::table::Table;

#[derive(clap::Args)]
pub struct TimingArgs {
    /// Rounds of every comparison
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=100))]
    pub rounds: u8,
    /// Length of the paper's survey to fly: misses are rare, so they take long to count
    #[arg(long = "survey", value_name = "TIME", default_value = "60s", value_parser = survey)]
    pub survey_s: f64,
    /// One short round: shows that everything works, and no figure to rely on
    #[arg(long, conflicts_with_all = ["rounds", "survey_s"])]
    pub quick: bool,
    /// Folder for the histograms and the results [default: runs/measure-timing-TIME]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs the measurement and returns the exit code.
pub fn measure(args: &TimingArgs) -> anyhow::Result<u8> {
    let out = args.out.clone().unwrap_or_else(|| default_folder("timing"));
    make_folder(&out, "--out")?;
    let interrupts = catch_interrupts()?;
    let plan = if args.quick {
        Rounds::QUICK
    } else {
        Rounds { rounds: usize::from(args.rounds), paper_s: args.survey_s, ..Rounds::FULL }
    };
    let raw = Raw::measure(&plan, &interrupts)?;

    let results = TimingResults::of(&raw, plan.rounds);
    let targets = report::targets(&results);
    let tables = report::tables(&results);
    let canary = MeasuredTimes { name: "canary".into(), rounds: vec![raw.watch.late_ns()] };
    let csv = series::to_csv(raw.series().into_iter().chain([&canary]));
    let table =
        format!("{}\nwritten to {}\n", tables.iter().map(Table::text).collect::<Vec<_>>().join("\n"), out.display());
    let found = Findings::new(&results, targets, args.quick)?;
    write_whole(&out.join("histograms.csv"), csv.as_bytes())?;
    found.conclude(Some(&out), "measure.json", args.json, &table)
}

fn survey(text: &str) -> Result<f64, String> {
    let survey_s = seconds(text)?;
    if (1.0..=3600.0).contains(&survey_s) { Ok(survey_s) } else { Err("expected 1s to 1h".to_owned()) }
}
