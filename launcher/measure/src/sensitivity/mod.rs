//! `measure sensitivity`: how much delay, jitter and loss a controller stands, as a map.
//!
//! ```text
//! delay    a command acts so long after its sample          run.command_delay_ms
//! jitter   plus uniform 0..this, drawn for every command    run.command_jitter_ms
//! misses   a command never acts, with this probability      run.command_drop_probability
//! ```
//!
//! Every flight is flown in process, where a command would otherwise act at the very instant of its sample: the map is
//! exact, and the same on every machine. What a machine adds in real time is its age at the actuator, which is a delay
//! too: that is why its operating point can be drawn into the map.
//!
//! | module | holds |
//! |---|---|
//! | [`grid`] | the flights, and what became of each |
//! | [`cell`] | the flights of one delay, jitter and probability, taken together |
//! | [`point`] | the operating point of this machine |
//! | [`picture`] | the map as a page |
//! | [`targets`] | what is promised |

pub mod cell;
pub mod grid;
pub mod picture;
pub mod point;
pub mod targets;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use serde_json::json;

use self::cell::Cell;
use self::grid::Grid;
use self::point::Point;
use crate::findings::Findings;
use flight::duration::milliseconds;
use flight::files::write_whole;
use runtime::console::eprint_line;

/// Arguments of `measure sensitivity`.
#[derive(clap::Args)]
pub struct SensitivityArgs {
    /// Scenario to fly instead of the survey; its profile, delay, jitter and misses give way to those of the map
    pub scenario: Option<PathBuf>,
    /// Delays: 5ms, 0.01s, plain milliseconds [default: 0 to 10 ms for paper, 0 to 64 ms for robust]
    #[arg(long, value_delimiter = ',', value_name = "TIME,...", value_parser = milliseconds)]
    pub delays: Vec<f64>,
    /// Jitters
    #[arg(long, value_delimiter = ',', value_name = "TIME,...", value_parser = milliseconds,
        default_values = ["0ms", "2ms", "5ms", "10ms", "20ms"])]
    pub jitters: Vec<f64>,
    /// Probabilities that a command is lost
    #[arg(long, value_delimiter = ',', value_name = "P,...", default_values_t = [0.0, 0.1, 0.2, 0.4])]
    pub misses: Vec<f64>,
    /// Flights with different random numbers, where there are any: the worst one counts
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// A real-time run whose age at the actuator is drawn in, instead of that of five seconds flown for it
    #[arg(long)]
    pub run: Option<PathBuf>,
    /// Folder for the flights, the map and its picture [default: runs/measure-sensitivity-TIME]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Measures as the arguments say; the exit code.
pub fn measure(args: &SensitivityArgs) -> anyhow::Result<u8> {
    let grid = Grid::new(args)?;
    let out = args.out.clone().unwrap_or_else(default_folder);
    let cannot = || format!("cannot write to the folder {}; choose another with --out", out.display());
    fs::create_dir_all(&out).with_context(cannot)?;
    let point = operating_point(args, &out)?;

    eprint_line(&format!("flying {} flights", grid.scenarios.len()));
    let flights = grid.fly();
    let cells = cell::gather(&flights);
    let targets = targets::targets(args.scenario.is_none(), &cells);
    let results = json!({ "scenario": grid.name, "seeds": args.seeds, "operating_point": point, "cells": cells });
    let found = Findings::new(results, targets, false)?;
    found.save(&out, "sensitivity.json")?;
    write_whole(&out.join("sensitivity.csv"), grid::to_csv(&flights).as_bytes())?;
    let page = picture::page(&grid.name, &cells, point.as_ref());
    write_whole(&out.join("sensitivity.html"), page.as_bytes())?;
    found.conclude(args.json, &table(&cells, point.as_ref(), &out))
}

/// The point of the run that is named, or of five seconds flown now; nothing, and why, where that does not succeed.
fn operating_point(args: &SensitivityArgs, out: &Path) -> anyhow::Result<Option<Point>> {
    if let Some(run) = &args.run {
        return Point::read(run).map(Some);
    }
    eprint_line("flying 5 s in real time for the operating point");
    let point = Point::fly(&out.join("realtime"));
    Ok(point.inspect_err(|error| eprint_line(&format!("note: the map has no operating point: {error:#}"))).ok())
}

/// For people: up to which delay every flight survived, by jitter and probability of a miss.
fn table(cells: &[Cell], point: Option<&Point>, out: &Path) -> String {
    let mut text = String::new();
    for profile in cell::PROFILES {
        let cells: Vec<&Cell> = cells.iter().filter(|cell| cell.profile == profile).collect();
        let [_, jitters, misses] = cell::axes(&cells);
        let heads = misses.iter().map(|miss| format!("{:.0} % missed", miss * 100.0));
        text += &line(&format!("{} flies with up to", cell::name(profile)), heads);
        for jitter in jitters {
            let flown = misses.iter().map(|miss| last_flown(&cells, jitter, *miss));
            text += &line(&format!("  jitter {jitter} ms"), flown);
        }
        text += "\n";
    }
    let point = point.map_or("no operating point".into(), Point::describe);
    text + &format!(
        "largest delay up to which no flight was lost, and the largest error there\n{point}\nwritten to {}\n",
        out.join("sensitivity.html").display()
    )
}

fn line(head: &str, cells: impl Iterator<Item = String>) -> String {
    cells.fold(format!("{head:<28}"), |line, cell| line + &format!("{cell:>18}")) + "\n"
}

/// The last cell of a row before the first with a lost flight.
fn last_flown(row: &[&Cell], jitter_ms: f64, miss_probability: f64) -> String {
    let row = row.iter().filter(|c| c.jitter_ms == jitter_ms && c.miss_probability == miss_probability);
    let last = row.take_while(|cell| cell.lost == 0).last();
    last.and_then(|cell| Some(format!("{} ms, {:.3} m", cell.delay_ms, cell.max_position_error_m?)))
        .unwrap_or_else(|| "never".into())
}

fn default_folder() -> PathBuf {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Path::new("runs").join(format!("measure-sensitivity-{}", since_epoch.as_millis()))
}

#[cfg(test)]
mod tests;
