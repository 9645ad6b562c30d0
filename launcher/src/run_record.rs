//! `run.json`: the summary of a run, for programs.

use contract::Scenario;
use contract::guard::Refusal;
use contract::process::exit;
use contract::scenario::{Bounds, Mode};
use serde_json::{Value, json};

use crate::event::{Event, What, untried};
use crate::faults::name;
use crate::recorder::LogOutcome;
use crate::stack::{Ended, Refused};
use crate::summary::{Metrics, Summary};

/// What is known of a run besides its messages.
pub struct Circumstances {
    /// How it ended.
    pub ended: Ended,
    /// Wall time of the flight \[s\], without start and report.
    pub wall_s: f64,
    /// The recorder's last word, if there was one.
    pub log: Option<LogOutcome>,
    /// Versions, host, settings.
    pub provenance: Value,
    /// What happened.
    pub events: Vec<Event>,
    /// Messages refused, by listener and cause.
    pub refused: Refused,
}

/// Exit code of a run: the gravest of what happened.
pub fn exit_code(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> u8 {
    let log_lost = how.log.as_ref().is_some_and(|log| log.error.is_some());
    match how.ended {
        Ended::Interrupted => exit::INTERRUPTED,
        Ended::Lost(_) => exit::PROCESS_LOST,
        Ended::Late(_) => exit::BUDGET_BROKEN,
        Ended::Flown if log_lost => exit::PROCESS_LOST,
        Ended::Flown if summary.status().diverged() || untried(&how.events).is_some() => exit::OUT_OF_BOUNDS,
        Ended::Flown if verdicts(&scenario.bounds, &summary.metrics()).iter().any(|v| !v.ok) => exit::OUT_OF_BOUNDS,
        Ended::Flown => exit::FLOWN,
    }
}

/// One line on how the run ended.
pub fn describe_end(summary: &Summary, how: &Circumstances) -> String {
    let t = summary.time_s();
    match &how.ended {
        Ended::Interrupted => format!("interrupted at {t:.2} s"),
        Ended::Lost(name) => format!("lost {name} at {t:.2} s"),
        Ended::Late(name) => format!("stopped at {t:.2} s: {name} missed its deadline"),
        Ended::Flown if summary.status().diverged() => format!("diverged at {t:.2} s: {}", summary.status().describe()),
        Ended::Flown => match untried(&how.events) {
            None => format!("flown to the end, {t:.2} s"),
            Some(Event { node, why, .. }) => {
                let why = why.as_deref().unwrap_or("it could not be started");
                format!("flown to the end, {t:.2} s, without the swap of {node}: {why}")
            }
        },
    }
}

/// The whole of run.json.
pub fn run_json(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> Value {
    let metrics = summary.metrics();
    let flown_s = summary.time_s();
    json!({
        "name": scenario.name,
        "mode": scenario.run.mode,
        "profile": scenario.profile,
        "duration_s": scenario.run.duration_s,
        "flown_s": flown_s,
        "diverged": summary.status().diverged(),
        "ended": describe_end(summary, how),
        "exit_code": exit_code(summary, scenario, how),
        "metrics": metrics,
        "solver": summary.solves.to_json(),
        "state_hash": summary.state_hash(),
        "bounds": verdicts(&scenario.bounds, &metrics),
        "speed": { "wall_s": how.wall_s, "times_realtime": flown_s / how.wall_s },
        "timing": summary.timing.as_ref().map(crate::timing::Timing::to_json),
        "log": how.log,
        "unobserved": summary.missed(),
        "faults": summary.faults.to_json(),
        "events": events(scenario, &how.events),
        "refused": how.refused.iter().map(|(node, counts)| ((*node).to_owned(), refused(counts))).collect::<Value>(),
        "provenance": how.provenance,
    })
}

/// What happened, by the time of the flight.
pub fn events(scenario: &Scenario, events: &[Event]) -> Value {
    let one = |event: &Event| {
        let at_s = event.tick as f64 / f64::from(scenario.run.rate_hz);
        let mut told = json!({ "at_s": at_s, "node": event.node, "epoch": event.epoch, "what": event.what });
        if let Some(why) = &event.why {
            told["why"] = json!(why);
        }
        if let Some(swap) = event.swap {
            told["swap"] = json!(swap);
        }
        told
    };
    events.iter().map(one).collect()
}

/// Refused messages by cause.
pub fn refused(counts: &[u32; Refusal::ALL.len()]) -> Value {
    Refusal::ALL.iter().zip(counts).map(|(refusal, count)| (refusal.name().to_owned(), json!(count))).collect()
}

/// One bound of the scenario against the flight.
#[derive(Debug, serde::Serialize)]
pub struct Verdict {
    /// Which metric.
    pub metric: &'static str,
    /// What it may not exceed.
    pub limit: f64,
    /// What it was.
    pub measured: f64,
    /// Whether it was inside.
    pub ok: bool,
}

/// Every bound that the scenario sets.
pub fn verdicts(bounds: &Bounds, metrics: &Metrics) -> Vec<Verdict> {
    let all = [
        ("max_position_error_m", bounds.max_position_error_m, metrics.max_position_error_m),
        (
            "max_altitude_error_horizontal_m",
            bounds.max_altitude_error_horizontal_m,
            metrics.max_altitude_error_horizontal_m,
        ),
        ("max_altitude_error_vertical_m", bounds.max_altitude_error_vertical_m, metrics.max_altitude_error_vertical_m),
        ("final_position_error_m", bounds.final_position_error_m, metrics.final_position_error_m),
    ];
    let judged = all.into_iter().filter_map(|(metric, limit, measured)| Some((metric, limit?, measured)));
    // A metric without a sample, such as the altitude error of a leg not reached, is not judged.
    let sampled = judged.filter(|(_, _, measured)| !measured.is_nan());
    sampled.map(|(metric, limit, measured)| Verdict { metric, limit, measured, ok: measured <= limit }).collect()
}

/// For people: what the flight amounted to.
pub fn describe(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> String {
    use std::fmt::Write;
    let m = summary.metrics();
    let mut text = format!("{}: {}\n", scenario.name, describe_end(summary, how));
    let mut line = |label: &str, value: String| {
        let _ = writeln!(text, "  {label:<22}{value}"); // a String takes everything
    };
    line(
        "position error",
        format!(
            "{:.4} m max, {:.4} m RMS, {:.4} m at the end",
            m.max_position_error_m, m.rms_position_error_m, m.final_position_error_m
        ),
    );
    line(
        "altitude error",
        format!(
            "{} in 10-50 s, {} otherwise",
            metres(m.max_altitude_error_horizontal_m),
            metres(m.max_altitude_error_vertical_m)
        ),
    );
    line(
        "actuators",
        format!(
            "rotors {:.0} to {:.0}, tilt {:.1} deg max, {} commands saturated",
            m.rotor_speed_min, m.rotor_speed_max, m.tilt_max_deg, m.commands_saturated
        ),
    );
    line("solver", summary.solves.describe());
    for fault in summary.faults.describe() {
        line("fault", fault);
    }
    for events in describe_events(&how.events, scenario.sample_s()) {
        line("events", events);
    }
    for v in verdicts(&scenario.bounds, &m) {
        let ok = if v.ok { "inside" } else { "OUTSIDE" };
        line(ok, format!("{} {:.4} against {}", v.metric, v.measured, v.limit));
    }
    if let Some(log) = &how.log {
        let dropped = if log.dropped == 0 { String::new() } else { format!(", {} dropped", log.dropped) };
        line(
            "log",
            format!(
                "{} records{dropped}{}",
                log.records,
                log.error.as_ref().map_or(String::new(), |e| format!("; {e}"))
            ),
        );
    }
    line("state hash", summary.state_hash().unwrap_or_else(|| "none: the watcher missed messages".into()));
    line(
        "speed",
        format!(
            "{:.2} s flown in {:.2} s: {:.0} x real time",
            summary.time_s(),
            how.wall_s,
            summary.time_s() / how.wall_s
        ),
    );
    // Only against the clock is a node punctual or late.
    if let Some(timing) = &summary.timing
        && scenario.run.mode == Mode::Realtime
    {
        text.push_str(&timing.describe());
    }
    text
}

/// One line on every process to which something happened: what, how often, when, and the last reason told.
fn describe_events(events: &[Event], sample_s: f64) -> Vec<String> {
    let mut groups: Vec<Vec<&Event>> = vec![];
    for event in events {
        match groups.iter_mut().find(|group| group[0].node == event.node) {
            Some(group) => group.push(event),
            None => groups.push(vec![event]),
        }
    }
    let describe = |group: &Vec<&Event>| {
        let mut counts: Vec<(What, u32)> = vec![];
        for event in group {
            match counts.iter_mut().find(|(what, _)| *what == event.what) {
                Some((_, count)) => *count += 1,
                None => counts.push((event.what, 1)),
            }
        }
        let words = counts.iter().map(|(what, count)| {
            let word = name(what).replace('-', " ");
            if *count == 1 { word } else { format!("{word} {count} times") }
        });
        let at_s = |event: &Event| event.tick as f64 * sample_s;
        let why =
            group.iter().rev().find_map(|event| event.why.as_ref()).map_or(String::new(), |why| format!(": {why}"));
        let (first_s, last_s) = (at_s(group[0]), at_s(group[group.len() - 1]));
        format!("{} {} from {first_s:.2} to {last_s:.2} s{why}", group[0].node, words.collect::<Vec<_>>().join(", "))
    };
    groups.iter().map(describe).collect()
}

fn metres(value: f64) -> String {
    if value.is_nan() { "not reached".into() } else { format!("{value:.4} m") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_told_process_by_process() {
        let events = [
            Event::new(200, "mixer", 1, What::Died),
            Event::new(200, "mixer", 2, What::Started),
            Event::new(201, "guidance", 1, What::Hung),
            Event::new(204, "mixer", 2, What::TookOver),
            Event::new(300, "mixer", 2, What::Died).because("signal 9"),
        ];
        let told = describe_events(&events, 0.01);
        assert_eq!(
            told,
            [
                "mixer died 2 times, started, took over from 2.00 to 3.00 s: signal 9",
                "guidance hung from 2.01 to 2.01 s"
            ]
        );
        assert!(describe_events(&[], 0.01).is_empty());
    }
}
