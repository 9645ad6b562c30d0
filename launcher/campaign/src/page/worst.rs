//! The flights that went worst: each with its values, its course, and the command that flies it again.
//!
//! They are flown again for the page. One that is not the flight of the table is an error: then the program, the machine or the
//! table is not what it was.

use flight::log::Record;
use guidance::Trajectory;
use view::draw::{DASH, any, course, escape, short};
use view::ticks::{length_m, position_error_m};

use crate::outcome::{self, Verdict};
use crate::plan::Plan;
use crate::table::{Cell, Column, Table};

/// How many are shown.
const SHOWN: usize = 10;
/// Points of a line.
const POINTS: u64 = 200;

/// The section of the worst flights that were not passed.
pub fn section(plan: &Plan, flights: &Table, again: &str) -> anyhow::Result<String> {
    let worst = worst(flights);
    if worst.is_empty() {
        return Ok(String::new());
    }
    let shown: Vec<String> = worst.iter().map(|row| one(plan, flights, *row, again)).collect::<anyhow::Result<_>>()?;
    Ok(format!(
        "<section id=\"worst\"><h2>The worst flights</h2><p>Those that did not come to their end first, the earlier the worse; then \
         by their largest error. The pictures show position error [m], roll and pitch [deg], and tilt [deg].</p>{}</section>",
        shown.concat()
    ))
}

/// The rows of the flights that failed worst, the worst first.
fn worst(flights: &Table) -> Vec<usize> {
    let (Some(verdicts), Some(errors), Some(flown), Some(outcomes)) = (
        flights.column("verdict"),
        flights.column("max_position_error_m"),
        flights.column("flown_s"),
        flights.column("outcome"),
    ) else {
        return vec![];
    };
    let mut failed: Vec<usize> =
        (0..flights.rows()).filter(|row| verdicts.text(*row) == Verdict::Failed.name()).collect();
    let came_to_its_end = |row: usize| outcomes.text(row).starts_with("flown");
    failed.sort_by(|a, b| {
        let number = |column: &Column, row: usize| column.number(row).unwrap_or(f64::INFINITY);
        let ends = came_to_its_end(*a).cmp(&came_to_its_end(*b));
        let earlier = || number(flown, *a).total_cmp(&number(flown, *b));
        let larger = || number(errors, *b).total_cmp(&number(errors, *a));
        ends.then_with(|| if came_to_its_end(*a) { larger() } else { earlier() })
    });
    failed.truncate(SHOWN);
    failed
}

/// The small report of one flight.
fn one(plan: &Plan, flights: &Table, row: usize, again: &str) -> anyhow::Result<String> {
    let number = match flights.column("flight").map(|all| all.cell(row)) {
        Some(Cell::Int(number)) => number as u64,
        _ => row as u64,
    };
    let flight = plan.flight(number);
    let Ok(scenario) = &flight.scenario else { return Ok(String::new()) };
    let trajectory = Trajectory::new(&scenario.mission);
    let every = (scenario.ticks() / POINTS).max(1);
    let (mut error, mut roll, mut pitch, mut tilt) = (vec![], vec![], vec![], vec![]);
    outcome::fly_again(&flight, flights, row, |record| {
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
    let pictures = [
        course("position error [m]", end_s, &[error]),
        course("roll, pitch [deg]", end_s, &[roll, pitch]),
        course("tilt [deg]", end_s, &[tilt]),
    ];
    let columns = plan.columns();
    let values = columns.iter().skip(1).map(|(name, _)| {
        let cell = flights.column(name).map_or(Cell::None, |column| column.cell(row));
        let value = match cell {
            Cell::None => DASH.to_owned(),
            Cell::Bool(yes) => yes.to_string(),
            Cell::Int(n) => n.to_string(),
            Cell::Real(x) => short(x),
            Cell::Text(text) => any(&text.into()),
        };
        format!("<span>{} <b>{value}</b></span>", escape(name))
    });
    let told = flights.column("outcome").map_or("", |all| all.text(row));
    Ok(format!(
        "<div class=\"worst\"><h3>Flight {number}</h3><p>{}</p><p class=\"facts\">{}</p><div class=\"plots\">{}</div><p><code>{} {number}</code></p></div>",
        escape(told),
        values.collect::<String>(),
        pictures.concat(),
        escape(again)
    ))
}
