//! Section "The worst flights": each with its values, its course, and the command that flies it again.
//!
//! Each flight is flown again for the page; a difference is an error: the program, the machine or the table has
//! changed.

use std::collections::HashSet;

use flight::log::Record;
use guidance::Trajectory;
use outcome::bounds::bounds;
use outcome::ticks::{length_m, position_error_m};
use serde_json::{Value, json};
use settings::Scenario;
use view::draw::{self, FlightColumns, HAPPENED_HINT, Plot, Series, TimePlots, escape, short};

use super::data::CampaignPage;
use crate::row;
use crate::table::{Cell, TableColumn};

/// Number of flights that are shown.
const SHOWN: usize = 10;
/// Approximate number of points of a line.
const POINTS: u64 = 200;

/// Returns the section of the worst flights that did not pass; empty if all passed.
pub fn section(page: &CampaignPage, again: &str) -> anyhow::Result<String> {
    let worst = worst(page);
    if worst.is_empty() {
        return Ok(String::new());
    }
    let shown: Vec<String> = worst.iter().map(|row| one(page, *row, again)).collect::<anyhow::Result<_>>()?;
    let of_cases = if page.names.len() > 1 { " Of each case one is shown." } else { "" };
    Ok(format!(
        "<section id=\"worst\"><h2>The worst flights</h2><p>First the flights that ended early, the earliest first; \
         then the others, the largest error first.{of_cases} {HAPPENED_HINT}</p>{}</section>",
        shown.concat()
    ))
}

/// Returns the section of the worst flights as a table, for which no flight is flown again; empty if all passed.
pub fn listed(page: &CampaignPage, again: &str) -> String {
    let worst = worst(page);
    if worst.is_empty() {
        return String::new();
    }
    let of = |row: usize| {
        let told = page.flights.column("outcome").map_or("", |all| all.text(row));
        let error = page.error.of(row).map_or(draw::DASH.to_owned(), short);
        let number = page.numbers[row];
        let controller = escape(page.names[page.controllers[row]]);
        vec![number.to_string(), controller, escape(told), error, format!("<code>{} {number}</code>", escape(again))]
    };
    let error = format!("{} [m]", page.error.words);
    let headings = ["flight", "controller", "outcome", &error, "to fly it again"];
    let table = draw::table(&headings, worst.into_iter().map(of));
    format!("<section id=\"worst\"><h2>The worst flights so far</h2>{table}</section>")
}

/// Rows of the flights that failed worst, the worst first; of flights that differ only by controller, only the worst.
fn worst(page: &CampaignPage) -> Vec<usize> {
    let flights = page.flights;
    let (Some(errors), Some(flown), Some(outcomes)) =
        (flights.column("max_position_error_m"), flights.column("flown_s"), flights.column("outcome"))
    else {
        return vec![];
    };
    let mut failed: Vec<usize> = (0..page.rows()).filter(|row| page.passed[*row] == Some(false)).collect();
    let came_to_its_end = |row: usize| outcomes.text(row).starts_with("flown");
    failed.sort_by(|a, b| {
        let number = |column: &TableColumn, row: usize| column.number(row).unwrap_or(f64::INFINITY);
        let ends = came_to_its_end(*a).cmp(&came_to_its_end(*b));
        let earlier = || number(flown, *a).total_cmp(&number(flown, *b));
        let larger = || number(errors, *b).total_cmp(&number(errors, *a));
        ends.then_with(|| if came_to_its_end(*a) { larger() } else { earlier() })
    });
    let mut cases = HashSet::new();
    failed.retain(|row| cases.insert(page.case(*row)));
    failed.truncate(SHOWN);
    failed
}

/// Renders the report of one flight.
fn one(page: &CampaignPage, row: usize, again: &str) -> anyhow::Result<String> {
    let (flights, number) = (page.flights, page.numbers[row]);
    let flight = page.plan.flight(number);
    let Ok(scenario) = &flight.scenario else { return Ok(String::new()) };
    let trajectory = Trajectory::new(scenario);
    let every = (scenario.ticks() / POINTS).max(1);
    let mut values = ["error", "roll", "pitch", "tilt"].map(|name| (name, vec![]));
    let happened = row::fly_again(&flight, flights, row, |record| {
        let Record::Truth(truth) = record else { return };
        if truth.tick.is_multiple_of(every) {
            let t = truth.tick as f64 * scenario.sample_s();
            let error_m = length_m(position_error_m(trajectory.at(t).position_m, truth));
            let [roll_rad, pitch_rad, _] = truth.actual.attitude_rad;
            let angles_deg = [roll_rad, pitch_rad, truth.actuators.tilt_rad].map(f64::to_degrees);
            let all = std::iter::once(error_m).chain(angles_deg);
            values.iter_mut().zip(all).for_each(|((_, values), value)| values.push(value as f32));
        }
    })?;
    let plots = TimePlots {
        flights: vec![FlightColumns {
            rows: values[0].1.len(),
            begin_s: 0.0,
            dt_s: every as f64 * scenario.sample_s(),
            columns: values.iter().map(|(name, values)| ((*name).to_owned(), draw::column(values.clone()))).collect(),
        }],
        happened: draw::happened(&[("", &happened)]),
        lines: bound(scenario),
        plots: PLOTS.iter().map(plot).collect(),
        paths: false,
    };
    let columns = page.plan.columns();
    let settings = columns.iter().skip(1).filter_map(|(name, _)| {
        let column = flights.column(name).filter(|column| column.cell(row) != Cell::None)?;
        Some(format!("<span>{} <b>{}</b></span>", escape(name), escape(&column.word(row))))
    });
    let others = page.others(row);
    let told = flights.column("outcome").map_or("", |all| all.text(row));
    Ok(format!(
        "<div class=\"worst\"><h3>Flight {number}</h3><p>{}</p>{others}<p class=\"facts\">{}</p>{}<p><code>{} {number}</code></p></div>",
        escape(told),
        settings.collect::<String>(),
        plots.html(),
        escape(again)
    ))
}

/// Plot of a flight: title, unit, least range, and columns with their names.
type PlotOf = (&'static str, &'static str, f64, &'static [(&'static str, &'static str)]);

const PLOTS: [PlotOf; 3] = [
    ("position error", "m", 0.02, &[("position error", "error")]),
    ("attitude", "deg", 1.0, &[("roll", "roll"), ("pitch", "pitch")]),
    ("tilt", "deg", 2.0, &[("tilt", "tilt")]),
];

fn plot((title, unit, span, columns): &PlotOf) -> Plot {
    let series = columns.iter().enumerate().map(|(i, (label, column))| Series::new(label, column, 0, i));
    let of_error = *title == "position error";
    Plot {
        title: Some(title),
        unit,
        span: *span,
        floor: of_error,
        lines: of_error.then_some("error"),
        series: series.collect(),
    }
}

/// Bound of the position error.
fn bound(scenario: &Scenario) -> Value {
    let bound = bounds(scenario).max_position_error_m.filter(|bound| bound.is_finite());
    json!({ "error": bound.map(|y| json!({ "y": y, "label": "bound" })).into_iter().collect::<Value>() })
}

impl CampaignPage<'_> {
    /// Returns the verdicts on the flights that differ from this one only by their controllers.
    fn others(&self, row: usize) -> String {
        let same = |other: &usize| *other != row && self.case(*other) == self.case(row);
        let of = |passed: bool| -> Vec<String> {
            let rows = (0..self.rows()).filter(same).filter(|other| self.passed[*other] == Some(passed));
            rows.map(|other| escape(self.names[self.controllers[other]])).collect()
        };
        let told = [(true, "passed"), (false, "failed")].map(|(passed, word)| match of(passed) {
            names if names.is_empty() => String::new(),
            names => format!(" The same case {word} under {}.", names.join(", ")),
        });
        if told.concat().is_empty() { String::new() } else { format!("<p class=\"hint\">{}</p>", told.concat()) }
    }
}
