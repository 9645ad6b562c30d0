//! Faults, events and refusals of a flight: a section of the page.
//!
//! The section is empty for a flight in which nothing happened.

use std::collections::BTreeMap;

use contract::guard::Refusal;
use flight::event::{TimedEvent, name};
use outcome::faults::FaultRecord;
use outcome::run_record::RunRecord;

use crate::draw::{DASH, escape, number, table};

/// Largest number of events shown unfolded.
const MOST_EVENTS: usize = 12;

/// Explanation of how the paths show faults and events, beyond [`HAPPENED_HINT`](crate::draw::HAPPENED_HINT).
pub const HINT: &str = " On the paths the stretches flown under a fault are orange, with the fault’s number where it begins, and \
     events are rings.";

/// Returns the section of the page; empty if nothing happened.
pub fn section(run: &RunRecord) -> String {
    match [faults(run), events(run), refused(run)].concat() {
        parts if parts.is_empty() => parts,
        parts => format!("<section id=\"faults\"><h2>What happened</h2>{parts}</section>"),
    }
}

/// Table of the faults. A fault whose harm no message shows, such as wind, has nothing to recover from.
fn faults(run: &RunRecord) -> String {
    let row = |(i, fault): (usize, &FaultRecord)| {
        let seconds = |value: Option<f64>, none: &str| value.map_or(none.into(), |value| number(value, 2));
        let FaultRecord { target, kind, injected_at_s, detected_after_s, recovered_after_s, .. } = *fault;
        let ended_at_s = fault.until_s();
        let from = seconds(injected_at_s, "not struck");
        let [to, detected, recovered] = match (injected_at_s, detected_after_s) {
            (None, _) => [DASH, DASH, DASH].map(str::to_owned),
            (_, None) => [seconds(ended_at_s, "the end"), "not detected".into(), DASH.into()],
            (_, detected) => {
                [seconds(ended_at_s, "the end"), seconds(detected, DASH), seconds(recovered_after_s, "not recovered")]
            }
        };
        let size = fault.size.as_ref().map_or(DASH.into(), |size| escape(size));
        vec![i.to_string(), target.name().into(), name(kind), size, from, to, detected, recovered]
    };
    let headings =
        ["fault", "target", "kind", "size", "from [s]", "to [s]", "detected after [s]", "recovered after [s]"];
    part(&headings, (1..).zip(&run.faults).map(row))
}

fn events(run: &RunRecord) -> String {
    let row = |timed: &TimedEvent| {
        let TimedEvent { at_s, event, .. } = timed;
        let why = event.why.as_ref().map_or(DASH.into(), |why| escape(why));
        vec![number(*at_s, 2), escape(&event.node), event.epoch.to_string(), timed.what(), why]
    };
    let table = part(&["time [s]", "process", "epoch", "what", "why"], run.events.iter().map(row));
    match run.events.len() {
        0 => String::new(),
        1..=MOST_EVENTS => format!("<h3>Events</h3>{table}"),
        count => format!("<h3>Events</h3><details><summary>{count} events</summary>{table}</details>"),
    }
}

/// Table of the messages refused, for processes that refused any.
fn refused(run: &RunRecord) -> String {
    let causes = Refusal::ALL.map(Refusal::name);
    let nodes = run.refused.iter().filter(|(_, counts)| counts.values().any(|count| *count > 0));
    let row = |(node, counts): (&String, &BTreeMap<String, u32>)| {
        let count = |cause: &str| counts.get(cause).filter(|count| **count > 0).map_or(DASH.into(), u32::to_string);
        [vec![escape(node)], causes.map(count).into()].concat()
    };
    let table = part(&[&["process"], &causes[..]].concat(), nodes.map(row));
    if table.is_empty() { table } else { format!("<h3>Refused messages, by cause</h3>{table}") }
}

/// Makes a table; empty without rows.
fn part(headings: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut rows = rows.peekable();
    if rows.peek().is_none() { String::new() } else { table(headings, rows) }
}
