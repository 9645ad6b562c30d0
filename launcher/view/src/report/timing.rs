//! The timing section: the table, the histograms and the worst ticks.

use contract::{Scenario, Topic};
use hdrhistogram::Histogram;
use serde_json::Value;

use crate::draw::{Bars, DASH, Lane, any, escape, histograms, number, table, time_line};
use outcome::timing::{Age, EXECUTION, INPUT, NodeTiming, Timing};

/// Keys of a figure's percentiles in run.json, and their headings.
const PERCENTILES: [(&str, &str); 5] =
    [("p50_us", "p50"), ("p90_us", "p90"), ("p99_us", "p99"), ("p999_us", "p99.9"), ("max_us", "max")];
/// Figures of a node: key in run.json, name for people, and the style of the bars of those that are drawn.
const FIGURES: [(&str, &str, Option<&str>); 7] = [
    ("jitter", "release jitter", Some("wake")),
    ("hop", "hop", Some("wake")),
    ("execution", "execution", Some("execution")),
    ("cpu", "CPU time", None),
    ("input_age", "age of the input", None),
    ("response", "response", Some("response")),
    ("response_per_slot", "response, per slot", None),
];

/// Makes the tables of the nodes' times: one for the eye, one with every percentile.
pub fn tables(run: &Value) -> String {
    let timing = &run["timing"];
    if !timing.is_object() {
        return "<p>Not measured: in process, one thread calls the four steps in order.</p>".into();
    }
    let headings = [
        "node",
        "deadline ms",
        "policy",
        "misses",
        "late",
        "slips",
        "longest run",
        "jitter or hop",
        "execution",
        "response",
    ];
    let rows = Topic::ALL.map(|topic| {
        let node = &timing["nodes"][topic.publisher()];
        let wake = if node["jitter"].is_null() { "hop" } else { "jitter" };
        let mut cells = vec![topic.publisher().to_owned(), number(&node["deadline_ms"], 1), any(&node["policy"])];
        cells.extend(["misses", "late", "slips", "longest_run_of_misses"].map(|key| number(&node[key], 0)));
        cells.extend([wake, "execution", "response"].map(|figure| in_short(&node[figure])));
        cells
    });
    let ages =
        [("age_at_actuator", "commands applied"), ("age_at_actuator_per_slot", "slots held")].map(|(key, of_what)| {
            let age = &timing[key];
            format!("<b>{}</b> µs over {} {of_what}", in_short(age), number(&age["n"], 0))
        });
    let contradictions = timing["clock_contradictions"].as_object().into_iter().flatten();
    let contradict = contradictions.filter(|(_, count)| count.as_u64() > Some(0));
    let counts: Vec<_> = contradict.map(|(node, count)| format!("{} of {}", number(count, 0), escape(node))).collect();
    let differ = match counts.join(", ") {
        none if none.is_empty() => none,
        counts => format!(
            "<p><b>The clocks differ</b>: messages that contradict the times of others: {counts}. Times across processes \
             are not to be trusted.</p>"
        ),
    };
    format!(
        "{differ}{}<p class=\"hint\">Times: p50 / p99 / max in µs. Late: responses beyond the deadline, for which the policy says what becomes of them. Slips: periods without a \
         cycle. Misses: both. Longest run: misses one after the other.</p>\
         <p>Age at the actuator: {}.</p><details><summary>Every percentile</summary>{}</details>",
        table(&headings, rows),
        ages.join("; "),
        all_percentiles(timing)
    )
}

/// Draws histograms of the log's stamps, and the ten worst ticks of the summary; empty except in real time.
pub fn pictures(timing: Option<&Timing>, run: &Value, scenario: &Scenario) -> String {
    let worst = run["timing"]["worst_ticks"].as_array().filter(|all| !all.is_empty());
    let (Some(worst), Some(timing)) = (worst, timing) else { return String::new() };
    let ticks: String = worst.iter().map(|tick| worst_tick(tick, scenario.sample_s() * 1e6)).collect();
    let mut groups: Vec<_> = timing.nodes.iter().map(|node| (node.topic.publisher(), node_histograms(node))).collect();
    let aged = |caption: &str, histogram: &Histogram<u64>| Bars {
        caption: caption.into(),
        style: "age",
        histogram: histogram.clone(),
        deadline_ns: None,
    };
    let Age { per_command, per_slot, .. } = &timing.age;
    groups
        .push(("age at the actuator", vec![aged("per command applied", per_command), aged("per slot held", per_slot)]));
    format!(
        "<h3>Histograms</h3><p class=\"hint\">Time runs logarithmically, the same way in every picture; the height of a \
         bar is the logarithm of its count, the lowest is one. The dashed line is the deadline. In full, as \
         HdrHistogram logs, they stand in the run’s folder.</p>{}\
         <h3>The ten worst ticks</h3><p class=\"hint\">Each process from its release to its publication, in ms from the \
         sample: hollow while it waits to run, solid while it runs, orange where the delay arose. \
         A tick is as late as the largest response of its nodes, and a period more for every slot of the stall before it. \
         A stall is charged to the tick that ended it; slots that several nodes slept through are one stall.</p><div class=\"ticks\">{ticks}</div>",
        histograms(&groups, scenario.sample_ns())
    )
}

/// Histograms of a node.
fn node_histograms(node: &NodeTiming) -> Vec<Bars> {
    let bars = |(figure, name, style): (&str, &str, Option<&'static str>)| {
        let (style, histogram) = (style?, node.figures.get(figure)?.clone());
        let caption = match figure {
            "hop" => format!("hop from {}", Topic::ALL[node.topic as usize - 1].publisher()),
            _ => name.to_owned(),
        };
        let deadline_ns = (figure == "response").then_some(node.deadline.deadline_ns);
        Some(Bars { caption, style, histogram, deadline_ns })
    };
    FIGURES.into_iter().filter_map(bars).collect()
}

fn worst_tick(tick: &Value, period_us: f64) -> String {
    // A tick that the plant slept through has no sample.
    let error = match &tick["position_error_m"] {
        Value::Null => String::new(),
        error => format!(", position error {}&nbsp;m", number(error, 3)),
    };
    let late_ms = tick["late_us"].as_f64().map_or(DASH.into(), |us| format!("{:.2}", us / 1e3));
    format!(
        "<div class=\"tick\"><p><b>{late_ms} ms</b> tick {}, {} s{error}</p><p class=\"hint\">{}</p>{}</div>",
        number(&tick["tick"], 0),
        number(&tick["time_s"], 2),
        any(&tick["in_words"]),
        time_line(&lanes(tick, period_us))
    )
}

/// Lanes of the nodes in a tick of run.json, each from the release, or the silent slots before, to the publication.
fn lanes(tick: &Value, period_us: f64) -> Vec<Lane> {
    let lane = |topic: Topic| {
        let name = topic.publisher();
        let cycle = &tick["nodes"][name];
        let [release, start, publish] = ["release_us", "start_us", "publish_us"].map(|key| cycle[key].as_f64());
        let (release, start) = (release?, start?);
        let here = tick["node"] == name;
        let waited_us = if here && tick["part"] == INPUT {
            tick["part_us"].as_f64().unwrap_or(0.0)
        } else {
            cycle["silent"].as_f64().unwrap_or(0.0) * period_us
        };
        let running = tick["part"] == EXECUTION;
        let waits = [release - waited_us.max(0.0), start];
        Some(Lane { name, waits, runs: [start, publish?], at_fault: [here && !running, here && running] })
    };
    Topic::ALL.into_iter().filter_map(lane).collect()
}

fn in_short(figure: &Value) -> String {
    ["p50_us", "p99_us", "max_us"].map(|key| number(&figure[key], 0)).join(" / ")
}

fn all_percentiles(timing: &Value) -> String {
    let row = |node: &str, what: &str, figure: &Value| {
        let mut cells = vec![escape(node), what.to_owned(), number(&figure["n"], 0)];
        cells.extend(PERCENTILES.map(|(key, _)| number(&figure[key], 1)));
        cells
    };
    let mut rows = Vec::new();
    for topic in Topic::ALL {
        let node = &timing["nodes"][topic.publisher()];
        let known = FIGURES.into_iter().filter(|(key, ..)| !node[*key].is_null());
        rows.extend(known.map(|(key, what, _)| row(topic.publisher(), what, &node[key])));
    }
    rows.push(row("whole ring", "age, per command", &timing["age_at_actuator"]));
    rows.push(row("whole ring", "age, per slot", &timing["age_at_actuator_per_slot"]));
    let mut headings = vec!["node", "µs", "n"];
    headings.extend(PERCENTILES.map(|(_, heading)| heading));
    table(&headings, rows)
}
