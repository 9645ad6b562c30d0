//! `run.json`: the summary of a run, for programs.

use contract::Scenario;
use contract::exit;
use contract::guard::Refusal;
use contract::message::PlantStatus;
use contract::scenario::{Mode, Policy, Scheduling, TrajectoryKind};
use contract::topic::NODES;
use runtime::port::PortFailure;
use serde_json::{Value, json};

use crate::bounds::{self, BoundCheck};
use crate::happenings::Happenings;
use crate::summary::Summary;
use flight::event::{Event, What, events, name};
use flight::recorder::LogOutcome;
use flight::stack::{Ended, PortFailures, Refused};
use flight::swap_story::{FailedSwap, of_candidates};

/// What is known of a run besides its messages.
pub struct Circumstances {
    pub ended: Ended,
    /// Wall time of the flight \[s\], without start and report.
    pub wall_s: f64,
    /// The recorder's outcome, if there was a recorder.
    pub log: Option<LogOutcome>,
    pub provenance: Value,
    pub events: Vec<Event>,
    /// Messages refused, by listener and cause.
    pub refused: Refused,
    /// How often ports have failed, by node.
    pub port_failures: PortFailures,
}

/// Exit code of a run, by the gravest of what happened.
pub fn exit_code(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> u8 {
    let log_lost = how.log.as_ref().is_some_and(|log| log.error.is_some());
    match how.ended {
        Ended::Interrupted => exit::INTERRUPTED,
        Ended::Lost(_) | Ended::Unseen(_) => exit::PROCESS_LOST,
        Ended::Late(_) => exit::BUDGET_BROKEN,
        Ended::Flown if log_lost => exit::PROCESS_LOST,
        Ended::Flown if summary.status().failed() || spoiling_swap(scenario, how).is_some() => exit::OUT_OF_BOUNDS,
        Ended::Flown if bounds::check(scenario, &summary.metrics()).iter().any(|v| !v.ok) => exit::OUT_OF_BOUNDS,
        Ended::Flown => exit::FLOWN,
    }
}

/// Why a run did not end with 0, in a word or two that do not depend on how much or when; empty where it did.
pub fn cause(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> String {
    match &how.ended {
        Ended::Interrupted => "interrupted".into(),
        Ended::Lost(name) => format!("lost {name}"),
        Ended::Late(name) => format!("late {name}"),
        Ended::Unseen(_) => "not seen whole".into(),
        Ended::Flown if summary.status().failed() => summary.status().describe().into(),
        Ended::Flown => {
            let outside = bounds::check(scenario, &summary.metrics()).into_iter().find(|bound| !bound.ok);
            let swap = || spoiling_swap(scenario, how).map(|failed| format!("a swap {}", failed.name()));
            outside.map(|bound| bound.words[0].into()).or_else(swap).unwrap_or_default()
        }
    }
}

/// The first swap that did not stay and that may not fail.
fn spoiling_swap<'a>(scenario: &'a Scenario, how: &'a Circumstances) -> Option<FailedSwap<'a>> {
    FailedSwap::all(scenario, &how.events).into_iter().find(|failed| !failed.swap.may_fail)
}

pub fn describe_end(summary: &Summary, how: &Circumstances) -> String {
    let t = summary.time_s();
    match &how.ended {
        Ended::Interrupted => format!("interrupted at {t:.2} s"),
        Ended::Lost(name) => format!("lost {name} at {t:.2} s"),
        Ended::Late(name) => format!("stopped at {t:.2} s: {name} missed its deadline"),
        Ended::Unseen(what) => format!("flown, but not seen whole: {what}"),
        Ended::Flown if matches!(summary.status(), PlantStatus::Crashed | PlantStatus::TippedOver) => {
            format!("{} at {t:.2} s", summary.status().describe())
        }
        Ended::Flown if summary.status().diverged() => format!("diverged at {t:.2} s: {}", summary.status().describe()),
        Ended::Flown if summary.status() == PlantStatus::Landed => format!("flown to the end, {t:.2} s, and landed"),
        Ended::Flown => format!("flown to the end, {t:.2} s"),
    }
}

/// What else a reader must know, the gravest first; nothing when all went well.
pub fn reservations(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> Vec<String> {
    let metrics = summary.metrics();
    let outside: Vec<_> = bounds::check(scenario, &metrics).into_iter().filter(|bound| !bound.ok).collect();
    let describe = |BoundCheck { words: [what, unit], measured, limit, .. }: &BoundCheck| {
        format!("{what} {measured:.3} {unit} (bound {limit} {unit})")
    };
    let mut told: Vec<String> = match summary.status() {
        PlantStatus::Slid => vec!["slid over the ground instead of landing".into()],
        PlantStatus::NotLanded => vec!["on the ground and not landed".into()],
        _ => vec![],
    };
    told.extend(outside.iter().map(describe));
    if metrics.fallback_s > 0.0 && !outside.iter().any(|bound| bound.metric == "max_fallback_s") {
        told.push(format!("mixer on its fallback for {:.2} s", metrics.fallback_s));
    }
    told.extend(FailedSwap::all(scenario, &how.events).iter().map(FailedSwap::describe));
    let failed = |event: &Event| matches!(event.what, What::Died | What::Hung | What::GivenUp);
    let events = how.events.iter().zip(of_candidates(&how.events));
    let failed = events.filter(|(event, is_of_candidate)| failed(event) && !is_of_candidate);
    let mut nodes: Vec<&str> = failed.map(|(event, _)| event.node.as_str()).collect();
    nodes.sort_unstable();
    nodes.dedup();
    if !nodes.is_empty() {
        told.push(format!("{} failed in flight", nodes.join(" and ")));
    }
    if let Some(log) = &how.log {
        told.extend((log.dropped > 0).then(|| format!("{} records are missing in the log", log.dropped)));
        told.extend(log.error.is_some().then(|| "the log is not whole".to_owned()));
    }
    let failures = how.port_failures.iter().map(|(node, counts)| (node, counts.iter().copied().map(u64::from).sum()));
    told.extend(
        failures.filter(|(_, n): &(_, u64)| *n > 0).map(|(node, n)| format!("ports of {node} failed {n} times")),
    );
    told.extend((summary.missed() > 0).then(|| format!("{} messages were not seen", summary.missed())));
    told
}

pub fn run_json(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> Value {
    let metrics = summary.metrics();
    let flown_s = summary.time_s();
    let (faults, events) = (summary.faults.to_json(&how.events), events(scenario, &how.events));
    let happened = Happenings::new(&faults, &events);
    json!({
        "name": scenario.name,
        "mode": scenario.run.mode,
        "profile": scenario.profile,
        "duration_s": scenario.run.duration_s,
        "flown_s": flown_s,
        "diverged": summary.status().diverged(),
        "ground": touchdown(scenario, summary.status()),
        "phases": phases(scenario, summary),
        "ended": describe_end(summary, how),
        "but": reservations(summary, scenario, how),
        "exit_code": exit_code(summary, scenario, how),
        "metrics": metrics,
        "solver": summary.solves.to_json(),
        "state_hash": summary.state_hash(),
        "replays": replays(summary, how),
        "bounds": bounds::check(scenario, &metrics),
        "speed": { "wall_s": how.wall_s, "times_realtime": flown_s / how.wall_s },
        "timing": summary.timing.as_ref().map(|timing| timing.to_json(&happened)),
        "log": how.log,
        "unobserved": summary.missed(),
        "faults": faults,
        "events": events,
        "refused": by_node(&how.refused, Refusal::ALL.map(Refusal::name)),
        "port_failures": by_node(&how.port_failures, PortFailure::ALL.map(PortFailure::name)),
        "provenance": how.provenance,
    })
}

/// Whether a replay of the flight gives the same state hash: the log has every message, and no solve was stopped where the clock
/// may have stopped it.
fn replays(summary: &Summary, how: &Circumstances) -> bool {
    let is_whole = how.log.as_ref().is_some_and(|log| log.dropped == 0 && log.error.is_none());
    is_whole && summary.state_hash().is_some() && summary.solves.stopped() == 0
}

/// Counts of each node, by cause.
fn by_node<const N: usize>(counts: &[(&str, [u32; N])], causes: [&str; N]) -> Value {
    let by_cause = |counts: &[u32; N]| -> Value {
        causes.iter().zip(counts).map(|(cause, count)| ((*cause).to_owned(), json!(count))).collect()
    };
    counts.iter().map(|(node, counts)| ((*node).to_owned(), by_cause(counts))).collect()
}

/// Scheduling class and memory lock that the kernel gave the processes, and where that is less than they asked for, what would
/// give it, in lines; none where no process could have any.
fn granted(scenario: &Scenario, provenance: &Value) -> Vec<String> {
    let nodes: Vec<&Value> = NODES.iter().filter_map(|node| provenance["scheduling"].get(node)).collect();
    if scenario.run.mode != Mode::Realtime || nodes.is_empty() {
        return vec![];
    }
    let asked: Vec<Scheduling> = (0..NODES.len()).map(|rank| scenario.realtime.of(rank)).collect();
    let asked_fifo = asked.iter().filter(|asked| asked.policy == Policy::Fifo).count();
    let asked_lock = asked.iter().filter(|asked| asked.lock_memory).count();
    let fifo = nodes.iter().filter(|node| node["policy"] == "fifo").count();
    let locked = nodes.iter().filter(|node| node["locked_kb"].as_u64() > Some(0)).count();
    let [lacks_fifo, lacks_lock] = [fifo < asked_fifo, locked < asked_lock];
    let class = match fifo {
        0 if lacks_fifo => "SCHED_OTHER for want of privilege".to_owned(),
        0 => "SCHED_OTHER, as the scenario has it".to_owned(),
        4 => "SCHED_FIFO".to_owned(),
        some => format!("SCHED_FIFO for {some} of 4 nodes{}", if lacks_fifo { " for want of privilege" } else { "" }),
    };
    let memory = match () {
        () if locked == nodes.len() => "locked",
        () if lacks_lock => "not locked for want of privilege",
        () => "not locked, as the scenario has it",
    };
    let capabilities = match (lacks_fifo, lacks_lock) {
        (false, false) => return vec![format!("{class}; memory {memory}")],
        (true, true) => "cap_sys_nice,cap_ipc_lock",
        (true, false) => "cap_sys_nice",
        (false, true) => "cap_ipc_lock",
    };
    let program = provenance["command"][0].as_str().unwrap_or("target/release/launcher");
    vec![format!("{class}; memory {memory}:"), format!("`sudo setcap {capabilities}+ep {program}` gives it")]
}

/// How the flight met the ground at its end, or "in the air"; nothing where there is none.
pub fn touchdown(scenario: &Scenario, status: PlantStatus) -> Option<&'static str> {
    use PlantStatus as P;
    scenario.plant.ground.present.then_some(match status {
        P::Landed | P::Crashed | P::TippedOver | P::Slid | P::NotLanded | P::Standing | P::TakingOff | P::Landing => {
            status.describe()
        }
        P::Flying | P::Finished | P::NonFinite | P::TooFar | P::TooFast => "in the air",
    })
}

/// Take-off and landing where there is a ground: each phase, and the time of its first sample.
fn phases(scenario: &Scenario, summary: &Summary) -> Option<Value> {
    let in_flight = summary.phases().iter().filter(|(_, phase)| !phase.is_last());
    let all = in_flight.map(|(at_s, phase)| json!({ "at_s": at_s, "phase": phase.describe() }));
    scenario.plant.ground.present.then(|| all.collect())
}

/// For people, in one line: how the flight ended, and what else a reader must know.
pub fn describe_outcome(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> String {
    let but = reservations(summary, scenario, how);
    let but = match (&how.ended, but.as_slice()) {
        (Ended::Flown, []) => ", inside its bounds".to_owned(),
        (_, []) => String::new(),
        (Ended::Flown, but) if !summary.status().diverged() => format!(", but {}", but.join("; ")),
        (_, told) => format!("; {}", told.join("; ")),
    };
    describe_end(summary, how) + &but
}

/// For people: what the flight amounted to.
pub fn describe(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> String {
    use std::fmt::Write;
    let m = summary.metrics();
    let mut text = format!("{}: {}\n", scenario.name, describe_outcome(summary, scenario, how));
    let mut line = |label: &str, value: String| {
        for (i, part) in wrapped(&value).into_iter().enumerate() {
            let _ = writeln!(text, "  {:<22}{part}", if i == 0 { label } else { "" }); // a String takes everything
        }
    };
    let [max, rms, last] = [m.max_position_error_m, m.rms_position_error_m, m.final_position_error_m];
    line("position error", format!("{max:.4} m max, {rms:.4} m RMS, {last:.4} m at the end"));
    let (horizontal, vertical) = (m.max_altitude_error_horizontal_m, m.max_altitude_error_vertical_m);
    let altitude = match scenario.mission.trajectory {
        TrajectoryKind::Survey => format!("{} in 10-50 s, {} otherwise", metres(horizontal), metres(vertical)),
        _ => format!("{} max", metres(horizontal.max(vertical))),
    };
    line("altitude error", altitude);
    let (low, high, tilt, saturated) = (m.rotor_speed_min, m.rotor_speed_max, m.tilt_max_deg, m.commands_saturated);
    let actuators = format!("rotors {low:.0} to {high:.0}, tilt {tilt:.1} deg max, {saturated} commands saturated");
    line("actuators", actuators);
    if scenario.plant.ground.present {
        let in_flight = summary.phases().iter().filter(|(_, phase)| !phase.is_last());
        let all: Vec<_> = in_flight.map(|(at_s, phase)| format!("{} {at_s:.2} s", phase.describe())).collect();
        line("phases", all.join(", "));
    }
    line("solver", summary.solves.describe());
    let faults = summary.faults.describe(&how.events);
    for fault in faults.iter().take(TOLD_FAULTS) {
        line("fault", fault.clone());
    }
    if faults.len() > TOLD_FAULTS {
        line("", format!("and {} more: `faults` in run.json and the report have all", faults.len() - TOLD_FAULTS));
    }
    for events in describe_events(&how.events, scenario.sample_s()) {
        line("events", events);
    }
    for v in bounds::check(scenario, &m) {
        let ok = if v.ok { "inside" } else { "OUTSIDE" };
        line(ok, format!("{} {:.4} against {}", v.metric, v.measured, v.limit));
    }
    if let Some(log) = &how.log {
        let dropped = if log.dropped == 0 { String::new() } else { format!(", {} dropped", log.dropped) };
        let error = if log.error.is_some() { "; it is not whole" } else { "" }; // the cause stands on stderr
        line("log", format!("{} records{dropped}{error}", log.records));
    }
    for (i, granted) in granted(scenario, &how.provenance).into_iter().enumerate() {
        line(if i == 0 { "real time" } else { "" }, granted);
    }
    // In real time no flight repeats another.
    let hash = summary.state_hash().unwrap_or_else(|| "none: messages were not seen".into());
    match scenario.run.mode {
        Mode::Realtime if replays(summary, how) => {
            line("state hash", format!("{hash}: `launcher replay RUN` gives the same"));
        }
        Mode::Realtime => {}
        Mode::Lockstep | Mode::Inprocess => line("state hash", hash),
    }
    let (flown_s, wall_s) = (summary.time_s(), how.wall_s);
    line("speed", format!("{flown_s:.2} s flown in {wall_s:.2} s: {:.0} x real time", flown_s / wall_s));
    // Only in real time is a node late.
    if let Some(timing) = &summary.timing
        && scenario.run.mode == Mode::Realtime
    {
        let happened = Happenings::new(&summary.faults.to_json(&how.events), &events(scenario, &how.events));
        text.push_str(&timing.describe(&happened));
    }
    text
}

/// Faults that the terminal tells one by one.
const TOLD_FAULTS: usize = 10;
/// Columns of what stands beside a label on the terminal.
const COLUMNS: usize = 96;

/// A text in lines of [`COLUMNS`], broken at blanks; all but the first are moved in by two.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = vec![];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= COLUMNS => {
                line.extend([" ", word]);
            }
            Some(_) => lines.push(format!("  {word}")),
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

/// One line on every process to which something happened: when, what, how often, and the last reason told.
fn describe_events(events: &[Event], sample_s: f64) -> Vec<String> {
    let describe = |(node, group): (String, Vec<&Event>)| {
        let words = grouped(group.iter().map(|event| (name(event.what).replace('-', " "), *event)))
            .into_iter()
            .map(|(word, all)| if all.len() == 1 { word } else { format!("{word} {} times", all.len()) });
        let why = group.iter().rev().find_map(|event| event.why.as_ref());
        let why = why.map_or(String::new(), |why| format!("; last: {why}"));
        let [first_s, last_s] = [0, group.len() - 1].map(|i| group[i].tick as f64 * sample_s);
        let when = if first_s < last_s { format!("{first_s:.2} to {last_s:.2} s") } else { format!("{first_s:.2} s") };
        format!("{node}, {when}: {}{why}", words.collect::<Vec<_>>().join(", "))
    };
    let who = |(event, is_of_candidate): (&Event, bool)| {
        if is_of_candidate { format!("candidate of {}", event.node) } else { event.node.clone() }
    };
    let processes = events.iter().zip(of_candidates(events)).map(who);
    grouped(processes.zip(events)).into_iter().map(describe).collect()
}

/// The events in groups of the same key, in the order of their first.
fn grouped<'a, K: PartialEq>(events: impl Iterator<Item = (K, &'a Event)>) -> Vec<(K, Vec<&'a Event>)> {
    let mut groups: Vec<(K, Vec<&Event>)> = vec![];
    for (key, event) in events {
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.push(event),
            None => groups.push((key, vec![event])),
        }
    }
    groups
}

fn metres(value: f64) -> String {
    if value.is_nan() { "not reached".into() } else { format!("{value:.4} m") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_broken_at_blanks_and_lose_nothing() {
        let text = ["word"; 60].join(" ") + " " + &"x".repeat(200);
        let lines = wrapped(&text);
        assert!(lines.len() > 3 && lines.iter().rev().skip(1).all(|line| line.chars().count() <= COLUMNS), "{lines:?}");
        assert_eq!(lines.join(" ").split_whitespace().collect::<Vec<_>>().join(" "), text);
        assert_eq!(wrapped("short  and as it was"), ["short  and as it was"]);
    }

    #[test]
    fn what_the_kernel_did_not_grant_is_told_with_what_would_give_it() {
        let told = |policy: &str, locked_kb: u64, scenario: &Scenario| {
            let node = json!({ "policy": policy, "locked_kb": locked_kb });
            let nodes: serde_json::Map<String, Value> =
                NODES.iter().map(|name| ((*name).into(), node.clone())).collect();
            granted(scenario, &json!({ "scheduling": nodes, "command": ["./launcher"] })).join("\n")
        };
        let mut scenario = Scenario::default();
        scenario.run.mode = Mode::Realtime;
        assert_eq!(told("fifo", 9, &scenario), "SCHED_FIFO; memory locked");
        assert_eq!(
            told("other", 0, &scenario),
            "SCHED_OTHER for want of privilege; memory not locked for want of privilege:\n\
             `sudo setcap cap_sys_nice,cap_ipc_lock+ep ./launcher` gives it"
        );
        assert!(told("fifo", 0, &scenario).ends_with("`sudo setcap cap_ipc_lock+ep ./launcher` gives it"));
        (scenario.realtime.policy, scenario.realtime.lock_memory) = (Policy::Other, false);
        let by_scenario = "SCHED_OTHER, as the scenario has it; memory not locked, as the scenario has it";
        assert_eq!(told("other", 0, &scenario), by_scenario);
    }

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
            ["mixer, 2.00 to 3.00 s: died 2 times, started, took over; last: signal 9", "guidance, 2.01 s: hung"]
        );
        assert!(describe_events(&[], 0.01).is_empty());
        let candidate = Event::new(400, "mixer", 3, What::Started).begins(Some(0));
        let swapped = [Event::new(390, "mixer", 1, What::Died), candidate, Event::new(401, "mixer", 3, What::Died)];
        let expected = ["mixer, 3.90 s: died", "candidate of mixer, 4.00 to 4.01 s: started, died"].map(str::to_owned);
        assert_eq!(describe_events(&swapped, 0.01), expected);
    }
}
