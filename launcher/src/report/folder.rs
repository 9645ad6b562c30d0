//! From a run's folder to its page: `flight.mcap` and `run.json` in, `report.html` out.

use std::io::ErrorKind;
use std::path::Path;

use anyhow::Context;
use contract::file::{self, LARGEST_RESULTS};
use contract::{Topic, scenario};
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
    let run_json = folder.join("run.json");
    let run = match file::read_text(&run_json, LARGEST_RESULTS) {
        Ok(text) => serde_json::from_str(&text).with_context(|| format!("{} is not JSON", run_json.display()))?,
        Err(error) if error.kind() == ErrorKind::NotFound => summary_of(&log, &scenario),
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", run_json.display())),
    };
    let flight =
        Flight { states: &log.states, references: &log.references, controls: &log.controls, actuators: &log.actuators };
    write_whole(&folder.join("report.html"), render(&flight, &run, &scenario).as_bytes())
}

fn summary_of(log: &Log, scenario: &contract::Scenario) -> Value {
    let mut summary = Summary::new(scenario);
    tick_by_tick(log).for_each(|record| summary.observe(&record));
    let ended = Ended::Lost("the launcher (no run.json; this summary is made from the log)".into());
    let wall_s = f64::NAN; // unknown, and shown as such
    let events = log.events.clone();
    let how = Circumstances { ended, wall_s, log: None, provenance: Value::Null, events, refused: vec![] };
    run_json(&summary, scenario, &how)
}

/// Every message, in the order in which the ring turned.
fn tick_by_tick(log: &Log) -> impl Iterator<Item = Record> {
    let ticks = |ticks: &mut dyn Iterator<Item = u64>, topic: Topic| -> Vec<_> {
        ticks.enumerate().map(|(i, tick)| (tick, topic as usize, i)).collect()
    };
    let mut order = ticks(&mut log.states.iter().map(|m| m.stamp.tick), Topic::State);
    order.extend(ticks(&mut log.references.iter().map(|m| m.stamp.tick), Topic::Reference));
    order.extend(ticks(&mut log.controls.iter().map(|m| m.stamp.tick), Topic::Controls));
    order.extend(ticks(&mut log.actuators.iter().map(|m| m.stamp.tick), Topic::Actuators));
    order.sort_unstable();
    order.into_iter().map(|(_, topic, i)| match Topic::ALL[topic] {
        Topic::State => log.states[i].into(),
        Topic::Reference => log.references[i].into(),
        Topic::Controls => log.controls[i].into(),
        Topic::Actuators => log.actuators[i].into(),
    })
}
