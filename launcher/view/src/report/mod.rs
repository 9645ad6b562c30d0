//! `report.html`: one file, no network, the paper's figures 5 to 12 of one run and what they are held against.
//!
//! | file | holds |
//! |---|---|
//! | `folder` | from a run's folder to its page |
//! | `flight` | the recorded messages, joined by tick |
//! | `columns` | the figures' data and the lines they are read against |
//! | `differences` | which settings are not the defaults |
//! | `claims` | the paper's claims and their verdicts |
//! | `faults` | what went wrong: faults, events, refused messages |
//! | `sections` | head, tables, settings, provenance |
//! | `cycle_timing` | the timing section |
//! | `histograms`, `gantt` | its pictures, drawn without a script |
//! | `html` | escaping, numbers, tables |
//!
//! The page itself stands in `assets/report/`: template, style, scripts, and uPlot, which draws the time plots.

mod claims;
mod columns;
mod cycle_timing;
mod differences;
mod faults;
mod flight;
mod folder;
mod gantt;
mod histograms;
pub mod html;
mod sections;
#[cfg(test)]
mod tests;

use contract::Scenario;
use serde_json::Value;

pub use flight::{Flight, Row};
pub use folder::{Recorded, rewrite};

const TEMPLATE: &str = include_str!("../../assets/report/template.html");
const STYLE: &str = include_str!("../../assets/report/report.css");
const PATH_SCRIPT: &str = include_str!("../../assets/report/path.js");
const LANE_SCRIPT: &str = include_str!("../../assets/report/lanes.js");
const PLOT_SCRIPT: &str = include_str!("../../assets/report/plots.js");
const UPLOT: &str = include_str!("../../assets/report/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("../../assets/report/uPlot.min.css");

/// The page of one run: its recorded messages, its summary (`run.json`), and the scenario it flew.
///
/// Holes in the log are holes in the figures; anything the summary lacks is a dash.
pub fn render(log: &Flight, run: &Value, scenario: &Scenario) -> String {
    let rows = log.rows(scenario);
    let (claims, claims_link) = claims::judge(run, &rows, scenario).section();
    let (result_class, result) = sections::result(run);
    let faults = faults::section(run);
    let mut data = columns::document(&rows, scenario);
    data["happened"] = faults::happened(run);
    // Inside a script element only `<` could end it.
    let data = data.to_string().replace('<', "\\u003c");
    let slots = [
        ("name", html::escape(run["name"].as_str().unwrap_or(&scenario.name))),
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
        ("sampling", sampling(rows.len())),
        ("timing", cycle_timing::tables(run)),
        ("timing_pictures", cycle_timing::pictures(log, run, scenario)),
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
/// A slot nobody fills stays as it is, for the test to see.
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
