//! `measure sensitivity`: maps the tracking error over delay, jitter and loss of commands.
//!
//! ```text
//! delay    from the sample until its command acts           run.command_delay_ms
//! jitter   added, uniform from 0, drawn for each command    run.command_jitter_ms
//! misses   probability that a command never acts            run.command_drop_probability
//! ```
//!
//! The flights of each profile are a campaign, `sensitivity-paper.toml` and `sensitivity-robust.toml`.
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

use anyhow::Context;

use campaign::OwnController;
use contract::scenario::Profile;
use flight::event;
use serde_json::json;
use toml::{Table, Value};

use self::map::{Cell, PROFILES};
use self::point::Point;
use crate::findings::{Findings, default_folder, make_folder};
use crate::shipped;
use flight::duration::milliseconds;
use flight::files::write_whole;
use runtime::console::eprint_line;

/// Arguments of `measure sensitivity`.
#[derive(clap::Args)]
pub struct SensitivityArgs {
    /// Scenario to fly instead of the survey; its profile, delay, jitter and misses give way to those of the map
    pub scenario: Option<PathBuf>,
    /// Delays: 5ms, 0.01s [default: 0 to 10 ms for paper, 0 to 64 ms for robust]
    #[arg(long, value_delimiter = ',', value_name = "TIME,...", value_parser = milliseconds)]
    pub delays: Vec<f64>,
    /// Jitters
    #[arg(long, value_delimiter = ',', value_name = "TIME,...", value_parser = milliseconds,
        default_values = ["0ms", "2ms", "5ms", "10ms", "20ms"])]
    pub jitters: Vec<f64>,
    /// Probabilities that a command is lost
    #[arg(long, value_delimiter = ',', value_name = "P,...", default_values_t = [0.0, 0.1, 0.2, 0.4])]
    pub misses: Vec<f64>,
    /// Flights of each cell, with different random numbers (one flight if nothing is random); the worst one counts
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// Real-time run whose age at the actuator is drawn into the map, instead of that of a new flight of five seconds
    #[arg(long)]
    pub run: Option<PathBuf>,
    /// Fly this attitude controller too, with the delays of robust: a library of yours (repeatable)
    #[arg(long, value_name = "NAME=FILE")]
    pub controller: Vec<OwnController>,
    /// Folder for the flights, the map and its picture [default: runs/measure-sensitivity-TIME]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Measures as the arguments say and returns the exit code.
pub fn measure(args: &SensitivityArgs) -> anyhow::Result<u8> {
    let edit = |text: String| args.put_into(&text);
    let all = PROFILES.map(|profile| (profile, format!("sensitivity-{}", event::name(profile))));
    let own = |profile| if profile == Profile::Robust { &args.controller[..] } else { &[] };
    for (profile, name) in &all {
        shipped::plan(name, own(*profile), edit)?.check()?;
    }
    let out = args.out.clone().unwrap_or_else(|| default_folder("sensitivity"));
    make_folder(&out, "--out")?;
    let point = operating_point(args, &out)?;
    let (mut flights, mut targets, mut title) = (vec![], vec![], String::new());
    for (profile, name) in all {
        let flown = shipped::fly_with(&name, own(profile), edit)?;
        eprint_line(&format!("flew {} flights of profile {}", flown.flights.rows(), event::name(profile)));
        flights.extend(map::flights(&flown));
        targets.extend(flown.targets());
        title = flown.plan.campaign.controllers[0].1.scenario(&[])?.name;
    }
    let cells = map::gather(&flights);
    let results = json!({ "scenario": title, "seeds": args.seeds, "operating_point": point, "cells": cells });
    let found = Findings::new(results, targets, false)?;
    write_whole(&out.join("sensitivity.csv"), map::to_csv(&flights).as_bytes())?;
    let page = picture::page(&title, &cells, point.as_ref());
    write_whole(&out.join("sensitivity.html"), page.as_bytes())?;
    let mut table = table(&cells, point.as_ref(), &out);
    if args.scenario.is_some() {
        table += "the limits are promised of the survey only\n";
    }
    found.conclude(Some(&out), "sensitivity.json", args.json, &table)
}

impl SensitivityArgs {
    /// Puts the arguments into the text of a campaign. Another scenario than the survey has no promises.
    fn put_into(&self, text: &str) -> anyhow::Result<String> {
        let mut campaign: Table = text.parse()?;
        if let Some(scenario) = &self.scenario {
            campaign.insert("scenario".into(), shipped::path_as_toml(scenario)?);
            campaign.remove("promise");
        }
        let is_random = self.jitters.iter().chain(&self.misses).any(|value| *value != 0.0);
        let seeds = is_random.then(|| Value::from((0..self.seeds as i64).collect::<Vec<_>>()));
        campaign.remove("seeds");
        campaign.extend(seeds.map(|seeds| ("seeds".to_owned(), seeds)));
        // A controller of the user flies with the guidance and the mixer of the profile, as ours does.
        let profile = campaign["controller"].as_table().and_then(|all| all.values().next()?.get("profile").cloned());
        let settings = campaign["settings"].as_table_mut().context("settings")?;
        settings.extend(profile.map(|profile| ("profile".to_owned(), profile)));
        let run = campaign["vary"]["run"].as_table_mut().context("what varies")?;
        let lists = [
            ("command_delay_ms", &self.delays),
            ("command_jitter_ms", &self.jitters),
            ("command_drop_probability", &self.misses),
        ];
        for (key, values) in lists.into_iter().filter(|(_, values)| !values.is_empty()) {
            run.insert(key.into(), map::rising(values.iter().copied()).into());
        }
        Ok(campaign.to_string())
    }
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

/// Formats the largest delay up to which every flight survived, by jitter and probability of a miss; a limit outside of
/// the flown delays is said to be there.
fn table(cells: &[Cell], point: Option<&Point>, out: &Path) -> String {
    let mut text = String::new();
    for controller in map::controllers(cells) {
        let cells: Vec<&Cell> = cells.iter().filter(|cell| cell.at.controller == controller).collect();
        let [_, jitters, misses] = map::axes(&cells);
        let heads = misses.iter().map(|miss| format!("{:.0} % missed", miss * 100.0));
        text += &line(&format!("{controller} flies with up to"), heads);
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
    cells.fold(format!("{head:<28}"), |line, cell| line + &format!("{cell:>24}")) + "\n"
}

/// Describes the last cell of a row before the first one with a failed flight: "or more" if no flight failed, because
/// then the limit is unknown.
fn last_flown(row: &[&Cell], jitter_ms: f64, miss_probability: f64) -> String {
    let row = row.iter().filter(|c| c.at.jitter_ms == jitter_ms && c.at.miss_probability == miss_probability);
    let row: Vec<&&Cell> = row.collect();
    let flown = row.iter().take_while(|cell| cell.lost == 0).count();
    let more = if flown == row.len() { " or more" } else { "" };
    let last = flown.checked_sub(1).and_then(|last| Some((row[last].at.delay_ms, row[last].max_position_error_m?)));
    match (last, row.first().map(|first| first.at.delay_ms)) {
        (Some((delay_ms, error_m)), _) => format!("{delay_ms} ms{more}, {error_m:.3} m"),
        (None, Some(first_ms)) if first_ms > 0.0 => format!("less than {first_ms} ms"),
        (None, _) => "never".into(),
    }
}

#[cfg(test)]
mod tests;
