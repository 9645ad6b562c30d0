//! `status` for people: a line for the stack, one for each node, for each fault at work, and for what happened last.

use std::fmt::Write;

use contract::scenario::Fault;
use serde_json::Value;

use crate::faults::course;

/// One stack.
pub fn describe(view: &Value) -> String {
    let time = format!("t = {:.2} s of {:.0} s", number(&view["time_s"]), number(&view["duration_s"]));
    let [namespace, name, mode, phase] = ["namespace", "name", "mode", "phase"].map(|key| word(&view[key]));
    let pid = word(&view["launcher_pid"]);
    let mut text = format!("{namespace:<16} {name:<12} {mode:<10} {phase:<9} {time}   launcher {pid}\n");
    let mut line = |line: String| _ = writeln!(text, "  {line}"); // a String takes everything
    let nodes = list(&view["nodes"]);
    if !nodes.is_empty() {
        line(row(
            ["node", "epoch", "shadow", "pid", "ticks", "behind", "age ms", "restarts", "refused"].map(str::to_owned)
        ));
    }
    for view in nodes {
        line(node(view));
    }
    for fault in list(&view["faults"]).iter().filter_map(|fault| serde_json::from_value::<Fault>(fault.clone()).ok()) {
        line(format!("broken: {}", course(&fault, fault.at_s)));
    }
    for event in list(&view["events"]) {
        let epoch = if event["epoch"] == 0 { String::new() } else { format!(" {}", event["epoch"]) };
        line(format!("{:.2} s: {}{epoch} {}", number(&event["at_s"]), word(&event["node"]), word(&event["what"])));
    }
    text
}

fn node(view: &Value) -> String {
    if view["epoch"] == 0 {
        return format!("{:<14}nobody", word(&view["node"]));
    }
    let age = format!("{:.1}", number(&view["age_ms"]));
    let shadow = if view["shadow"].is_null() { "-".into() } else { word(&view["shadow"]) };
    let [node, epoch, pid, tick, behind, restarts] =
        ["node", "epoch", "pid", "tick", "behind", "restarts"].map(|key| word(&view[key]));
    row([node, epoch, shadow, pid, tick, behind, age, restarts, refused(&view["refused"])])
}

fn row([node, epoch, shadow, pid, tick, behind, age, restarts, refused]: [String; 9]) -> String {
    format!("{node:<14}{epoch:>6}{shadow:>8}{pid:>9}{tick:>9}{behind:>8}{age:>8}{restarts:>10}   {refused}")
}

/// The causes that have happened, and how often.
fn refused(causes: &Value) -> String {
    let counts = causes.as_object().into_iter().flatten().filter(|(_, count)| **count != 0);
    let told: Vec<String> = counts.map(|(cause, count)| format!("{cause} {count}")).collect();
    if told.is_empty() { "none".into() } else { told.join(", ") }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(0.0)
}

fn word(value: &Value) -> String {
    match value {
        Value::String(word) => word.clone(),
        Value::Null => "?".into(),
        other => other.to_string(),
    }
}
