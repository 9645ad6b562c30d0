//! `report.html`: one file, no network, with the paper's figures 5 to 12 for one run, and their reference lines.
//!
//! | file | holds |
//! |---|---|
//! | `air` | wind and its estimate |
//! | `columns` | data of the figures, and their reference lines |
//! | `differences` | settings that are not the defaults |
//! | `claims` | the paper's claims and their verdicts |
//! | `costs` | cost of disturbed ticks |
//! | `estimate` | errors of the navigation unit's estimate |
//! | `happened` | faults, events, refused messages |
//! | `sections` | head, tables, settings, provenance |
//! | `steps` | response to steps of the reference |
//! | `timing` | the timing section and its pictures |
//!
//! The folder `assets/report/` holds the page's template, style and scripts, and uPlot, which draws the time plots.

mod air;
pub mod claims;
pub mod columns;
mod costs;
mod differences;
mod estimate;
mod happened;
pub(crate) mod sections;
mod steps;
#[cfg(test)]
mod tests;
mod timing;

use std::path::{Path, PathBuf};

use anyhow::ensure;
use flight::log::Record;
use folder::files::write_whole;
use replay::explain::Costs;
use settings::Scenario;

use self::claims::Reach;
use self::columns::ReportColumns;
use self::steps::Steps;
use crate::draw::{self, SCRIPTS, STYLE, UPLOT_STYLE, escape};
use outcome::recorded::{Recorded, TimeSpan};
use outcome::run_record::RunRecord;
use outcome::ticks::Joined;
use outcome::timing::Timing;

const TEMPLATE: &str = include_str!("../../assets/report/template.html");
/// Figures of the report and of the live page, drawn by [`SCRIPTS`].
pub const FIGURE_SCRIPT: &str = include_str!("../../assets/report/report.js");

/// Figures of the page, gathered message by message.
pub struct Figures {
    joined: Joined,
    columns: ReportColumns,
    reach: Reach,
    steps: Steps,
}

impl Figures {
    /// Makes the figures of the ticks from `first` on.
    pub fn new(scenario: &Scenario, first: u64) -> Self {
        let columns = ReportColumns::new(scenario, first);
        Self { joined: Joined::new(scenario, first), columns, reach: Reach::new(scenario), steps: Steps::new() }
    }

    /// Takes in the next message in the order of [`flight::log::stream`].
    pub fn observe(&mut self, record: &Record) {
        let Self { joined, columns, reach, steps } = self;
        joined.observe(record, |tick| {
            columns.observe(tick);
            reach.observe(tick);
            steps.observe(tick);
        });
    }

    fn finish(self) -> (ReportColumns, Reach, Steps) {
        let Self { mut joined, mut columns, mut reach, mut steps } = self;
        joined.finish(|tick| {
            columns.observe(tick);
            reach.observe(tick);
            steps.observe(tick);
        });
        (columns, reach, steps)
    }
}

/// Writes `report.html` of a run beside its log, or `report-FROM-TO.html` of a part of it; returns the path, and a
/// text for people if the log has gaps. `costs` finds the costs of disturbed ticks, for a whole flight only.
pub fn write(
    run: &Path,
    part: TimeSpan,
    costs: impl FnOnce(&Recorded) -> Costs,
) -> anyhow::Result<(PathBuf, Option<String>)> {
    let mut figures = None;
    let first = |scenario: &Scenario| *part.ticks(scenario.sample_s()).start();
    let each = |scenario: &Scenario, record: &Record| {
        figures.get_or_insert_with(|| Figures::new(scenario, first(scenario))).observe(record);
    };
    let mut recorded = Recorded::read_each(run, part, each)?;
    let missing = recorded.missing();
    if let Some(missing) = &missing {
        recorded.run.log.get_or_insert_default().error = Some(missing.clone()); // shown at the page's head
    }
    let Recorded { scenario, summary, run, path, .. } = &recorded;
    let flown_s = run.flown_s;
    ensure!(part.from_s <= flown_s, "the flight has nothing from {} s on: it ends at {flown_s:.2} s", part.from_s);
    let (name, of_all) = if part == TimeSpan::ALL {
        let costs = costs::section(&costs(&recorded), &run.happenings());
        ("report.html".into(), Some(OfAll { timing: summary.timing.as_ref(), costs }))
    } else {
        let to_s = part.to_s.min(summary.time_s());
        (format!("report-{:.2}-{to_s:.2}.html", part.from_s), None)
    };
    let figures = figures.unwrap_or_else(|| Figures::new(scenario, first(scenario)));
    let page = path.with_file_name(name);
    write_whole(&page, render(figures, run, scenario, of_all).as_bytes())?;
    Ok((page, missing))
}

/// Parts that only the page of a whole flight has.
struct OfAll<'a> {
    timing: Option<&'a Timing>,
    /// Section on the costs of disturbed ticks.
    costs: String,
}

/// Renders the page of one run from its messages, its record and the scenario. Orders given in flight are part of the
/// scenario if the record has them. Holes in the log are holes in the figures.
fn render(figures: Figures, run: &RunRecord, scenario: &Scenario, of_all: Option<OfAll>) -> String {
    let flown = run.scenario();
    let scenario = flown.as_ref().unwrap_or(scenario);
    let (columns, reach, steps) = figures.finish();
    let sampling = columns.sampling(scenario);
    let (claims, timing_pictures, costs) = match of_all {
        Some(OfAll { timing, costs }) => {
            let claims = claims::section(&claims::judge(run, &reach, scenario), &run.metrics, scenario);
            (claims, timing::pictures(timing, run, scenario), costs)
        }
        None => Default::default(),
    };
    let (result_class, result) = sections::result(run);
    let happened = happened::section(run);
    let [log_defect, reservations] = sections::warnings(run);
    let link = |section: &str, link: &str| if section.is_empty() { String::new() } else { link.to_owned() };
    let mut data = columns.document(scenario);
    data["happened"] = draw::happened(&[("", &run.happenings())]);
    let data = draw::in_script(&data);
    let slots = [
        ("name", escape(&run.name)),
        ("result_class", result_class.into()),
        ("ended", sections::ended(run, &result)),
        ("result", result),
        ("facts", sections::facts(run, scenario)),
        ("key_figures", sections::key_figures(run)),
        ("log_defect", log_defect),
        ("but", reservations),
        ("differences", differences::section(scenario)),
        ("claims_link", link(&claims, "<a href=\"#claims\">Claims</a>")),
        ("claims", claims),
        ("bounds", sections::bounds(run)),
        ("metrics", sections::metrics(run)),
        ("hover", sections::hover(run)),
        ("steps", steps.table()),
        ("repeat", sections::repeat(run).into()),
        ("sampling", sampling),
        ("timing", timing::tables(run)),
        ("timing_pictures", timing_pictures),
        ("estimate_link", estimate::link(scenario).into()),
        ("costs_link", link(&costs, "<a href=\"#costs\">Costs</a>")),
        ("costs", costs),
        ("faults_link", link(&happened, "<a href=\"#faults\">What happened</a>")),
        ("faults_hint", link(&happened, &[draw::HAPPENED_HINT, happened::HINT].concat())),
        ("faults", happened),
        ("settings", sections::settings(run, scenario)),
        ("provenance", sections::provenance(run)),
        ("data", data),
        ("style", [UPLOT_STYLE, STYLE].concat()),
        ("scripts", [SCRIPTS.join("\n"), FIGURE_SCRIPT.into()].join("\n")),
    ];
    fill(TEMPLATE, &slots)
}

/// Replaces every `{{slot}}` of the template in one pass, so that a value is never searched for slots itself.
///
/// A slot without a value stays as it is; a test looks for such slots.
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
