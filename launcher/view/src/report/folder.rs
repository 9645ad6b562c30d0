//! What a run left behind: `flight.mcap` with the parts beside it and `run.json` in, `report.html` out.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::scenario::file::{self, MAX_RESULTS_BYTES};
use contract::{Scenario, scenario};
use serde_json::Value;

use super::render;
use crate::run_record::{Circumstances, run_json};
use crate::summary::Summary;
use flight::files::write_whole;
use flight::log::{self, Log};
use flight::recorder::LogOutcome;
use flight::stack::Ended;

pub struct Recorded {
    /// Its log file; the first, where several recorders wrote.
    pub path: PathBuf,
    pub log: Log,
    pub scenario: Scenario,
    /// Its summary. A run whose launcher was killed has a log and no run.json: then it is made from the log.
    pub run: Value,
}

impl Recorded {
    /// Reads a run from its folder, or its `flight.mcap`.
    ///
    /// # Errors
    /// When there is no log to read, or run.json is not JSON.
    pub fn read(run: &Path) -> anyhow::Result<Self> {
        let path = if run.is_dir() { run.join("flight.mcap") } else { run.to_owned() };
        let log = log::read_parts(&path)?;
        let scenario = scenario::from_merged(&log.scenario_toml, &format!("the settings in {}", path.display()))?;
        let summary = path.with_file_name("run.json");
        let run = match file::read_text(&summary, MAX_RESULTS_BYTES) {
            Ok(text) => serde_json::from_str(&text).with_context(|| format!("{} is not JSON", summary.display()))?,
            Err(error) if error.kind() == ErrorKind::NotFound => summary_of(&log, &scenario),
            Err(error) => return Err(error).with_context(|| format!("cannot read {}", summary.display())),
        };
        Ok(Self { path, log, scenario, run })
    }

    /// For people: what of the log is missing, if anything is.
    pub fn missing(&self) -> Option<String> {
        let defect = self.log.defect.as_ref()?;
        let path = self.path.display();
        let last_s = self.log.states.last().map_or(0.0, |state| state.stamp.tick as f64 * self.scenario.sample_s());
        let lost = Summary::of(&self.log, &self.scenario).missed();
        Some(format!(
            "the log {path} is not whole ({defect}): what was read ends at {last_s:.2} s, {lost} messages before that are \
             missing"
        ))
    }
}

/// Writes `report.html` of the run in `folder`; returns what of its log is missing, for people.
pub fn rewrite(folder: &Path) -> anyhow::Result<Option<String>> {
    let recorded = Recorded::read(folder)?;
    let page = render(&recorded.log, &recorded.run, &recorded.scenario);
    write_whole(&recorded.path.with_file_name("report.html"), page.as_bytes())?;
    Ok(recorded.missing())
}

/// run.json of a log.
fn summary_of(log: &Log, scenario: &Scenario) -> Value {
    let summary = Summary::of(log, scenario);
    let messages = log.states.len() + log.references.len() + log.controls.len() + log.actuators.len();
    let outcome = LogOutcome {
        records: (messages + log.events.len()) as u64,
        dropped: summary.missed(),
        error: log.defect.clone(),
    };
    let how = Circumstances {
        ended: Ended::Lost("the launcher (no run.json; this summary is made from the log)".into()),
        wall_s: f64::NAN, // unknown, and shown as such
        log: Some(outcome),
        provenance: Value::Null,
        events: log.events.clone(),
        refused: vec![],
        port_failures: vec![],
    };
    run_json(&summary, scenario, &how)
}
