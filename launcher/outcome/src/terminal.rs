//! Account of a flight for people: the text that `fly` prints at its end.

use flight::event::{Event, TimedEvent, name};
use flight::provenance::{self, Provenance};
use flight::swap_story::of_candidates;
use settings::{Mode, Scenario};

use crate::faults::FaultRecord;
use crate::judge::Verdict;
use crate::run_record::RunRecord;

/// Describes a flight of `scenario` in some twenty lines.
pub fn describe(run: &RunRecord, verdict: &Verdict, scenario: &Scenario) -> String {
    use std::fmt::Write;
    let m = &run.metrics;
    let mut text = format!("{}: {}\n", run.name, verdict.describe());
    let mut line = |label: &str, value: String| {
        for (i, part) in wrapped(&value).into_iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "  {:<22}{part}", if i == 0 { label } else { "" });
        }
    };
    let [max, rms, last] = [m.max_position_error_m, m.rms_position_error_m, m.final_position_error_m];
    line("position error", format!("{max:.4} m max, {rms:.4} m RMS, {last:.4} m at the end"));
    line("altitude error", format!("{:.4} m max", m.max_altitude_error_m));
    let (low, high, tilt, saturated) = (m.rotor_speed_min, m.rotor_speed_max, m.tilt_max_deg, m.commands_saturated);
    let actuators = format!("rotors {low:.0} to {high:.0}, tilt {tilt:.1} deg max, {saturated} commands saturated");
    line("actuators", actuators);
    if let Some(phases) = &run.phases {
        let all: Vec<_> = phases.iter().map(|of| format!("{} {:.2} s", of.phase, of.at_s)).collect();
        line("phases", all.join(", "));
    }
    line("solver", run.solver.describe());
    for fault in run.faults.iter().take(TOLD_FAULTS) {
        line("fault", FaultRecord::describe(fault));
    }
    if run.faults.len() > TOLD_FAULTS {
        line("", format!("and {} more: `faults` in run.json and the report have all", run.faults.len() - TOLD_FAULTS));
    }
    for events in describe_events(&run.events) {
        line("events", events);
    }
    for v in &run.bounds {
        let ok = if v.ok { "inside" } else { "OUTSIDE" };
        line(ok, format!("{} {:.4} against {}", v.metric, v.measured, v.limit));
    }
    if let Some(log) = &run.log {
        let dropped = if log.dropped == 0 { String::new() } else { format!(", {} dropped", log.dropped) };
        let error = if log.error.is_some() { "; it is not whole" } else { "" }; // the cause stands on stderr
        line("log", format!("{} records{dropped}{error}", log.records));
    }
    if let Some(granted) = run.provenance.as_ref().and_then(|provenance| granted(scenario, provenance)) {
        line("real time", granted);
    }
    // In real time no flight repeats another.
    let hash = run.state_hash.as_deref().unwrap_or("none: messages were not seen");
    match run.mode {
        Mode::Realtime if run.replays => line("state hash", format!("{hash}: `trefoil replay RUN` gives the same")),
        Mode::Realtime => {}
        Mode::Lockstep | Mode::Inprocess => line("state hash", hash.to_owned()),
    }
    let (flown_s, speed) = (run.flown_s, run.speed);
    line("speed", format!("{flown_s:.2} s flown in {:.2} s: {:.0} x real time", speed.wall_s, speed.times_realtime));
    // A node is late only in real time.
    if let Some(timing) = run.timing.as_ref().filter(|_| run.mode == Mode::Realtime) {
        text.push_str(&timing.describe());
    }
    text
}

/// Describes the scheduling class and memory lock that the kernel gave the processes; `None` outside real time, or if
/// no scheduling was recorded. A note at the beginning of the flight has the command that grants more.
fn granted(scenario: &Scenario, provenance: &Provenance) -> Option<String> {
    let granted = provenance::granted(&provenance.scheduling).filter(|_| scenario.run.mode == Mode::Realtime)?;
    let [class, memory] = machine::privileges::judge(scenario, granted, "launcher");
    Some(format!("{}; memory {}", class.found, memory.found))
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
fn describe_events(events: &[TimedEvent]) -> Vec<String> {
    let describe = |(node, group): (String, Vec<&TimedEvent>)| {
        let words = grouped(group.iter().map(|timed| (name(timed.event.what).replace('-', " "), *timed)))
            .into_iter()
            .map(|(word, all)| if all.len() == 1 { word } else { format!("{word} {} times", all.len()) });
        let why = group.iter().rev().find_map(|timed| timed.event.why.as_ref());
        let why = why.map_or(String::new(), |why| format!("; last: {why}"));
        let [first_s, last_s] = [0, group.len() - 1].map(|i| group[i].at_s);
        let when = if first_s < last_s { format!("{first_s:.2} to {last_s:.2} s") } else { format!("{first_s:.2} s") };
        format!("{node}, {when}: {}{why}", words.collect::<Vec<_>>().join(", "))
    };
    let process = |(TimedEvent { event, .. }, is_of_candidate): (&TimedEvent, bool)| {
        if is_of_candidate { format!("candidate of {}", event.node) } else { event.node.clone() }
    };
    let plain: Vec<Event> = events.iter().map(|timed| timed.event.clone()).collect();
    let processes = events.iter().zip(of_candidates(&plain)).map(process);
    grouped(processes.zip(events)).into_iter().map(describe).collect()
}

/// Groups events by key, in the order of each group's first event.
fn grouped<'a, K: PartialEq>(events: impl Iterator<Item = (K, &'a TimedEvent)>) -> Vec<(K, Vec<&'a TimedEvent>)> {
    let mut groups: Vec<(K, Vec<&TimedEvent>)> = vec![];
    for (key, event) in events {
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.push(event),
            None => groups.push((key, vec![event])),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::topic::NODES;
    use flight::event::What;
    use flight::provenance::host;
    use settings::SchedulingPolicy;

    #[test]
    fn long_lines_are_broken_at_blanks_and_lose_nothing() {
        let text = ["word"; 60].join(" ") + " " + &"x".repeat(200);
        let lines = wrapped(&text);
        assert!(lines.len() > 3 && lines.iter().rev().skip(1).all(|line| line.chars().count() <= COLUMNS), "{lines:?}");
        assert_eq!(lines.join(" ").split_whitespace().collect::<Vec<_>>().join(" "), text);
        assert_eq!(wrapped("short  and as it was"), ["short  and as it was"]);
    }

    #[test]
    fn privileges_not_granted_are_told() {
        let told = |policy: &str, locked_kb: u64, scenario: &Scenario| {
            let affinity = String::new();
            let node = provenance::ProcessScheduling {
                policy: policy.into(),
                priority: 0,
                affinity,
                locked_kb,
                rttime_us: None,
            };
            let scheduling = NODES.iter().map(|name| ((*name).into(), node.clone())).collect();
            granted(scenario, &Provenance { host: host(), scheduling, scenario: String::new() }).unwrap_or_default()
        };
        let mut scenario = Scenario::default();
        scenario.run.mode = Mode::Realtime;
        assert_eq!(told("fifo", 9, &scenario), "SCHED_FIFO; memory locked");
        assert_eq!(
            told("other", 0, &scenario),
            "SCHED_OTHER for want of privilege; memory not locked for want of privilege"
        );
        assert_eq!(told("fifo", 0, &scenario), "SCHED_FIFO; memory not locked for want of privilege");
        (scenario.realtime.policy, scenario.realtime.lock_memory) = (SchedulingPolicy::Other, false);
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
        let told = describe_events(&TimedEvent::all(&events, 100));
        assert_eq!(
            told,
            ["mixer, 2.00 to 3.00 s: died 2 times, started, took over; last: signal 9", "guidance, 2.01 s: hung"]
        );
        assert!(describe_events(&[]).is_empty());
        let candidate = Event::new(400, "mixer", 3, What::Started).begins(Some(0));
        let swapped = [Event::new(390, "mixer", 1, What::Died), candidate, Event::new(401, "mixer", 3, What::Died)];
        let expected = ["mixer, 3.90 s: died", "candidate of mixer, 4.00 to 4.01 s: started, died"].map(str::to_owned);
        assert_eq!(describe_events(&TimedEvent::all(&swapped, 100)), expected);
    }
}
