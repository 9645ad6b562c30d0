//! Recorders that die or hang: the flight goes on, and every gap in its log is reported.

use contract::message::Message;
use contract::stamp::delivery;
use flight::log::{self, Log};
use serde_json::Value;

use crate::control::{fly_on, status};
use crate::harness::{Flight, Outcome, PATIENT, launcher, namespace, shared_memory_of, wait_until};
use crate::processes::{kill, process_of, processes_named, processes_of, wait_until_it_flies};

/// Reads the log of a flight, which must be whole.
fn log_of(outcome: &Outcome) -> Log {
    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert!(log.complete(), "{:?}", log.defect);
    log
}

/// Returns epoch, name and time of each event of the recorder.
fn events(run: &Value) -> Vec<(u64, String, f64)> {
    let all = run["events"].as_array().expect("events").iter().filter(|event| event["node"] == "recorder");
    let told = |event: &Value| {
        let what = event["what"].as_str().expect("a word").to_owned();
        (event["epoch"].as_u64().expect("an epoch"), what, event["at_s"].as_f64().expect("a time"))
    };
    all.map(told).collect()
}

/// Checks that the delivered messages of each epoch are numbered without gap or repetition.
fn check_whole<M: Message>(messages: &[M]) {
    let stamps = messages.iter().map(Message::stamp).filter(|stamp| stamp.delivery == delivery::DELIVERED);
    let numbers: Vec<(u64, u64)> = stamps.map(|stamp| (stamp.epoch, stamp.sequence)).collect();
    assert_eq!(numbers.first().map(|(epoch, number)| (*epoch, *number)), Some((1, 1)), "{}", M::TOPIC.name());
    for pair in numbers.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        assert_eq!(pair[1].1, pair[0].1 + 1, "{}", M::TOPIC.name());
    }
}

/// Checks that the log has a TRUTH for every STATE.
fn check_truths(log: &log::Log) {
    let (states, truths) = (log.states.iter().map(|state| state.stamp.tick), log.truths.iter().map(|truth| truth.tick));
    assert!(states.eq(truths), "{} and {}", log.states.len(), log.truths.len());
}

#[test]
fn a_dead_recorder_is_replaced_and_nothing_dies_with_it() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=300.0"]);
    wait_until_it_flies(&ns);
    // The plant waits while the recorder hangs with its queue unread. No event tells of this.
    let recorder = process_of(&ns, "recorder");
    kill("-STOP", &[recorder]);
    std::thread::sleep(std::time::Duration::from_millis(200));
    kill("-KILL", &[recorder]);
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.run();
    let told: Vec<(u64, String)> = events(&run).into_iter().map(|(epoch, what, _)| (epoch, what)).collect();
    assert_eq!(told, [(1, "died"), (2, "started"), (2, "took-over")].map(|(epoch, what)| (epoch, what.to_owned())));
    let log = log_of(&outcome);
    assert_eq!(run["log"]["dropped"], 0);
    assert_eq!(log.tick_by_tick().count(), 5 * 30_001);
    assert!(log.complete() && !outcome.out.join("flight.1.rest.mcap").exists());
}

#[test]
fn a_recorder_that_stands_still_holds_up_no_lockstep_flight() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=300.0"]);
    let log = flight.out.join("flight.mcap");
    wait_until("something is recorded", || log.metadata().is_ok_and(|log| log.len() > 65_536));
    kill("-STOP", &[process_of(&ns, "recorder")]);
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.run();
    let told: Vec<String> = events(&run).into_iter().map(|(_, what, _)| what).collect();
    assert_eq!(told, ["hung", "started", "took-over"]);
    assert_eq!(run["log"]["dropped"], 0);
    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert!(log.complete() && log.states.iter().map(|state| state.stamp.tick).eq(0..=30_000));
}

#[test]
fn a_flight_whose_recorder_and_launcher_were_killed_is_reported_from_all_that_was_recorded() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime", "--set", PATIENT]);
    wait_until_it_flies(&ns);
    kill("-KILL", &[process_of(&ns, "recorder")]);
    let second = flight.out.join("flight.2.mcap");
    wait_until("the next recorder has written", || second.metadata().is_ok_and(|part| part.len() > 150_000));
    // The launcher is stopped, so that it replaces none and writes nothing more. The recorder is killed before it: a
    // recorder closes its file when the launcher is gone.
    kill("-STOP", &[flight.child.id() as i32]);
    kill("-KILL", &processes_named(&ns, "recorder"));
    kill("-KILL", &processes_of(&ns));
    let outcome = flight.finish();

    let report = launcher().arg("report").arg(&outcome.out).output().expect("the launcher starts");
    let told = String::from_utf8_lossy(&report.stderr);
    assert_eq!(report.status.code(), Some(0), "{told}");
    let last = log::read(&second).expect("the part reads").states.last().expect("a state").stamp.tick as f64 * 0.01;
    let ends = format!("what was read ends at {last:.2} s");
    for part in ["flight.mcap: ", "flight.2.mcap: ", &ends, "messages before that are missing"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let page = std::fs::read_to_string(outcome.out.join("report.html")).expect("the page reads");
    for part in [format!("this summary is made from the log) at {last:.2} s"), "The log is not whole".into()] {
        assert!(page.contains(&part), "{part}");
    }
    assert!(second.exists(), "the parts stay as they are");

    // The next launcher removes what the killed one left in shared memory.
    Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=0.5"]).finish();
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_recorder_that_dies_four_times_is_given_up_with_what_was_recorded_until_then() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime", "--set", "run.duration_s=20.0", "--set", PATIENT]);
    wait_until_it_flies(&ns);
    for epoch in 1..=4 {
        wait_until("the next recorder has joined", || {
            flight.out.join("flight.mcap").exists() && {
                let part = log::part(&flight.out.join("flight.mcap"), epoch);
                part.metadata().is_ok_and(|part| part.len() > 0) && !processes_named(&ns, "recorder").is_empty()
            }
        });
        kill("-KILL", &[process_of(&ns, "recorder")]);
    }
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(3), "{}", outcome.stderr);
    let (run, log) = (outcome.run(), log::read(&outcome.out.join("flight.mcap")).expect("the log reads"));
    let there = log.tick_by_tick().count();
    let dropped = run["log"]["dropped"].as_u64().expect("a number");
    assert!(dropped > 0 && log.complete(), "{dropped}");
    check_whole(&log.states);
    assert!(there > 0 && outcome.stderr.contains("no recorder was left for the flight"), "{}", outcome.stderr);
}

#[test]
fn a_killed_launcher_leaves_a_log_up_to_its_last_tick() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime", "--set", PATIENT]);
    wait_until_it_flies(&ns);
    fly_on(&ns, 0.6);
    let seen_s = status(&ns)["time_s"].as_f64().expect("it flies");
    kill("-KILL", &[flight.child.id() as i32]);
    wait_until("the recorder has closed the log", || processes_of(&ns).is_empty());
    let out = flight.out.clone();
    let log = log::read(&out.join("flight.mcap")).expect("the log reads");
    assert!(log.complete(), "{:?}", log.defect);
    check_whole(&log.states);
    check_whole(&log.actuators);
    let last = log.states.last().expect("a state").stamp.tick;
    assert!(last as f64 >= seen_s * 100.0 - 1.0, "tick {last}, seen at {seen_s} s");
    let report = launcher().arg("report").arg(&out).output().expect("the launcher starts");
    let told = String::from_utf8_lossy(&report.stderr);
    assert!(told.contains("there is no run.json to say where the flight ended"), "{told}");
    flight.finish();
}

/// Kills the recorder at several moments from its start on. On a loaded machine the flight starts later.
#[test]
fn a_recorder_killed_in_a_short_flight_loses_nothing_once_the_flight_has_begun() {
    for after_ms in [0, 80, 160, 240, 320, 400, 480] {
        let ns = namespace();
        let flight = Flight::start(&ns, &["--mode", "realtime", "--set", "run.duration_s=0.9", "--set", PATIENT]);
        wait_until("the recorder is there", || !processes_named(&ns, "recorder").is_empty());
        std::thread::sleep(std::time::Duration::from_millis(after_ms));
        kill("-KILL", &processes_named(&ns, "recorder")); // on a loaded machine the flight may be over
        let outcome = flight.finish();
        if !outcome.out.join("run.json").exists() {
            assert_eq!(outcome.code(), Some(3), "after {after_ms} ms: {}", outcome.stderr);
            assert!(outcome.stderr.contains("the stack did not come up: recorder"), "{}", outcome.stderr);
            continue;
        }
        assert_eq!(outcome.code(), Some(0), "after {after_ms} ms: {}", outcome.stderr);
        assert_eq!(outcome.run()["log"]["dropped"], 0, "after {after_ms} ms");
        let log = log_of(&outcome);
        check_whole(&log.states);
        check_whole(&log.references);
        check_whole(&log.controls);
        check_whole(&log.actuators);
        check_truths(&log);
        let flown_s = outcome.run()["flown_s"].as_f64().expect("a time"); // a plant that sleeps flies on for a sample
        let last_s = log.states.last().map(|state| state.stamp.tick as f64 * 0.01).expect("a state");
        assert!((last_s - flown_s).abs() < 1e-9 && last_s > 0.9 - 1e-9, "after {after_ms} ms: {last_s} of {flown_s} s");
    }
}
