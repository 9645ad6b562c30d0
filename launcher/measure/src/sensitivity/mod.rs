//! `measure sensitivity`: maps the tracking error over delay, jitter and loss of commands.
//!
//! ```text
//! delay    from the sample until its command acts           run.command_delay_ms
//! jitter   added, uniform from 0, drawn for each command    run.command_jitter_ms
//! misses   probability that a command never acts            run.command_drop_probability
//! ```
//!
//! Every flight is flown in process, where without these settings a command acts at the instant of its sample. So the
//! map is exact, and the same on every machine. In real time a machine adds the age at the actuator, which is a delay
//! too; so its operating point can be drawn into the map.
//!
//! | module | holds |
//! |---|---|
//! | [`map`] | the flights, grouped by delay, jitter and probability |
//! | [`point`] | the operating point of this machine |
//! | [`picture`] | the map as a page |

pub mod map;
pub mod picture;
pub mod point;

use std::path::{Path, PathBuf};

use contract::scenario::Profile;
use flight::event;
use serde_json::json;

use self::map::{Cell, Place};
use self::point::Point;
use crate::findings::{Findings, default_folder, make_folder};
use flight::duration::milliseconds;
use flight::files::write_whole;
use outcome::target::Target;
use runtime::console::eprint_line;

/// Largest error that the paper claims for its controller \[m\].
const PAPER_ERROR_M: f64 = 0.7;
/// Largest error of the shipped survey, at the edge of the map as in its middle \[m\].
const ROBUST_ERROR_M: f64 = 0.06;
/// Promises: profile, delay \[ms\], probability of a miss, largest error there \[m\]; `None` = every flight fails.
const PROMISES: [(Profile, f64, f64, Option<f64>); 4] = [
    (Profile::Paper, 4.0, 0.0, Some(PAPER_ERROR_M)),
    (Profile::Paper, 10.0, 0.0, None),
    (Profile::Robust, 58.0, 0.0, Some(ROBUST_ERROR_M)),
    (Profile::Robust, 0.0, 0.4, Some(ROBUST_ERROR_M)),
];
/// Reason why a failure is promised.
const FRAGILE: &str = "the limit is real: the reading of the paper that flies is this fragile";

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

/// Measures as the arguments say and returns the exit code.
pub fn measure(args: &SensitivityArgs) -> anyhow::Result<u8> {
    let axes = [&args.delays, &args.jitters, &args.misses].map(Vec::as_slice);
    let scenarios = map::scenarios(args.scenario.as_deref(), args.seeds, axes)?;
    let out = args.out.clone().unwrap_or_else(|| default_folder("sensitivity"));
    make_folder(&out, "--out")?;
    let point = operating_point(args, &out)?;

    eprint_line(&format!("flying {} flights", scenarios.len()));
    let flights = map::fly(&scenarios);
    let cells = map::gather(&flights);
    let targets = targets(args.scenario.is_none(), &cells);
    let name = scenarios.first().map_or("", |scenario| &scenario.name);
    let results = json!({ "scenario": name, "seeds": args.seeds, "operating_point": point, "cells": cells });
    let found = Findings::new(results, targets, false)?;
    write_whole(&out.join("sensitivity.csv"), map::to_csv(&flights).as_bytes())?;
    let page = picture::page(name, &cells, point.as_ref());
    write_whole(&out.join("sensitivity.html"), page.as_bytes())?;
    found.conclude(Some(&out), "sensitivity.json", args.json, &table(&cells, point.as_ref(), &out))
}

/// Returns the point of the given run, or of five seconds flown now; `None` and a note to the user if that flight
/// fails.
fn operating_point(args: &SensitivityArgs, out: &Path) -> anyhow::Result<Option<Point>> {
    if let Some(run) = &args.run {
        return Point::read(run).map(Some);
    }
    eprint_line("flying 5 s in real time for the operating point");
    let point = Point::fly(&out.join("realtime"));
    Ok(point.inspect_err(|error| eprint_line(&format!("note: the map has no operating point: {error:#}"))).ok())
}

/// Formats the largest delay up to which every flight survived, by jitter and probability of a miss.
fn table(cells: &[Cell], point: Option<&Point>, out: &Path) -> String {
    let mut text = String::new();
    for profile in map::PROFILES {
        let cells: Vec<&Cell> = cells.iter().filter(|cell| cell.at.profile == profile).collect();
        let [_, jitters, misses] = map::axes(&cells);
        let heads = misses.iter().map(|miss| format!("{:.0} % missed", miss * 100.0));
        text += &line(&format!("{} flies with up to", event::name(profile)), heads);
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

/// Describes the last cell of a row before the first one with a failed flight.
fn last_flown(row: &[&Cell], jitter_ms: f64, miss_probability: f64) -> String {
    let row = row.iter().filter(|c| c.at.jitter_ms == jitter_ms && c.at.miss_probability == miss_probability);
    let last = row.take_while(|cell| cell.lost == 0).last();
    last.and_then(|cell| Some(format!("{} ms, {:.3} m", cell.at.delay_ms, cell.max_position_error_m?)))
        .unwrap_or_else(|| "never".into())
}

/// Returns the promises as targets; inconclusive except for the survey.
fn targets(survey: bool, cells: &[Cell]) -> Vec<Target> {
    let promise = |(profile, delay_ms, miss_probability, limit_m): (Profile, f64, f64, Option<f64>)| {
        let place = Place { profile, delay_ms, jitter_ms: 0.0, miss_probability };
        let cell = cells.iter().find(|cell| survey && cell.at == place);
        let figure = format!("{}, {delay_ms} ms delay, {:.0} % missed", event::name(profile), miss_probability * 100.0);
        let target = if let Some(limit_m) = limit_m {
            // A failed flight counts with an infinite error.
            let error_m = cell.map(|cell| cell.max_position_error_m.unwrap_or(f64::INFINITY));
            Target::at_most(figure + ": largest error", error_m, limit_m, "m")
        } else {
            let all = cell.map(|cell| cell.flights as f64);
            let wanted = all.map_or("all".to_owned(), |all| format!("all {all}"));
            let lost = cell.map(|cell| cell.lost as f64);
            Target::when(figure + ": flights lost", lost, wanted, |lost| Some(lost) == all).noting(FRAGILE)
        };
        match cell {
            Some(_) => target,
            None if survey => target.noting("not on this map"),
            None => target.noting("promised of the survey only"),
        }
    };
    PROMISES.map(promise).into()
}

#[cfg(test)]
mod tests;
