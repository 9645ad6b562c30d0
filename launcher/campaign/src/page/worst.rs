//! Section "The worst flights": each with its values, its course, and the command that flies it again.
//!
//! Each flight is flown again for the page; a difference is an error: the program, the machine or the table has
//! changed.

use std::collections::HashSet;

use contract::scenario::Fault;
use flight::log::Record;
use guidance::Trajectory;
use outcome::ticks::{length_m, position_error_m};
use view::draw::{Course, any, courses, escape, short};

use super::data::Page;
use crate::row;
use crate::table::{Cell, Column};

/// Number of flights that are shown.
const SHOWN: usize = 10;
/// Number of points of a line, about.
const POINTS: u64 = 200;

/// Returns the section of the worst flights that did not pass; empty if all passed.
pub fn section(page: &Page, again: &str) -> anyhow::Result<String> {
    let worst = worst(page);
    if worst.is_empty() {
        return Ok(String::new());
    }
    let shown: Vec<String> = worst.iter().map(|row| one(page, *row, again)).collect::<anyhow::Result<_>>()?;
    let of_cases = if page.names.len() > 1 { " Of each case one is shown." } else { "" };
    Ok(format!(
        "<section id=\"worst\"><h2>The worst flights</h2><p>First the flights that ended early, the earliest first; \
         then the others, the largest error first.{of_cases} Where the background is shaded, a fault is active.</p>\
         {}</section>",
        shown.concat()
    ))
}

/// Rows of the flights that failed worst, the worst first; one controller of each case.
fn worst(page: &Page) -> Vec<usize> {
    let flights = page.flights;
    let (Some(errors), Some(flown), Some(outcomes)) =
        (flights.column("max_position_error_m"), flights.column("flown_s"), flights.column("outcome"))
    else {
        return vec![];
    };
    let mut failed: Vec<usize> = (0..page.rows()).filter(|row| page.passed[*row] == Some(false)).collect();
    let came_to_its_end = |row: usize| outcomes.text(row).starts_with("flown");
    failed.sort_by(|a, b| {
        let number = |column: &Column, row: usize| column.number(row).unwrap_or(f64::INFINITY);
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
fn one(page: &Page, row: usize, again: &str) -> anyhow::Result<String> {
    let (flights, number) = (page.flights, page.numbers[row]);
    let flight = page.plan.flight(number);
    let Ok(scenario) = &flight.scenario else { return Ok(String::new()) };
    let trajectory = Trajectory::new(&scenario.mission);
    let every = (scenario.ticks() / POINTS).max(1);
    let (mut error, mut roll, mut pitch, mut tilt) = (vec![], vec![], vec![], vec![]);
    row::fly_again(&flight, flights, row, |record| {
        let Record::State(state) = record else { return };
        if state.stamp.tick.is_multiple_of(every) {
            let t = state.stamp.tick as f64 * scenario.sample_s();
            error.push((t, length_m(position_error_m(trajectory.at(t).position_m, state))));
            roll.push((t, state.actual.attitude_rad[0].to_degrees()));
            pitch.push((t, state.actual.attitude_rad[1].to_degrees()));
            tilt.push((t, state.actuators.tilt_rad.to_degrees()));
        }
    })?;
    let end_s = error.last().map_or(0.0, |(t, _)| *t);
    let lasts_s = |fault: &Fault| fault.for_s.unwrap_or(if fault.is_momentary() { 0.0 } else { f64::INFINITY });
    let active: Vec<[f64; 2]> = scenario.fault.iter().map(|fault| [fault.at_s, fault.at_s + lasts_s(fault)]).collect();
    let course = |name, points| Course { name, points };
    let pictures = [
        courses("m", end_s, &[course("position error", error)], &active),
        courses("deg", end_s, &[course("roll", roll), course("pitch", pitch)], &active),
        courses("deg", end_s, &[course("tilt", tilt)], &active),
    ];
    let columns = page.plan.columns();
    let values = columns.iter().skip(1).filter_map(|(name, _)| {
        let cell = flights.column(name).map_or(Cell::None, |column| column.cell(row));
        let value = match cell {
            Cell::None => return None,
            Cell::Bool(yes) => yes.to_string(),
            Cell::Int(n) => n.to_string(),
            Cell::Real(x) => short(x),
            Cell::Text(text) => any(&text.into()),
        };
        Some(format!("<span>{} <b>{value}</b></span>", escape(name)))
    });
    let others = page.others(row);
    let told = flights.column("outcome").map_or("", |all| all.text(row));
    Ok(format!(
        "<div class=\"worst\"><h3>Flight {number}</h3><p>{}</p>{others}<p class=\"facts\">{}</p><div class=\"plots\">{}</div><p><code>{} {number}</code></p></div>",
        escape(told),
        values.collect::<String>(),
        pictures.concat(),
        escape(again)
    ))
}

impl Page<'_> {
    /// Returns the verdicts on the same case under the other controllers.
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
