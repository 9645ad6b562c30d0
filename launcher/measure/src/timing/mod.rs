//! `measure timing`: how late the stack is, beside what anybody could be on the same machine at the same time.
//!
//! | module | holds |
//! |---|---|
//! | [`plan`], [`raw`] | what is run, how long, in which order |
//! | [`rings`], [`station`] | rings of four processes that only pass a token, and a bare loop |
//! | [`cyclictest`] | the reference for that loop |
//! | [`one_flight`], [`cycles`] | the stack itself, turn by turn |
//! | [`canary`] | whether the host was to blame |
//! | [`machine`] | processors, load, processor time |
//! | [`costs`] | the parts of a hop by themselves |
//! | [`series`], [`results`] | distributions, ratios, misses |
//! | [`targets`], [`table`], [`page`] | what is printed and written |
//!
//! What is compared is run in turns; figures of two runs are compared by their ratio, round by round, and the median of
//! those ratios is judged. The canaries watch from the first run to the last.

pub mod canary;
pub mod costs;
pub mod cycles;
pub mod cyclictest;
pub mod machine;
pub mod one_flight;
pub mod page;
pub mod plan;
pub mod raw;
pub mod results;
pub mod rings;
pub mod series;
pub mod station;
pub mod table;
pub mod targets;

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;

use self::page::Figure;
use self::plan::Plan;
use self::raw::Raw;
use self::results::Results;
use self::series::Series;
use super::Findings;
use flight::duration::seconds;
use flight::files::write_whole;
use flight::interrupts::catch_interrupts;
use flight::provenance::host;

/// Arguments of `measure timing`.
#[derive(clap::Args)]
pub struct TimingArgs {
    /// Rounds of what is compared
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=100))]
    pub rounds: u8,
    /// How much of the paper's survey is flown: misses are rare, so they take long to count
    #[arg(long = "survey", alias = "survey-s", value_name = "TIME", default_value = "60s", value_parser = survey)]
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

/// Measures as the arguments say; the exit code.
pub fn measure(args: &TimingArgs) -> anyhow::Result<u8> {
    let out = args.out.clone().unwrap_or_else(default_folder);
    let cannot = || format!("cannot write to the folder {}; choose another with --out", out.display());
    std::fs::create_dir_all(&out).with_context(cannot)?;
    let interrupts = catch_interrupts()?;
    let plan = if args.quick { Plan::quick() } else { Plan::full(usize::from(args.rounds), args.survey_s) };
    let raw = Raw::measure(&plan, &interrupts)?;

    let results = Results::of(&raw, plan.rounds, host());
    let targets = targets::targets(&results);
    let tables = table::tables(&results);
    let canary = Series { name: "canary".into(), rounds: vec![raw.watch.late_ns()] };
    let csv = series::to_csv(raw.series().into_iter().chain([&canary]));
    let page = page::page(&results, &targets, &tables, &figures(&raw, &canary));
    let table = format!("{}\nwritten to {}\n", table::text(&tables), out.display());
    let found = Findings::new(&results, targets, args.quick)?;
    for (name, text) in [("histograms.csv", &csv), ("timing.html", &page)] {
        write_whole(&out.join(name), text.as_bytes()).with_context(cannot)?;
    }
    found.save(&out, "measure.json")?;
    found.conclude(args.json, &table)
}

fn figures<'a>(raw: &'a Raw, canary: &'a Series) -> Vec<Figure<'a>> {
    let figure = |title: &str, series| Figure { title: title.to_owned(), series };
    let mut figures = vec![figure("Wake-ups of a 1 kHz loop", vec![&raw.ours, &raw.cyclictest, canary])];
    for rings in &raw.rings {
        let title = format!("Once round the ring, {}", rings.placement.name());
        figures.push(figure(&title, [&rings.stack].into_iter().chain(&rings.others).collect()));
    }
    figures.push(figure("Age at the actuator by scheduling class", raw.policies.iter().map(|f| &f.ages).collect()));
    figures.push(figure("Age at the actuator by rate", raw.rates.iter().map(|f| &f.ages).collect()));
    figures
}

fn survey(text: &str) -> Result<f64, String> {
    let survey_s = seconds(text)?;
    if (1.0..=3600.0).contains(&survey_s) { Ok(survey_s) } else { Err("expected 1s to 1h".to_owned()) }
}

fn default_folder() -> PathBuf {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Path::new("runs").join(format!("measure-timing-{}", since_epoch.as_millis()))
}
