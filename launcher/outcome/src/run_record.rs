//! `run.json`: the summary of a run, for programs.

use contract::Scenario;
use contract::guard::Refusal;
use contract::message::PlantStatus;
use contract::scenario::{Mode, Policy, Scheduling, TrajectoryKind};
use contract::topic::NODES;
use runtime::port::PortFailure;
use serde_json::{Value, json};

use crate::happenings::Happenings;
use crate::judge::{Circumstances, Verdict};
use crate::summary::Summary;
use flight::event::{Event, events, name};
use flight::swap_story::of_candidates;

/// Everything known of a flight that is over.
pub struct Account<'a> {
    pub summary: &'a Summary,
    pub scenario: &'a Scenario,
    pub how: &'a Circumstances,
    pub verdict: &'a Verdict,
    /// Wall time of the flight \[s\], without start and report.
    pub wall_s: f64,
    pub provenance: &'a Value,
}

/// Makes `run.json`.
pub fn run_json(of: &Account) -> Value {
    let Account { summary, scenario, how, verdict, wall_s, provenance } = of;
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
        "ended": verdict.end,
        "but": verdict.reservations,
        "exit_code": verdict.exit_code,
        "metrics": summary.metrics(),
        "solver": summary.solves.to_json(),
        "state_hash": summary.state_hash(),
        "replays": replays(summary, how),
        "bounds": verdict.bounds,
        "speed": { "wall_s": wall_s, "times_realtime": flown_s / wall_s },
        "timing": summary.timing.as_ref().map(|timing| timing.to_json(&happened)),
        "log": how.log,
        "unobserved": summary.missed(),
        "faults": faults,
        "events": events,
        "refused": by_node(&how.refused, Refusal::ALL.map(Refusal::name)),
        "port_failures": by_node(&how.port_failures, PortFailure::ALL.map(PortFailure::name)),
        "provenance": provenance,
    })
}

/// Returns whether a replay of the flight gives the same state hash: the log has every message, and no solve was
/// stopped where the clock may have stopped it.
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

/// Scheduling class and memory lock that the kernel gave the processes, and where that is less than they asked for,
/// what would give it, in lines; none where no process could have any.
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

/// Says how the flight met the ground at its end, or "in the air"; `None` where there is no ground.
pub fn touchdown(scenario: &Scenario, status: PlantStatus) -> Option<&'static str> {
    use PlantStatus as P;
    scenario.plant.ground.present.then_some(match status {
        P::Landed | P::Crashed | P::TippedOver | P::Slid | P::NotLanded | P::Standing | P::TakingOff | P::Landing => {
            status.describe()
        }
        P::Flying | P::Finished | P::NonFinite | P::TooFar | P::TooFast => "in the air",
    })
}

/// Phases of take-off and landing with the time of each one's first sample; `None` without a ground.
fn phases(scenario: &Scenario, summary: &Summary) -> Option<Value> {
    let in_flight = summary.phases().iter().filter(|(_, phase)| !phase.is_last());
    let all = in_flight.map(|(at_s, phase)| json!({ "at_s": at_s, "phase": phase.describe() }));
    scenario.plant.ground.present.then(|| all.collect())
}

/// Describes the flight for people, in some twenty lines.
pub fn describe(of: &Account) -> String {
    use std::fmt::Write;
    let Account { summary, scenario, how, verdict, wall_s, provenance } = *of;
    let m = summary.metrics();
    let mut text = format!("{}: {}\n", scenario.name, verdict.describe());
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
    for v in &verdict.bounds {
        let ok = if v.ok { "inside" } else { "OUTSIDE" };
        line(ok, format!("{} {:.4} against {}", v.metric, v.measured, v.limit));
    }
    if let Some(log) = &how.log {
        let dropped = if log.dropped == 0 { String::new() } else { format!(", {} dropped", log.dropped) };
        let error = if log.error.is_some() { "; it is not whole" } else { "" }; // the cause stands on stderr
        line("log", format!("{} records{dropped}{error}", log.records));
    }
    for (i, granted) in granted(scenario, provenance).into_iter().enumerate() {
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
    let flown_s = summary.time_s();
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

/// Largest number of faults that the terminal lists one by one.
const TOLD_FAULTS: usize = 10;
/// Width of the text beside a label on the terminal \[columns\].
const COLUMNS: usize = 96;

/// Wraps a text at blanks into lines of [`COLUMNS`]; all but the first are indented by two.
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

/// Describes the events of each process in one line: when, what, how often, and the last reason.
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

/// Groups events by key, in the order of each group's first event.
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
    use flight::event::What;

    #[test]
    fn long_lines_are_broken_at_blanks_and_lose_nothing() {
        let text = ["word"; 60].join(" ") + " " + &"x".repeat(200);
        let lines = wrapped(&text);
        assert!(lines.len() > 3 && lines.iter().rev().skip(1).all(|line| line.chars().count() <= COLUMNS), "{lines:?}");
        assert_eq!(lines.join(" ").split_whitespace().collect::<Vec<_>>().join(" "), text);
        assert_eq!(wrapped("short  and as it was"), ["short  and as it was"]);
    }

    #[test]
    fn privileges_not_granted_are_told_with_the_command_that_grants_them() {
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
