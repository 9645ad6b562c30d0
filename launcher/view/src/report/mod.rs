//! `report.html`: one file, no network, the paper's figures 5 to 12 of one run and what they are held against.
//!
//! | file | holds |
//! |---|---|
//! | `columns` | the figures' data and the lines they are read against |
//! | `differences` | which settings are not the defaults |
//! | `claims` | the paper's claims and their verdicts |
//! | `costs` | what disturbed ticks cost |
//! | `happened` | what went wrong: faults, events, refused messages |
//! | `missing` | whether the log is all of the flight |
//! | `sections` | head, tables, settings, provenance |
//! | `timing` | the timing section and its pictures |
//!
//! The page itself stands in `assets/report/`: template, style, scripts, and uPlot, which draws the time plots.

mod claims;
mod columns;
mod costs;
mod differences;
mod happened;
mod missing;
pub(crate) mod sections;
#[cfg(test)]
mod tests;
mod timing;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use contract::scenario::file::{self, MAX_RESULTS_BYTES, MAX_TEXT_BYTES};
use contract::{Scenario, scenario};
use flight::files::write_whole;
use flight::log::{self, Log};
use flight::recorder::LogOutcome;
use flight::replay::Recording;
use flight::stack::Ended;
use serde_json::{Value, json};

use crate::draw::{STYLE, escape};
use crate::happenings::Happenings;
use crate::run_record::{Circumstances, run_json};
use crate::summary::Summary;
use crate::ticks::logged;

const TEMPLATE: &str = include_str!("../../assets/report/template.html");
const PATH_SCRIPT: &str = include_str!("../../assets/report/path.js");
const LANE_SCRIPT: &str = include_str!("../../assets/report/lanes.js");
const PLOT_SCRIPT: &str = include_str!("../../assets/report/plots.js");
const UPLOT: &str = include_str!("../../assets/report/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("../../assets/report/uPlot.min.css");

/// What a run left behind.
pub struct Recorded {
    /// Its log file; the first, where several recorders wrote.
    pub path: PathBuf,
    pub log: Log,
    pub scenario: Scenario,
    /// Its summary. A run whose launcher was killed has a log and no run.json: then it is made from the log.
    pub run: Value,
    /// Whether there is a run.json.
    pub has_summary: bool,
}

impl Recorded {
    /// Reads a run from its folder, or its `flight.mcap`.
    ///
    /// # Errors
    /// When there is no log to read, its messages or settings are those of another version, or run.json is not JSON.
    pub fn read(run: &Path) -> anyhow::Result<Self> {
        let path = if run.is_dir() { run.join("flight.mcap") } else { run.to_owned() };
        let mut log = log::read_parts(&path)?;
        let summary = path.with_file_name("run.json");
        let run: Option<Value> = match file::read_text(&summary, MAX_RESULTS_BYTES) {
            Ok(text) => {
                Some(serde_json::from_str(&text).with_context(|| format!("{} is not JSON", summary.display()))?)
            }
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => return Err(error).with_context(|| format!("cannot read {}", summary.display())),
        };
        if log.written_by.layout.is_none()
            && let Some(run) = &run
        {
            // Logs did not tell the commit when they did not tell the layout; run.json did.
            log.written_by.program.commit = run["provenance"]["git"]["commit"].as_str().map(str::to_owned);
        }
        log.written_by.check_layout().with_context(|| format!("cannot read {}", path.display()))?;
        let scenario = scenario::from_merged(&log.scenario_toml, &format!("the settings in {}", path.display()));
        let scenario = scenario.map_err(|error| match log.written_by.other_program() {
            Some(other) => anyhow!("{error}\n{other}: read the log with that program"),
            None => error.into(),
        })?;
        let has_summary = run.is_some();
        let run = run.unwrap_or_else(|| summary_of(&log, &scenario));
        Ok(Self { path, log, scenario, run, has_summary })
    }

    /// What can be flown again of it.
    ///
    /// # Errors
    /// A process cannot be flown again: its settings are not there.
    pub fn recording(&self) -> anyhow::Result<Recording> {
        let settings = self.path.with_file_name("scenario.toml");
        let text = file::read_text(&settings, MAX_TEXT_BYTES).ok();
        let settled = text.and_then(|text| scenario::from_merged(&text, &settings.display().to_string()).ok());
        Recording::new(&self.log, &self.scenario, settled.as_ref())
    }

    /// Its settings, with what was ordered while it flew where the summary tells.
    pub fn flown(&self) -> Scenario {
        differences::flown(&self.run).unwrap_or_else(|| self.scenario.clone())
    }

    /// For people: why the log is not all of the flight, if it is not.
    pub fn missing(&self) -> Option<String> {
        missing::missing(&self.path, &self.log, &self.scenario, self.has_summary.then_some(&self.run))
    }
}

/// Writes `report.html` of the run in `folder`; returns what of its log is missing, for people.
pub fn rewrite(folder: &Path) -> anyhow::Result<Option<String>> {
    let mut recorded = Recorded::read(folder)?;
    let missing = recorded.missing();
    if let Some(missing) = &missing {
        recorded.run["log"]["error"] = json!(missing); // the page says it above everything else
    }
    let costs = costs::section(recorded.recording());
    let page = render(&recorded.log, &recorded.run, &recorded.scenario, costs);
    write_whole(&recorded.path.with_file_name("report.html"), page.as_bytes())?;
    Ok(missing)
}

/// The page of one run: its recorded messages, its summary (`run.json`), the scenario it flew, and the section on what disturbed
/// ticks cost. Where the summary tells what was ordered in flight, that belongs to the scenario.
///
/// Holes in the log are holes in the figures; anything the summary lacks is a dash.
pub fn render(log: &Log, run: &Value, scenario: &Scenario, costs: String) -> String {
    let flown = differences::flown(run);
    let scenario = flown.as_ref().unwrap_or(scenario);
    let ticks = logged(log, scenario);
    let claims = claims::section(&claims::judge(run, &ticks, scenario), run);
    let (result_class, result) = sections::result(run);
    let happened = happened::section(run);
    let [log_defect, reservations] = sections::warnings(run);
    let link = |section: &str, link: &str| if section.is_empty() { String::new() } else { link.to_owned() };
    let mut data = columns::document(&ticks, scenario);
    data["happened"] = json!(Happenings::new(&run["faults"], &run["events"]));
    // Inside a script element only `<` could end it.
    let data = data.to_string().replace('<', "\\u003c");
    let slots = [
        ("name", escape(run["name"].as_str().unwrap_or(&scenario.name))),
        ("result_class", result_class.into()),
        ("ended", sections::ended(run, &result)),
        ("result", result),
        ("facts", sections::facts(run, scenario)),
        ("key_figures", sections::key_figures(run, scenario)),
        ("log_defect", log_defect),
        ("but", reservations),
        ("differences", differences::section(scenario)),
        ("claims_link", link(&claims, "<a href=\"#claims\">Claims</a>")),
        ("claims", claims),
        ("bounds", sections::bounds(run)),
        ("metrics", sections::metrics(run)),
        ("repeat", sections::repeat(run, scenario).into()),
        ("sampling", sampling(ticks.len())),
        ("timing", timing::tables(run)),
        ("timing_pictures", timing::pictures(log, run, scenario)),
        ("costs_link", link(&costs, "<a href=\"#costs\">Costs</a>")),
        ("costs", costs),
        ("faults_link", link(&happened, "<a href=\"#faults\">What happened</a>")),
        ("faults_hint", link(&happened, happened::HINT)),
        ("faults", happened),
        ("settings", sections::settings(run, scenario)),
        ("provenance", sections::provenance(run)),
        ("data", data),
        ("style", [UPLOT_STYLE, STYLE].concat()),
        ("scripts", [UPLOT, PATH_SCRIPT, LANE_SCRIPT, PLOT_SCRIPT].join("\n")),
    ];
    fill(TEMPLATE, &slots)
}

/// run.json of a log.
fn summary_of(log: &Log, scenario: &Scenario) -> Value {
    let summary = Summary::of(log, scenario);
    let messages = log.states.len() + log.references.len() + log.controls.len() + log.actuators.len();
    let records = (messages + log.events.len()) as u64;
    let outcome = LogOutcome { records, dropped: summary.missed(), error: log.defect.clone() };
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

/// Replaces every `{{slot}}` of the template in one pass, so that a value is never searched for slots itself.
///
/// A slot without a value stays as it is; a test looks for them.
fn fill(template: &str, slots: &[(&str, String)]) -> String {
    let mut parts = template.split("{{");
    let mut page = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let known = part.split_once("}}").and_then(|(slot, rest)| {
            let (_, value) = slots.iter().find(|(name, _)| *name == slot)?;
            Some([value, rest])
        });
        match known {
            Some(pieces) => page.extend(pieces),
            None => page.extend(["{{", part]),
        }
    }
    page
}

/// How the figures relate to the samples.
fn sampling(rows: usize) -> String {
    match columns::bucket(rows) {
        1 => format!("{rows} samples, each one drawn."),
        bucket => format!("{rows} samples, drawn as the smallest and the largest of every {bucket}."),
    }
}
