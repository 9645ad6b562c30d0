//! Faults, events and refusals of a flight: a section of the page.
//!
//! All data come from the summary. The section is empty for a flight in which nothing happened.

use contract::guard::Refusal;
use serde_json::{Value, json};

use crate::draw::{DASH, any, number, table};

/// Largest number of events shown unfolded.
const MOST_EVENTS: usize = 12;

/// Explanation of how the figures show them.
pub const HINT: &str = "A tinted stretch is a fault while it acts, a vertical line an event; the lanes under the time axes name them. \
     On the paths the stretches flown under a fault are orange, with the fault’s number where it begins, and \
     events are rings.";

/// Returns the section of the page; empty if nothing happened.
pub fn section(run: &Value) -> String {
    match [faults(run), events(run), refused(run)].concat() {
        parts if parts.is_empty() => parts,
        parts => format!("<section id=\"faults\"><h2>What happened</h2>{parts}</section>"),
    }
}

/// Table of the faults. A fault whose harm no message shows, such as wind, has nothing to recover from.
fn faults(run: &Value) -> String {
    let seconds = |seconds: &Value| number(seconds, 2);
    let row = |(i, fault): (usize, &Value)| {
        let (injected, ended) = (&fault["injected_at_s"], &fault["ended_at_s"]);
        let from = if injected.is_null() { "not struck".into() } else { seconds(injected) };
        let to = if ended.is_null() && !injected.is_null() { "the end".into() } else { seconds(ended) };
        let [detected, recovered] = match (&fault["detected_after_s"], &fault["recovered_after_s"]) {
            _ if injected.is_null() => [DASH.into(), DASH.into()],
            (Value::Null, _) => ["not detected".into(), DASH.into()],
            (detected, Value::Null) => [seconds(detected), "not recovered".into()],
            (detected, recovered) => [seconds(detected), seconds(recovered)],
        };
        vec![i.to_string(), any(&fault["target"]), any(&fault["kind"]), from, to, detected, recovered]
    };
    let headings = ["fault", "target", "kind", "from [s]", "to [s]", "detected after [s]", "recovered after [s]"];
    part(&headings, (1..).zip(list(&run["faults"])).map(row))
}

fn events(run: &Value) -> String {
    let row = |event: &Value| {
        let words = ["node", "epoch", "what", "why"].map(|key| any(&event[key]));
        [vec![number(&event["at_s"], 2)], words.into()].concat()
    };
    let table = part(&["time [s]", "process", "incarnation", "what", "why"], list(&run["events"]).iter().map(row));
    match list(&run["events"]).len() {
        0 => String::new(),
        1..=MOST_EVENTS => format!("<h3>Events</h3>{table}"),
        count => format!("<h3>Events</h3><details><summary>{count} events</summary>{table}</details>"),
    }
}

/// Table of the messages refused, for processes that refused any.
fn refused(run: &Value) -> String {
    let causes = Refusal::ALL.map(Refusal::name);
    let some = |counts: &Value| causes.iter().any(|cause| counts[*cause].as_u64() > Some(0));
    let nodes = run["refused"].as_object().into_iter().flatten().filter(|(_, counts)| some(counts));
    let row = |(node, counts): (&String, &Value)| {
        let count = |cause| if counts[cause] == 0 { DASH.into() } else { number(&counts[cause], 0) };
        [vec![any(&json!(node))], causes.map(count).into()].concat()
    };
    let table = part(&[&["process"], &causes[..]].concat(), nodes.map(row));
    if table.is_empty() { table } else { format!("<h3>Refused messages, by cause</h3>{table}") }
}

/// Makes a table; empty without rows.
fn part(headings: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut rows = rows.peekable();
    if rows.peek().is_none() { String::new() } else { table(headings, rows) }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}
