//! What went wrong in a flight and what was done about it: a section of the page, bands and marks in the figures.
//!
//! All of it comes from the summary; a flight in which nothing happened has neither.

use contract::guard::Refusal;
use serde_json::{Value, json};

use super::html::{DASH, any, number, table};

/// What the page says of faults, events and refused messages; empty where nothing happened.
#[derive(Debug, Default)]
pub struct Section {
    /// The section itself.
    pub html: String,
    /// Its entry in the list of sections.
    pub link: &'static str,
    /// How to read it in the figures.
    pub hint: &'static str,
}

/// The section of a run.
pub fn section(run: &Value) -> Section {
    let parts = [faults(run), events(run), refused(run)].concat();
    if parts.is_empty() {
        return Section::default();
    }
    Section {
        html: format!("<section id=\"faults\"><h2>Faults</h2>{parts}</section>"),
        link: "<a href=\"#faults\">Faults</a>",
        hint: "A band is a fault while it acts, a vertical line an <a href=\"#faults\">event</a>.",
    }
}

/// When a fault acts, as spans of time \[s\]; one that lasts to the end has no second number.
pub fn bands(run: &Value) -> Value {
    let struck = list(&run["faults"]).iter().filter(|fault| fault["injected_at_s"].is_number());
    struck.map(|fault| json!([fault["injected_at_s"], fault["ended_at_s"].as_f64()])).collect()
}

/// When something happened to a process \[s\].
pub fn marks(run: &Value) -> Value {
    list(&run["events"]).iter().filter_map(|event| event["at_s"].as_f64()).collect()
}

fn faults(run: &Value) -> String {
    let row = |fault: &Value| {
        let (injected, ended) = (&fault["injected_at_s"], &fault["ended_at_s"]);
        let from = if injected.is_null() { "not struck".into() } else { number(injected, 2) };
        let to = if ended.is_null() && !injected.is_null() { "the end".into() } else { number(ended, 2) };
        let after = ["detected_after_s", "recovered_after_s"].map(|key| number(&fault[key], 2));
        [vec![any(&fault["target"]), any(&fault["kind"]), from, to], after.into()].concat()
    };
    let headings = ["target", "kind", "from [s]", "to [s]", "detected after [s]", "recovered after [s]"];
    part("", &headings, list(&run["faults"]).iter().map(row))
}

fn events(run: &Value) -> String {
    let row = |event: &Value| {
        let words = ["node", "epoch", "what", "why"].map(|key| any(&event[key]));
        [vec![number(&event["at_s"], 2)], words.into()].concat()
    };
    part("Events", &["time [s]", "process", "incarnation", "what", "why"], list(&run["events"]).iter().map(row))
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
