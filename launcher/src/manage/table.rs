//! Text of `status`: a line for the stack, and one for each node, each active fault and each of the last events.

use std::fmt::Write;

use serde_json::Value;
use settings::Fault;

use outcome::faults::course;

/// Width of a terminal \[columns\].
const WIDTH: usize = 80;

/// Returns the lines of one stack.
pub fn describe(view: &Value) -> String {
    let mut text = String::new();
    let mut line = |line: String| _ = writeln!(text, "{}", fit(&line)); // writing to a String never fails
    let time = format!("t = {:.2} s of {:.0} s", number(&view["time_s"]), number(&view["duration_s"]));
    let [namespace, name, mode, phase] = ["namespace", "name", "mode", "phase"].map(|key| word(&view[key]));
    line(format!("{namespace}: {name}, {mode}, {phase}, {time}, launcher {}", word(&view["launcher_pid"])));
    if let Some(error_m) = view["position_error_m"].as_f64() {
        let misses: u64 = list(&view["nodes"]).iter().filter_map(|node| node["misses"].as_u64()).sum();
        let mixer = word(&view["mixer"]);
        line(format!("  position error {error_m:.3} m   mixer: {mixer}   deadlines missed: {misses}"));
    }
    let nodes = list(&view["nodes"]);
    if !nodes.is_empty() {
        let head = ["node", "epoch", "standby", "pid", "ticks", "behind", "age ms", "misses", "restarts"];
        line(row(&head.map(str::to_owned)));
    }
    for view in nodes {
        line(node(view));
    }
    for view in nodes {
        let causes = refused(&view["refused"]).map(|(cause, count)| format!("{cause} {count}")).collect::<Vec<_>>();
        if !causes.is_empty() {
            line(format!("  {} refused: {}", word(&view["node"]), causes.join(", ")));
        }
    }
    for fault in list(&view["faults"]).iter().filter_map(|fault| serde_json::from_value::<Fault>(fault.clone()).ok()) {
        line(format!("  broken: {}", course(&fault, fault.at_s)));
    }
    for event in list(&view["events"]) {
        let epoch = if event["epoch"] == 0 { String::new() } else { format!(" {}", event["epoch"]) };
        line(format!("  {:.2} s: {}{epoch} {}", number(&event["at_s"]), word(&event["node"]), word(&event["what"])));
    }
    text
}

fn node(view: &Value) -> String {
    if view["epoch"] == 0 {
        return format!("  {:<13}vacant", word(&view["node"]));
    }
    let age = format!("{:.1}", number(&view["age_ms"]));
    let standby = if view["standby"].is_null() { "-".into() } else { word(&view["standby"]) };
    let [node, epoch, pid, tick, behind, misses, restarts] =
        ["node", "epoch", "pid", "tick", "behind", "misses", "restarts"].map(|key| word(&view[key]));
    row(&[node, epoch, standby, pid, tick, behind, age, misses, restarts])
}

/// Returns the cells as one line, each with a blank before it.
fn row(cells: &[String; 9]) -> String {
    const WIDTHS: [usize; 9] = [12, 5, 7, 7, 8, 6, 7, 6, 8];
    let first = |cell: &String| format!(" {cell:<12}");
    let rest = cells.iter().zip(WIDTHS).skip(1).map(|(cell, width)| format!(" {cell:>width$}"));
    cells.first().map(first).into_iter().chain(rest).collect()
}

/// Returns the causes that have occurred, with their counts.
fn refused(causes: &Value) -> impl Iterator<Item = (&str, u64)> {
    let counts = causes.as_object().into_iter().flatten();
    counts.filter_map(|(cause, count)| Some((cause.as_str(), count.as_u64().filter(|count| *count > 0)?)))
}

/// Cuts a line to the width of a terminal; `...` marks the cut.
fn fit(line: &str) -> String {
    if line.chars().count() <= WIDTH {
        return line.to_owned();
    }
    line.chars().take(WIDTH - 3).chain("...".chars()).collect()
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

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_table_fits_a_terminal_and_counts_refused_messages() {
        let node = |name: &str| {
            json!({ "node": name, "epoch": 12345, "standby": 12346, "pid": 4_194_304, "tick": 17_280_000, "behind": 123,
                "age_ms": 10123.4, "misses": 999_999, "restarts": 123, "refused": { "range": 5, "epoch": 0, "late": 12 } })
        };
        let event = json!({ "at_s": 86_399.99, "node": "attitude-mpc", "epoch": 12345, "what": "shm-cut-short" });
        let fault = json!({ "at_s": 1.0, "for_s": 0.123_456, "target": "attitude-mpc", "kind": "kill" });
        let view = json!({
            "namespace": "n".repeat(60), "name": "survey", "mode": "realtime", "phase": "flying", "time_s": 86_399.99,
            "duration_s": 86400.0, "position_error_m": 1.5, "mixer": "last demand held", "launcher_pid": 4_194_304, "nodes": [node("attitude-mpc"), node("plant")],
            "faults": [fault], "events": [event],
        });
        let text = describe(&view);
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        assert!(
            text.contains("attitude-mpc refused: range 5, late 12\n") || text.contains("late 12, range 5"),
            "{text}"
        );
        assert!(
            text.contains("position error 1.500 m   mixer: last demand held   deadlines missed: 1999998\n"),
            "{text}"
        );
        assert!(text.contains(" epoch standby "), "{text}");
        assert_eq!(text.lines().count(), 1 + 1 + 1 + 2 + 2 + 1 + 1, "{text}");
        assert!(text.contains("...\n") && !text.contains('\x1b'), "{text}");
    }
}
