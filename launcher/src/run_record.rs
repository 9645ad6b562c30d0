//! `run.json`: the summary of a run, for programs.

use contract::Scenario;
use contract::guard::Refusal;
use contract::process::exit;
use contract::scenario::{Bounds, Mode};
use serde_json::{Value, json};

use crate::recorder::LogOutcome;
use crate::stack::{Ended, HostEvent};
use crate::summary::{Metrics, Summary};
use crate::supervisor::Event;

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
    /// What happened to the processes.
    pub events: Vec<Event>,
    /// What happened around them.
    pub host: Vec<HostEvent>,
    /// Messages refused, by listener and cause.
    pub refused: Vec<(&'static str, [u32; Refusal::ALL.len()])>,
}

/// Exit code of a run: the gravest of what happened.
pub fn exit_code(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> u8 {
    let log_lost = how.log.as_ref().is_some_and(|log| log.error.is_some());
    match how.ended {
        Ended::Interrupted => exit::INTERRUPTED,
        Ended::Lost(_) => exit::PROCESS_LOST,
        Ended::Late(_) => exit::BUDGET_BROKEN,
        Ended::Flown if log_lost => exit::PROCESS_LOST,
        Ended::Flown if summary.status().diverged() => exit::OUT_OF_BOUNDS,
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
        Ended::Flown => format!("flown to the end, {t:.2} s"),
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
        "events": events(scenario, how),
        "refused": refused(&how.refused),
        "provenance": how.provenance,
    })
}

/// What happened to the processes and around them, by the time of the flight.
fn events(scenario: &Scenario, how: &Circumstances) -> Value {
    let at_s = |tick: u64| tick as f64 / f64::from(scenario.run.rate_hz);
    let of_a_process =
        |e: &Event| (e.tick, json!({ "at_s": at_s(e.tick), "node": e.node, "epoch": e.epoch, "what": e.what }));
    let around = |e: &HostEvent| {
        (e.tick, json!({ "at_s": at_s(e.tick), "node": "host", "epoch": 0, "what": e.what, "detail": e.detail }))
    };
    let mut all: Vec<_> = how.events.iter().map(of_a_process).chain(how.host.iter().map(around)).collect();
    all.sort_by_key(|(tick, _)| *tick);
    all.into_iter().map(|(_, event)| event).collect()
}

/// Refused messages by listener and cause.
fn refused(counts: &[(&'static str, [u32; Refusal::ALL.len()])]) -> Value {
    let causes = |counts: &[u32; Refusal::ALL.len()]| -> Value {
        Refusal::ALL.iter().zip(counts).map(|(refusal, count)| (refusal.name().to_owned(), json!(count))).collect()
    };
    counts.iter().map(|(node, counts)| ((*node).to_owned(), causes(counts))).collect()
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
    for event in &how.host {
        let what = serde_json::to_value(event.what).unwrap_or_default();
        line("host", format!("{} {}", what.as_str().unwrap_or_default(), event.detail));
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

fn metres(value: f64) -> String {
    if value.is_nan() { "not reached".into() } else { format!("{value:.4} m") }
}
