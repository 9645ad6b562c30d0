//! `export --to perfetto`: a viewer can read the trace of real and of damaged flights. No duration is judged.

use std::collections::HashMap;
use std::path::Path;
use std::process::Output;

use contract::message::{Actuators, Message, Stamp, State};
use contract::stamp::delivery;
use flight::log::{Log, Record};
use outcome::happenings::Happenings;
use serde_json::Value;
use settings::{Mode, Scenario};
use view::export::perfetto::{Window, document};

use crate::harness::{fly, launcher};

mod happened;

const LANES: [&str; 5] = ["plant", "guidance", "attitude-mpc", "mixer", "actuators"];

fn run(arguments: &[&str]) -> Output {
    launcher().args(arguments).output().expect("the launcher starts")
}

fn read(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).expect("the file is JSON")
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// Returns the events of one phase.
fn events<'a>(trace: &'a Value, phase: &str) -> Vec<&'a Value> {
    let events = trace["traceEvents"].as_array().expect("a list of events");
    events.iter().filter(|event| event["ph"] == phase).collect()
}

/// Converts an instant or duration from the viewer's microseconds \[ns\].
fn ns(us: &Value) -> i64 {
    (us.as_f64().expect("a number") * 1e3).round() as i64
}

fn lane(event: &Value) -> u64 {
    assert!(event["pid"] == event["tid"] || event["pid"].as_u64() > Some(5), "one thread for each process: {event}");
    event["pid"].as_u64().expect("a lane")
}

/// Checks the properties that a viewer relies on.
fn check_trace(trace: &Value) {
    let names = events(trace, "M").into_iter().filter(|event| event["name"] == "process_name");
    let names: HashMap<u64, &str> = names.map(|e| (lane(e), e["args"]["name"].as_str().expect("a name"))).collect();
    assert_eq!((1..=5).map(|lane| names[&lane]).collect::<Vec<_>>(), LANES);
    let thread = |event: &Value| (lane(event), event["tid"].as_u64());

    let mut newest = HashMap::new();
    for event in trace["traceEvents"].as_array().expect("a list of events") {
        if event["ph"] != "M" {
            let before = newest.insert(lane(event), ns(&event["ts"])).unwrap_or(0);
            assert!(names.contains_key(&lane(event)) && ns(&event["ts"]) >= before, "out of order: {event}");
        }
    }
    let mut slices: HashMap<_, Vec<(i64, i64)>> = HashMap::new();
    for slice in events(trace, "X") {
        let (start, duration) = (ns(&slice["ts"]), ns(&slice["dur"]));
        let thread = slices.entry(thread(slice)).or_default();
        assert!(duration >= 0 && thread.last().is_none_or(|(_, end)| *end <= start), "overlaps: {slice}");
        thread.push((start, start + duration));
    }
    let mut flows: HashMap<u64, Vec<(&str, i64)>> = HashMap::new();
    for phase in ["s", "t", "f"] {
        for event in events(trace, phase) {
            let at = ns(&event["ts"]);
            let tied = slices[&thread(event)].iter().any(|(start, end)| (*start..=*end).contains(&at));
            assert!(tied, "an arrow without an end: {event}");
            flows.entry(event["id"].as_u64().expect("a number")).or_default().push((phase, at));
        }
    }
    for (id, stations) in flows {
        let phases: String = stations.iter().map(|(phase, _)| *phase).collect();
        assert!(phases.starts_with('s') && phases.ends_with('f') && phases.len() >= 2, "{id}: {phases}");
        assert_eq!(phases.trim_matches('t').len(), phases.len(), "{id}: {phases}");
        assert_eq!(phases.replace('t', ""), "sf", "{id}: {phases}");
        assert!(stations.is_sorted_by_key(|(_, at)| at), "{id} goes back in time: {stations:?}");
    }
}

#[test]
fn a_flight_in_lockstep_is_traced_with_a_warning() {
    let flown = fly(&["--mode", "lockstep", "--set", "run.duration_s=2.0"]);
    let output = run(&["export", plain(&flown.out), "--to", "perfetto", "--from", "0.5s", "--for", "500ms"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stderr).contains("lockstep"), "times mean little there, and it says so");
    let trace = read(&flown.out.join("trace.json"));
    check_trace(&trace);
    assert_eq!(events(&trace, "X").len(), 5 * 50);
    assert_eq!(events(&trace, "t").len(), 3 * 50, "each arrow passes three nodes on its way");
}

#[test]
fn an_export_for_perfetto_is_the_trace_of_the_whole_flight() {
    let flown = fly(&["--mode", "lockstep", "--set", "run.duration_s=2.0"]);
    let exported = run(&["export", plain(&flown.out), "--to", "perfetto"]);
    assert_eq!(exported.status.code(), Some(0), "{}", String::from_utf8_lossy(&exported.stderr));
    let whole = read(&flown.out.join("trace.json"));
    check_trace(&whole);
    assert_eq!(events(&whole, "X").iter().filter(|slice| lane(slice) == 1).count(), 201);
}

#[test]
fn a_flight_in_real_time_is_traced_around_its_worst_tick() {
    let flown = fly(&["--mode", "realtime", "--set", "run.duration_s=1.0"]);
    let file = flown.out.join("elsewhere.json");
    let output =
        run(&["export", plain(&flown.out.join("flight.mcap")), "--to", "perfetto", "--worst", "--out", plain(&file)]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let worst = &flown.run()["timing"]["worst_ticks"][0];
    let told =
        format!("the worst tick, {}: {:.2} ms late", worst["tick"], worst["late_us"].as_f64().expect("us") / 1e3);
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert!(stdout.contains(&told), "{told}: {stdout}");
    let trace = read(&file);
    check_trace(&trace);
    assert!(trace["otherData"]["note"] == "" && trace["otherData"]["mode"] == "realtime");
    for state in events(&trace, "X").into_iter().filter(|slice| lane(slice) == 1) {
        let tick = state["args"]["tick"].as_i64().expect("a tick");
        let late = ns(&state["ts"]) - tick * 10_000_000;
        assert!(late >= 0, "time zero is the first sample: {state}");
    }
}

#[test]
fn what_cannot_be_traced_is_told() {
    let unlogged = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.1", "--no-log"]);
    let in_process = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.1"]);
    let lockstep = fly(&["--mode", "lockstep", "--set", "run.duration_s=0.1"]);
    let check = |arguments: &[&str], parts: &[&str]| {
        let output = run(&[&["export", "--to", "perfetto"], arguments].concat());
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(parts.iter().all(|part| stderr.contains(part)), "{arguments:?} should say {parts:?}: {stderr}");
    };
    check(&["no/such/run"], &["no/such/run", "folder of a run"]);
    check(&[plain(&unlogged.out)], &["flight.mcap", "--no-log"]);
    check(&[plain(&in_process.out)], &["no clock", "--mode realtime"]);
    check(&[plain(&lockstep.out), "--from", "7s", "--for", "1s"], &["7.00 to 8.00 s", "covers 0.10 s", "--from"]);
    check(&[plain(&lockstep.out), "--for", "0s"], &["--for"]);
    check(&[plain(&lockstep.out), "--from", "0", "--worst"], &["--worst"]);
    check(&[plain(&lockstep.out), "--out", "/no/such/folder/x"], &["/no/such/folder", "--out"]);
}

/// Makes a flight of `ticks` ticks, stamped as by a real-time ring, 10 ms apart: each node takes 100 us.
fn ring(ticks: u64) -> Log {
    fn stamped<M: Message>(tick: u64) -> M {
        let sample_ns = 1_000_000_000 + tick * 10_000_000;
        let lane = M::TOPIC as usize;
        let start_ns = sample_ns + 20_000 + lane as u64 * 120_000;
        let provenance = Stamp { tick, sample_ns, release_ns: start_ns - 20_000, start_ns, ..Stamp::default() };
        let mut message = M::default();
        *message.stamp_mut() = Stamp { epoch: 1, ..provenance.published(M::TOPIC, tick + 1, start_ns + 100_000) };
        message
    }
    let mut log = Log::default();
    for tick in 0..ticks {
        let state: State = stamped(tick);
        log.states.push(State { applied_sequence: tick, applied_age_ns: 510_000, ..state });
        log.references.push(stamped(tick));
        log.controls.push(stamped(tick));
        log.actuators.push(stamped(tick));
    }
    log
}

fn traced(log: &Log) -> Value {
    traced_with(log, &Happenings::default())
}

/// Returns the trace of a flight with these happenings.
fn traced_with(log: &Log, happened: &Happenings) -> Value {
    fn with_checksum<M: Message>(messages: &[M]) -> Vec<M> {
        messages.iter().map(|message| message.with_checksum()).collect()
    }
    let log = Log {
        states: with_checksum(&log.states),
        references: with_checksum(&log.references),
        controls: with_checksum(&log.controls),
        actuators: with_checksum(&log.actuators),
        ..log.clone()
    };
    let mut scenario = Scenario::default();
    scenario.run.mode = Mode::Realtime;
    let records = |each: &mut dyn FnMut(&Record)| {
        log.tick_by_tick().for_each(|record| each(&record));
        Ok(())
    };
    let window = Window::new(Some(0.0), 60.0, scenario.sample_s(), None);
    let trace = document(records, &scenario, happened, &window).expect("a window with ticks");
    check_trace(&trace);
    trace
}

#[test]
fn an_arrow_goes_from_the_sample_to_the_moment_its_command_acts() {
    let trace = traced(&ring(10));
    let of = |phase| events(&trace, phase).into_iter().filter(|e| e["id"] == 4).collect::<Vec<_>>();
    let at: Vec<_> = [of("s"), of("t"), of("f")].concat().into_iter().map(|e| (lane(e), ns(&e["ts"]))).collect();
    let sample = 30_000_000;
    let expected = [(1, 20_000), (2, 140_000), (3, 260_000), (4, 380_000), (5, 510_000)];
    assert_eq!(at, expected.map(|(lane, after)| (lane, sample + after)));
    let ages: Vec<_> = events(&trace, "C").into_iter().filter_map(|event| event["args"]["ms"].as_f64()).collect();
    assert_eq!(ages, [0.51; 9], "the last command had no sample left to be seen at");
}

#[test]
fn cpu_time_is_that_of_the_cycle_it_was_spent_in() {
    let mut log = ring(3);
    for (i, state) in log.states.iter_mut().enumerate() {
        state.stamp.cpu_ns = [0, 70_000, 80_000][i];
    }
    let trace = traced(&log);
    let states = events(&trace, "X").into_iter().filter(|slice| lane(slice) == 1);
    let cpu: Vec<_> = states.map(|slice| slice["args"]["cpu_us"].as_f64()).collect();
    assert_eq!(cpu, [Some(70.0), Some(80.0), None]);
}

#[test]
fn misses_and_slips_are_marked_where_they_happened() {
    let mut log = ring(6);
    for controls in &mut log.controls[2..] {
        controls.stamp.misses = 1;
    }
    for controls in &mut log.controls[4..] {
        (controls.stamp.misses, controls.stamp.slips) = (4, 2);
    }
    let trace = traced(&log);
    let marks: Vec<_> =
        events(&trace, "i").into_iter().map(|e| (ns(&e["ts"]), lane(e), &e["name"], &e["args"])).collect();
    let texts: Vec<_> = marks.iter().map(|(at, lane, name, args)| format!("{at} {lane} {name} {args}")).collect();
    let expected =
        ["20360000 3 \"miss\" {\"count\":1}", "40260000 3 \"slip\" {\"count\":2}", "40360000 3 \"miss\" {\"count\":1}"];
    assert_eq!(texts, expected);
}

#[test]
fn a_candidate_on_standby_is_not_drawn_and_its_misses_are_not_marked() {
    let mut log = ring(8);
    let two = |command: &Actuators| {
        let tick = command.stamp.tick;
        [1, 2].map(|epoch| {
            let mut command = *command;
            let candidate = epoch == 2;
            let heard = (3..6).contains(&tick) == candidate;
            command.stamp.delivery = if heard { delivery::DELIVERED } else { delivery::STANDBY };
            command.stamp.epoch = epoch;
            command.stamp.misses = if candidate { 3 * tick.min(2) } else { tick.clamp(2, 5) - 2 };
            command
        })
    };
    log.actuators = log.actuators.iter().flat_map(two).collect();
    let trace = traced(&log);
    assert_eq!(events(&trace, "X").into_iter().filter(|slice| lane(slice) == 4).count(), 8);
    assert_eq!(events(&trace, "f").len(), 8);
    assert_eq!(events(&trace, "i").len(), 0);
}

#[test]
fn holes_and_restarts_break_no_arrow() {
    let mut log = ring(20);
    log.references.remove(3); // overtaken: no node downstream knows tick 3
    log.controls.remove(3);
    log.actuators.remove(3);
    log.states.remove(7);
    log.states[3].applied_sequence = 3;
    // The restarted mixer counts from 1 again, and some of its commands were lost.
    for actuators in &mut log.actuators[9..] {
        actuators.stamp.epoch = 2;
        actuators.stamp.sequence -= 10;
    }
    for state in &mut log.states[11..] {
        state.applied_sequence = state.stamp.tick - 10;
    }
    log.controls.truncate(15);
    let trace = traced(&log);
    assert_eq!(events(&trace, "s").len(), events(&trace, "f").len());
    assert_eq!(events(&trace, "s").len(), 19, "all ticks but the one that ended at the plant");
    assert!(traced(&Log { actuators: vec![], ..ring(4) })["traceEvents"].is_array());
    let lonely = Log { references: vec![], actuators: vec![], ..ring(1) };
    assert_eq!(events(&traced(&lonely), "s").len(), 1, "from the plant straight to what is there");
}
