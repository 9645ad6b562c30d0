//! Recorders that are swapped, die or stand still: the flight goes on, and of its log nothing is missing that was not
//! said to be.

use contract::message::Message;
use contract::stamp::delivery;
use flight::log::{self, Log};
use serde_json::{Value, json};

use crate::harness::{Flight, Outcome, fly, launcher, namespace, shared_memory_of, wait_until};
use crate::processes::{kill, process_of, processes_named, processes_of, wait_until_it_flies};

/// Messages that come twice, out of order, bent and old.
const FAULTS: &str = "fault=[\
    {at_s=0.2, target=\"reference\", kind=\"duplicate\"}, {at_s=0.4, for_s=0.2, target=\"state\", kind=\"reorder\"}, \
    {at_s=0.7, for_s=0.6, target=\"controls\", kind=\"corrupt\"}, {at_s=0.9, for_s=0.3, target=\"state\", kind=\"stale\"}]";

/// Reads the log of a flight, which must be whole.
fn log_of(outcome: &Outcome) -> Log {
    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert!(log.complete(), "{:?}", log.defect);
    log
}

/// Sender, content and tick of each message, in the order of the log: all of a message but the times it took.
fn sent<M: Message>(messages: &[M]) -> Vec<(u64, u64, u64, u64, [u64; 4])> {
    let stamps = messages.iter().map(Message::stamp);
    stamps.map(|stamp| (stamp.epoch, stamp.sequence, stamp.tick, stamp.delivery, stamp.inputs)).collect()
}

/// Epoch, event, and time of what happened to the recorder.
fn events(run: &Value) -> Vec<(u64, String, f64)> {
    let all = run["events"].as_array().expect("events").iter().filter(|event| event["node"] == "recorder");
    let told = |event: &Value| {
        let what = event["what"].as_str().expect("a word").to_owned();
        (event["epoch"].as_u64().expect("an epoch"), what, event["at_s"].as_f64().expect("a time"))
    };
    all.map(told).collect()
}

#[test]
fn in_lockstep_the_log_is_the_same_with_and_without_swaps() {
    let flown = |swaps: &str| {
        let settings = ["--set", "run.duration_s=1.5", "--set", FAULTS, "--set", swaps];
        let outcome = fly(&[&["scenarios/faults/hover-gusts.toml", "--mode", "lockstep"], &settings[..]].concat());
        assert_eq!(outcome.code(), Some(0), "{swaps}: {}", outcome.stderr);
        assert_eq!(outcome.run()["log"]["dropped"], 0, "{swaps}");
        outcome
    };
    let plain = flown("swap=[]");
    let swapped = flown(
        "swap=[{at_s=0.0, node=\"recorder\"}, {at_s=0.5, node=\"recorder\"}, {at_s=0.8, node=\"recorder\", exec=\"false\", may_fail=true}, \
         {at_s=1.0, node=\"recorder\"}]",
    );
    assert_eq!(plain.state_hash(), swapped.state_hash());
    let (one, other) = (log_of(&plain), log_of(&swapped));
    assert_eq!(sent(&one.states), sent(&other.states));
    assert_eq!(sent(&one.references), sent(&other.references));
    assert_eq!(sent(&one.controls), sent(&other.controls));
    assert_eq!(sent(&one.actuators), sent(&other.actuators));
    assert!(one.truths == other.truths);
    let story = [
        (2, "started", 0.0),
        (2, "took-over", 0.0),
        (3, "started", 0.5),
        (3, "took-over", 0.5),
        (4, "started", 0.8),
        (4, "died", 0.8),
        (4, "rejected", 0.8),
        (5, "started", 1.0),
        (5, "took-over", 1.0),
    ];
    assert_eq!(events(&swapped.run()), story.map(|(epoch, what, at_s)| (epoch, what.to_owned(), at_s)));
    let logged: Vec<_> = other.events.iter().map(|event| (event.epoch, json!(event.what))).collect();
    assert_eq!(logged, story.map(|(epoch, what, _)| (epoch as u32, json!(what))));
}

/// `trefoil swap` of the recorder of a stack; its exit code, and what it says.
fn swap(namespace: &str, more: &[&str]) -> (Option<i32>, String) {
    let mut command = launcher();
    command.args(["swap", "recorder", "--namespace", namespace]).args(more);
    let output = command.output().expect("swap runs");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

/// Every message of each epoch once, and none missing.
fn check_whole<M: Message>(messages: &[M]) {
    let stamps = messages.iter().map(Message::stamp).filter(|stamp| stamp.delivery == delivery::DELIVERED);
    let numbers: Vec<(u64, u64)> = stamps.map(|stamp| (stamp.epoch, stamp.sequence)).collect();
    assert_eq!(numbers.first().map(|(epoch, number)| (*epoch, *number)), Some((1, 1)), "{}", M::TOPIC.name());
    for pair in numbers.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        assert_eq!(pair[1].1, pair[0].1 + 1, "{}", M::TOPIC.name());
    }
}

/// A TRUTH for every STATE.
fn check_truths(log: &log::Log) {
    let (states, truths) = (log.states.iter().map(|state| state.stamp.tick), log.truths.iter().map(|truth| truth.tick));
    assert!(states.eq(truths), "{} and {}", log.states.len(), log.truths.len());
}

#[test]
fn in_real_time_nothing_is_lost_by_swaps() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime", "--set", "run.duration_s=2.5"]);
    wait_until_it_flies(&ns);
    for epoch in [2, 3] {
        let (code, said) = swap(&ns, &[]);
        assert!(code == Some(0) && said.contains(&format!("recorder epoch {epoch} took-over")), "{code:?} {said}");
    }
    let (code, said) = swap(&ns, &["--exec", "/bin/false", "--may-fail"]);
    assert!(code == Some(1) && said.contains("recorder epoch 4 rejected"), "{code:?} {said}");
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let log = log_of(&outcome);
    check_whole(&log.states);
    check_whole(&log.references);
    check_whole(&log.controls);
    check_whole(&log.actuators);
    check_truths(&log);
    assert!(log.states.len() > 100, "{}", log.states.len());
    assert_eq!(outcome.run()["log"]["dropped"], 0);
    let files = std::fs::read_dir(&outcome.out).expect("a folder").flatten().map(|entry| entry.file_name());
    assert_eq!(files.filter(|name| name.to_string_lossy().contains("mcap")).count(), 1);
    let scenario = outcome.out.join("scenario.toml");
    let check = launcher().arg("check").arg(scenario).output().expect("check runs");
    assert!(check.status.success(), "{}", String::from_utf8_lossy(&check.stderr));
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn without_a_log_there_is_no_recorder_to_replace() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime", "--no-log"]);
    wait_until("the swap is refused", || {
        let swap = launcher().args(["swap", "recorder", "--namespace", &ns]).output().expect("swap runs");
        swap.status.code() == Some(2)
            && String::from_utf8_lossy(&swap.stderr).contains("no recorder runs in this flight")
    });
    kill("-INT", &[flight.child.id() as i32]);
    assert_eq!(flight.finish().code(), Some(130));
}

#[test]
fn a_dead_recorder_is_replaced_and_nothing_dies_with_it() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=120.0"]);
    wait_until_it_flies(&ns);
    // While it hangs the plant waits for it, with all of its queue unread. That is in no event.
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
    assert_eq!(log.tick_by_tick().count(), 5 * 12_001);
    assert!(log.complete() && !outcome.out.join("flight.1.rest.mcap").exists());
}

#[test]
fn programs_that_do_not_record_are_rejected_and_nothing_is_missing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let script = |name: &str, text: &str| {
        let script = folder.path().join(name);
        std::fs::write(&script, text).expect("a script can be written");
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o700);
        std::fs::set_permissions(&script, mode).expect("it can be made a program");
        script.to_str().expect("its path is text").to_owned()
    };
    let cannot_start = script("cannot-start", "#!/no/such/interpreter\n");
    let never_ready = script("never-ready", "#!/bin/sh\nexec sleep 100\n");
    // The last is our own program, then one that is still waited for when the flight ends, or was killed.
    let programs = ["/bin/false", "/bin/true", &cannot_start, "", &never_ready];
    let swap = |(i, program): (usize, &&str)| {
        let exec = if program.is_empty() { String::new() } else { format!(", exec={program:?}") };
        format!("{{at_s={}, node=\"recorder\"{exec}}}", i + 1)
    };
    let swaps = format!("swap=[{}]", programs.iter().enumerate().map(swap).collect::<Vec<_>>().join(", "));
    let ns = namespace();
    let outcome = Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=40.0", "--set", &swaps]).finish();

    assert_eq!(outcome.code(), Some(1), "one could not be tried: {}", outcome.stderr);
    let run = outcome.run();
    let all = events(&run).into_iter().map(|(_, what, _)| what);
    let endings: Vec<String> = all.filter(|what| !["started", "died", "hung"].contains(&&**what)).collect();
    assert!(endings.join(" ").starts_with("rejected rejected not-started rejected took-over"), "{}", run["events"]);
    assert_eq!(run["log"]["dropped"], 0);
    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert!(log.complete());
    assert!(log.states.iter().map(|state| state.stamp.tick).eq(0..=4000));
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    assert_eq!(processes_of(&ns), Vec::<i32>::new());
}

#[test]
fn a_recorder_that_stands_still_holds_up_no_lockstep_flight() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "lockstep"]);
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
    assert!(log.complete() && log.states.iter().map(|state| state.stamp.tick).eq(0..=6000));
}

#[test]
fn a_flight_whose_recorder_and_launcher_were_killed_is_reported_from_all_that_was_recorded() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime"]);
    wait_until_it_flies(&ns);
    kill("-KILL", &[process_of(&ns, "recorder")]);
    let second = flight.out.join("flight.2.mcap");
    wait_until("the next recorder has written", || second.metadata().is_ok_and(|part| part.len() > 150_000));
    // The recorder first: it would close its file when the launcher is gone, as the launcher would have it do when the
    // plant is.
    let recorder = process_of(&ns, "recorder");
    let recorder_first = |pid: &i32| (*pid != recorder, *pid != flight.child.id() as i32);
    let mut all = processes_of(&ns);
    all.sort_by_key(recorder_first);
    kill("-KILL", &all);
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

    // What the killed launcher left in shared memory the next one wipes.
    Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=0.5"]).finish();
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_recorder_that_dies_four_times_is_given_up_with_what_was_recorded_until_then() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime", "--set", "run.duration_s=5.0"]);
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
    let flight = Flight::start(&ns, &["--mode", "realtime"]);
    wait_until_it_flies(&ns);
    std::thread::sleep(std::time::Duration::from_millis(600)); // less than the recorder flushes at once
    kill("-KILL", &[flight.child.id() as i32]);
    wait_until("the recorder has closed the log", || processes_of(&ns).is_empty());
    let out = flight.out.clone();
    let log = log::read(&out.join("flight.mcap")).expect("the log reads");
    assert!(log.complete(), "{:?}", log.defect);
    check_whole(&log.states);
    check_whole(&log.actuators);
    assert!(log.states.len() >= 50, "{}", log.states.len());
    let report = launcher().arg("report").arg(&out).output().expect("the launcher starts");
    let told = String::from_utf8_lossy(&report.stderr);
    assert!(told.contains("there is no run.json to say where the flight ended"), "{told}");
    flight.finish();
}

/// At any moment of it, from the start of the recorder on. A loaded machine takes longer to start, and the flight is
/// later.
#[test]
fn a_recorder_killed_in_a_short_flight_loses_nothing_once_the_flight_has_begun() {
    for after_ms in [0, 80, 160, 240, 320, 400, 480] {
        let ns = namespace();
        let flight = Flight::start(&ns, &["--mode", "realtime", "--set", "run.duration_s=0.9"]);
        wait_until("the recorder is there", || !processes_named(&ns, "recorder").is_empty());
        std::thread::sleep(std::time::Duration::from_millis(after_ms));
        kill("-KILL", &[process_of(&ns, "recorder")]);
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
        assert_eq!(log.states.last().map(|state| state.stamp.tick), Some(90), "after {after_ms} ms");
    }
}
