//! The timing section: the table, the histograms and the worst ticks.

use contract::Topic;
use hdrhistogram::Histogram;
use settings::Scenario;

use crate::draw::{Bars, Lane, escape, histograms, number, table, time_line};
use flight::event::name;
use outcome::percentiles::Percentiles;
use outcome::run_record::RunRecord;
use outcome::timing::{Age, EXECUTION, FIGURES, INPUT, NodeTiming, Timing, TimingRecord, WorstTick};

/// Names of the [`FIGURES`] of a node for people, and the style of the bars of those that are drawn.
const SHOWN: [(&str, Option<&str>); FIGURES.len()] = [
    ("release jitter", Some("wake")),
    ("hop", Some("wake")),
    ("execution", Some("execution")),
    ("CPU time", None),
    ("age of the input", None),
    ("response", Some("response")),
    ("response, per slot", None),
];

/// Makes the tables of the nodes' times: a short one, and one with every percentile.
pub fn tables(run: &RunRecord) -> String {
    let Some(timing) = &run.timing else {
        return "<p>Not measured: in process, one thread calls the four steps in order.</p>".into();
    };
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
    let rows = timing.by_node().map(|(of, node)| {
        let counts = &node.counts;
        let mut cells = vec![of.to_owned(), number(node.deadline_ms, 1), name(node.policy)];
        let counts = [counts.misses, counts.late, counts.slips, counts.longest_run_of_misses];
        cells.extend(counts.map(|count| count.to_string()));
        cells.extend([node.wake(), node.execution.as_ref(), node.response.as_ref()].map(in_short));
        cells
    });
    let ages = [(&timing.age_at_actuator, "commands applied"), (&timing.age_at_actuator_per_slot, "slots held")];
    let ages = ages.map(|(age, of_what)| format!("<b>{}</b> µs over {} {of_what}", in_short(Some(age)), age.n));
    let contradict = timing.clock_contradictions.iter().filter(|(_, count)| **count > 0);
    let counts: Vec<_> = contradict.map(|(node, count)| format!("{count} of {}", escape(node))).collect();
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

/// Draws histograms of the log's stamps, and the ten worst ticks of the record; empty except in real time.
pub fn pictures(timing: Option<&Timing>, run: &RunRecord, scenario: &Scenario) -> String {
    let (Some(TimingRecord { worst_ticks, .. }), Some(timing)) = (&run.timing, timing) else { return String::new() };
    if worst_ticks.is_empty() {
        return String::new();
    }
    let ticks: String = worst_ticks.iter().map(|tick| worst_tick(tick, scenario.sample_s() * 1e6)).collect();
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
    let bars = |(figure, (name, style)): (&str, (&str, Option<&'static str>))| {
        let (style, histogram) = (style?, node.figures.get(figure)?.clone());
        let caption = match figure {
            "hop" => format!("hop from {}", node.topic.upstream().publisher()),
            _ => name.to_owned(),
        };
        let deadline_ns = (figure == "response").then_some(node.deadline.deadline_ns);
        Some(Bars { caption, style, histogram, deadline_ns })
    };
    FIGURES.into_iter().zip(SHOWN).filter_map(bars).collect()
}

fn worst_tick(tick: &WorstTick, period_us: f64) -> String {
    // A tick that the plant slept through has no sample.
    let error = tick.position_error_m.map_or(String::new(), |m| format!(", position error {m:.3}&nbsp;m"));
    format!(
        "<div class=\"tick\"><p><b>{:.2} ms</b> tick {}, {:.2} s{error}</p><p class=\"hint\">{}</p>{}</div>",
        tick.late_us / 1e3,
        tick.tick,
        tick.time_s,
        escape(&tick.in_words),
        time_line(&lanes(tick, period_us))
    )
}

/// Lanes of the nodes in a worst tick, each from the release, or the silent slots before, to the publication.
fn lanes(tick: &WorstTick, period_us: f64) -> Vec<Lane> {
    let lane = |topic: Topic| {
        let name = topic.publisher();
        let cycle = tick.nodes.get(name)?;
        let here = tick.node == name;
        let waited_us = if here && tick.part == INPUT { tick.part_us } else { cycle.silent as f64 * period_us };
        let running = tick.part == EXECUTION;
        let waits = [cycle.release_us - waited_us.max(0.0), cycle.start_us];
        let runs = [cycle.start_us, cycle.publish_us];
        Some(Lane { name, waits, runs, at_fault: [here && !running, here && running] })
    };
    Topic::ALL.into_iter().filter_map(lane).collect()
}

/// Formats median, 99th percentile and maximum in us; dashes for a figure that is not there.
pub fn in_short(figure: Option<&Percentiles>) -> String {
    let at = |of: fn(&Percentiles) -> f64| number(figure.map(of), 0);
    [at(|p| p.p50_us), at(|p| p.p99_us), at(|p| p.max_us)].join(" / ")
}

fn all_percentiles(timing: &TimingRecord) -> String {
    let row = |node: &str, what: &str, p: &Percentiles| {
        let mut cells = vec![node.to_owned(), what.to_owned(), p.n.to_string()];
        cells.extend([p.p50_us, p.p90_us, p.p99_us, p.p999_us, p.max_us].map(|us| number(us, 1)));
        cells
    };
    let mut rows = Vec::new();
    for (name, node) in timing.by_node() {
        let figures = node.figures().into_iter().zip(SHOWN);
        rows.extend(figures.filter_map(|(figure, (what, _))| Some(row(name, what, figure?))));
    }
    rows.push(row("whole ring", "age, per command", &timing.age_at_actuator));
    rows.push(row("whole ring", "age, per slot", &timing.age_at_actuator_per_slot));
    table(&["node", "µs", "n", "p50", "p90", "p99", "p99.9", "max"], rows)
}
