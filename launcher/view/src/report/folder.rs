//! What a run left behind: `flight.mcap` with the parts beside it and `run.json` in, `report.html` out.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::file::{self, LARGEST_RESULTS};
use contract::{Scenario, scenario};
use serde_json::Value;

use super::{Flight, render};
use crate::run_record::{Circumstances, run_json};
use crate::summary::Summary;
use flight::files::write_whole;
use flight::log::{self, Count, Log};
use flight::recorder::LogOutcome;
use flight::stack::Ended;

/// A run, read back.
pub struct Recorded {
    /// Its log file; the first, where several recorders wrote.
    pub path: PathBuf,
    /// All that was logged.
    pub log: Log,
    /// The settings in the log.
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
        let run = match file::read_text(&summary, LARGEST_RESULTS) {
            Ok(text) => serde_json::from_str(&text).with_context(|| format!("{} is not JSON", summary.display()))?,
            Err(error) if error.kind() == ErrorKind::NotFound => summary_of(&log, &scenario),
            Err(error) => return Err(error).with_context(|| format!("cannot read {}", summary.display())),
        };
        Ok(Self { path, log, scenario, run })
    }

    /// The messages of the log.
    pub fn flight(&self) -> Flight<'_> {
        let log = &self.log;
        Flight { states: &log.states, references: &log.references, controls: &log.controls, actuators: &log.actuators }
    }

    /// For people: what of the log is missing, if anything is.
    pub fn missing(&self) -> Option<String> {
        let defect = self.log.defect.as_ref()?;
        let path = self.path.display();
        let last_s = self.log.states.last().map_or(0.0, |state| state.stamp.tick as f64 * self.scenario.sample_s());
        let mut count = Count::default();
        let lost: u64 = self.log.tick_by_tick().filter_map(|record| count.gap(&record)).fold(0, u64::saturating_add);
        Some(format!(
            "the log {path} is not whole ({defect}): what was read ends at {last_s:.2} s, {lost} messages before that are \
             missing"
        ))
    }
}

/// Writes `report.html` of the run in `folder`; returns what of its log is missing, for people.
pub fn rewrite(folder: &Path) -> anyhow::Result<Option<String>> {
    let recorded = Recorded::read(folder)?;
    let page = render(&recorded.flight(), &recorded.run, &recorded.scenario);
    write_whole(&recorded.path.with_file_name("report.html"), page.as_bytes())?;
    Ok(recorded.missing())
}

fn summary_of(log: &Log, scenario: &Scenario) -> Value {
    let mut summary = Summary::new(scenario);
    let mut records = log.events.len() as u64;
    log.tick_by_tick().for_each(|record| {
        records += 1;
        summary.observe(&record);
    });
    let ended = Ended::Lost("the launcher (no run.json; this summary is made from the log)".into());
    let wall_s = f64::NAN; // unknown, and shown as such
    let outcome = LogOutcome { records, dropped: summary.missed(), error: log.defect.clone() };
    let (events, log) = (log.events.clone(), Some(outcome));
    let (refused, port_failures) = (vec![], vec![]);
    let how = Circumstances { ended, wall_s, log, provenance: Value::Null, events, refused, port_failures };
    run_json(&summary, scenario, &how)
}
