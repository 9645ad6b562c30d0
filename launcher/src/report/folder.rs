//! From a run's folder to its page: `flight.mcap` and `run.json` in, `report.html` out.

use std::fs;
use std::path::Path;

use anyhow::Context;
use contract::scenario;
use serde_json::Value;

use super::{Flight, render};
use crate::fly::write_whole;
use crate::log::{self, Log, Record};
use crate::run_record::{Circumstances, run_json};
use crate::stack::Ended;
use crate::summary::Summary;

/// Writes `report.html` of the run in `folder`.
///
/// A run whose launcher was killed has a log and no run.json: its summary is then made from the log.
pub fn rewrite(folder: &Path) -> anyhow::Result<()> {
    let path = folder.join("flight.mcap");
    let log = log::read(&path)?;
    let scenario = scenario::from_merged(&log.scenario_toml, &format!("the settings in {}", path.display()))?;
    let run = match fs::read_to_string(folder.join("run.json")) {
        Ok(text) => {
            serde_json::from_str(&text).with_context(|| format!("{} is not JSON", folder.join("run.json").display()))?
        }
        Err(_) => summary_of(&log, &scenario),
    };
    let flight =
        Flight { states: &log.states, references: &log.references, controls: &log.controls, actuators: &log.actuators };
    write_whole(&folder.join("report.html"), render(&flight, &run, &scenario).as_bytes())
}

fn summary_of(log: &Log, scenario: &contract::Scenario) -> Value {
    let mut summary = Summary::new(scenario);
    log.states.iter().for_each(|m| summary.observe(&Record::State(*m)));
    log.references.iter().for_each(|m| summary.observe(&Record::Reference(*m)));
    log.controls.iter().for_each(|m| summary.observe(&Record::Controls(*m)));
    log.actuators.iter().for_each(|m| summary.observe(&Record::Actuators(*m)));
    let ended = Ended::Lost("the launcher (no run.json; this summary is made from the log)".into());
    let wall_s = f64::NAN; // unknown, and shown as such
    run_json(&summary, scenario, &Circumstances { ended, wall_s, log: None, provenance: Value::Null })
}
