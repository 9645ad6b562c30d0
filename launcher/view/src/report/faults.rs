//! What went wrong in a flight and what was done about it: a section of the page.
//!
//! All of it comes from the summary; a flight in which nothing happened has neither.

use contract::guard::Refusal;
use serde_json::{Value, json};

use crate::draw::{DASH, any, number, table};

/// More of them are shown when they are asked for.
const MOST_EVENTS: usize = 12;

/// What the page says of faults, events and refused messages; empty where nothing happened.
#[derive(Debug, Default)]
pub struct Section {
    pub html: String,
    pub link: &'static str,
    pub hint: &'static str,
}

pub fn section(run: &Value) -> Section {
    let parts = [faults(run), events(run), refused(run)].concat();
    if parts.is_empty() {
        return Section::default();
    }
    Section {
        html: format!("<section id=\"faults\"><h2>What happened</h2>{parts}</section>"),
        link: "<a href=\"#faults\">What happened</a>",
        hint: "A tinted stretch is a fault while it acts, a vertical line an event; the lanes under the time axes name them. \
               On the paths the stretches flown under a fault are orange, with the fault’s number where it begins, and \
               events are rings.",
    }
}

/// A fault that no message shows any harm of, such as wind, has nothing to recover from.
fn faults(run: &Value) -> String {
    let row = |(number, fault): (usize, &Value)| {
        let (injected, ended) = (&fault["injected_at_s"], &fault["ended_at_s"]);
        let from = if injected.is_null() { "not struck".into() } else { number_of(injected) };
        let to = if ended.is_null() && !injected.is_null() { "the end".into() } else { number_of(ended) };
        let [detected, recovered] = match (&fault["detected_after_s"], &fault["recovered_after_s"]) {
            _ if injected.is_null() => [DASH.into(), DASH.into()],
            (Value::Null, _) => ["no message shows harm".into(), DASH.into()],
            (detected, Value::Null) => [number_of(detected), "not recovered".into()],
            (detected, recovered) => [number_of(detected), number_of(recovered)],
        };
        vec![number.to_string(), any(&fault["target"]), any(&fault["kind"]), from, to, detected, recovered]
    };
    let headings = ["fault", "target", "kind", "from [s]", "to [s]", "detected after [s]", "recovered after [s]"];
    part("", &headings, (1..).zip(list(&run["faults"])).map(row))
}

fn number_of(seconds: &Value) -> String {
    number(seconds, 2)
}

fn events(run: &Value) -> String {
    let row = |event: &Value| {
        let words = ["node", "epoch", "what", "why"].map(|key| any(&event[key]));
        [vec![number(&event["at_s"], 2)], words.into()].concat()
    };
    let table = part("", &["time [s]", "process", "incarnation", "what", "why"], list(&run["events"]).iter().map(row));
    match list(&run["events"]).len() {
        0 => String::new(),
        1..=MOST_EVENTS => format!("<h3>Events</h3>{table}"),
        count => format!("<h3>Events</h3><details><summary>{count} events</summary>{table}</details>"),
    }
}

/// Only processes that refused something.
fn refused(run: &Value) -> String {
    let causes = Refusal::ALL.map(Refusal::name);
    let some = |counts: &Value| causes.iter().any(|cause| counts[*cause].as_u64() > Some(0));
    let nodes = run["refused"].as_object().into_iter().flatten().filter(|(_, counts)| some(counts));
    let row = |(node, counts): (&String, &Value)| {
        let count = |cause| if counts[cause] == 0 { DASH.into() } else { number(&counts[cause], 0) };
        [vec![any(&json!(node))], causes.map(count).into()].concat()
    };
    let headings = [&["process"], &causes[..]].concat();
    part("Refused messages, by cause", &headings, nodes.map(row))
}

/// A table under its heading; nothing without rows.
fn part(heading: &str, headings: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let rows: Vec<_> = rows.collect();
    match (rows.is_empty(), heading) {
        (true, _) => String::new(),
        (false, "") => table(headings, rows),
        (false, heading) => format!("<h3>{heading}</h3>{}", table(headings, rows)),
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}
