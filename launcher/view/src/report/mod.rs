//! `report.html`: one file, no network, the paper's figures 5 to 12 of one run and what they are held against.
//!
//! | file | holds |
//! |---|---|
//! | `folder` | from a run's folder to its page |
//! | `columns` | the figures' data and the lines they are read against |
//! | `differences` | which settings are not the defaults |
//! | `claims` | the paper's claims and their verdicts |
//! | `faults` | what went wrong: faults, events, refused messages |
//! | `sections` | head, tables, settings, provenance |
//! | `timing` | the timing section and its pictures |
//!
//! The page itself stands in `assets/report/`: template, style, scripts, and uPlot, which draws the time plots.

mod claims;
mod columns;
mod differences;
mod faults;
mod folder;
mod sections;
#[cfg(test)]
mod tests;
mod timing;

use contract::Scenario;
use flight::log::Log;
use serde_json::{Value, json};

use crate::draw::{STYLE, escape};
use crate::happenings::Happenings;
use crate::ticks::logged;

pub use folder::{Recorded, rewrite};

const TEMPLATE: &str = include_str!("../../assets/report/template.html");
const PATH_SCRIPT: &str = include_str!("../../assets/report/path.js");
const LANE_SCRIPT: &str = include_str!("../../assets/report/lanes.js");
const PLOT_SCRIPT: &str = include_str!("../../assets/report/plots.js");
const UPLOT: &str = include_str!("../../assets/report/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("../../assets/report/uPlot.min.css");

/// The page of one run: its recorded messages, its summary (`run.json`), and the scenario it flew.
///
/// Holes in the log are holes in the figures; anything the summary lacks is a dash.
pub fn render(log: &Log, run: &Value, scenario: &Scenario) -> String {
    let ticks = logged(log, scenario);
    let (claims, claims_link) = claims::section(&claims::judge(run, &ticks, scenario));
    let (result_class, result) = sections::result(run);
    let faults = faults::section(run);
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
        ("log_defect", sections::log_defect(run)),
        ("but", sections::reservations(run)),
        ("differences", differences::section(run, scenario)),
        ("claims", claims),
        ("claims_link", claims_link.into()),
        ("bounds", sections::bounds(run)),
        ("metrics", sections::metrics(run)),
        ("repeat", sections::repeat(scenario).into()),
        ("sampling", sampling(ticks.len())),
        ("timing", timing::tables(run)),
        ("timing_pictures", timing::pictures(log, run, scenario)),
        ("faults", faults.html),
        ("faults_link", faults.link.into()),
        ("faults_hint", faults.hint.into()),
        ("settings", sections::settings(run, scenario)),
        ("provenance", sections::provenance(run)),
        ("data", data),
        ("style", [UPLOT_STYLE, STYLE].concat()),
        ("scripts", [UPLOT, PATH_SCRIPT, LANE_SCRIPT, PLOT_SCRIPT].join("\n")),
    ];
    fill(TEMPLATE, &slots)
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
