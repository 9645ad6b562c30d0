//! Faults of processes and topics: the same flight in every mode, an account of it in run.json, and survival.

use contract::Topic;
use serde_json::{Value, json};

use crate::harness::{Flight, Outcome, PATIENT, fly, namespace, shared_memory_of};

const HOVER: &str = "scenarios/faults/hover-gusts.toml";
const NODES: [&str; 3] = ["guidance", "attitude-mpc", "mixer"];

/// Flies the hover in gusts with one fault, from 1 s on for 0.3 s.
fn faulty(target: &str, kind: &str, mode: &str) -> Outcome {
    let fault = format!("fault=[{{at_s=1.0, for_s=0.3, target=\"{target}\", kind=\"{kind}\"}}]");
    fly(&[HOVER, "--mode", mode, "--no-log", "--set", "run.duration_s=3.0", "--set", &fault])
}

/// Flies [`faulty`] in both deterministic modes, which must agree; returns the lockstep flight.
fn check_same(target: &str, kind: &str) -> Outcome {
    let (inprocess, lockstep) = (faulty(target, kind, "inprocess"), faulty(target, kind, "lockstep"));
    assert_eq!(lockstep.code(), Some(0), "{target} {kind}: {}", lockstep.stderr);
    assert_eq!(inprocess.state_hash(), lockstep.state_hash(), "{target} {kind}");
    let account = |outcome: &Outcome| ["faults", "refused", "events"].map(|part| outcome.run()[part].clone());
    assert_eq!(account(&inprocess), account(&lockstep), "{target} {kind}");
    lockstep
}

/// Returns node, epoch and kind of each event, without the time, which in real time differs from flight to flight.
fn events(run: &Value) -> Vec<(String, u64, String)> {
    let word = |value: &Value| value.as_str().expect("a word").to_owned();
    let all = run["events"].as_array().expect("events").iter();
    all.map(|event| (word(&event["node"]), event["epoch"].as_u64().expect("an epoch"), word(&event["what"]))).collect()
}

fn expected(node: &str, story: &[(u64, &str)]) -> Vec<(String, u64, String)> {
    story.iter().map(|(epoch, what)| (node.to_owned(), *epoch, (*what).to_owned())).collect()
}

#[test]
fn a_killed_node_is_replaced_on_the_same_tick_in_every_mode() {
    for node in NODES {
        let run = check_same(node, "kill").run();
        assert_eq!(events(&run), expected(node, &[(1, "died"), (2, "started"), (2, "took-over")]));
        let fault = &run["faults"][0];
        let times = ["injected_at_s", "detected_after_s", "recovered_after_s"].map(|key| fault[key].as_f64());
        // The fault holds the restart off for 0.3 s, and the next process is ready 25 ms later.
        assert_eq!(times, [Some(1.0), Some(0.0), Some(0.33)], "{node}");
    }
}

#[test]
fn a_hung_node_is_replaced_on_the_same_tick_in_every_mode() {
    for node in NODES {
        let run = check_same(node, "stop").run();
        assert_eq!(events(&run), expected(node, &[(1, "hung"), (2, "started"), (2, "took-over")]));
        assert_eq!(run["faults"][0]["recovered_after_s"], 0.05, "{node}: three ticks until noticed, and a restart");
    }
}

#[test]
fn a_slow_node_is_the_same_flight_in_every_mode() {
    for node in ["plant", "guidance", "attitude-mpc", "mixer"] {
        let run = check_same(node, "slow").run();
        assert_eq!(events(&run), []);
        assert_eq!(run["faults"][0]["injected_at_s"], 1.0);
    }
}

#[test]
fn a_plant_that_dies_ends_the_flight_in_every_mode() {
    for mode in ["inprocess", "lockstep"] {
        let outcome = faulty("plant", "kill", mode);
        assert_eq!(outcome.code(), Some(3), "{mode}: {}", outcome.stderr);
        assert!(outcome.run()["ended"].as_str().is_some_and(|ended| ended.contains("plant")), "{mode}");
    }
}

#[test]
fn every_fault_of_a_topic_is_the_same_flight_in_every_mode() {
    let kinds = ["drop", "burst", "delay", "duplicate", "reorder", "corrupt", "garbage", "stale", "rate"];
    for (i, kind) in kinds.into_iter().enumerate() {
        let topic = Topic::ALL[1 + i % 3].name().to_lowercase(); // not STATE, without which the hover is lost
        let fault = check_same(&topic, kind).run()["faults"][0].clone();
        assert!(fault["injected_at_s"].as_f64() >= Some(1.0), "{fault}");
    }
}

#[test]
fn lost_demands_are_noticed_and_got_over() {
    let fault = check_same("controls", "corrupt").run()["faults"][0].clone();
    let expected = json!({
        "target": "controls", "kind": "corrupt", "at_s": 1.0, "for_s": 0.3,
        "injected_at_s": 1.0, "ended_at_s": 1.3, "detected_after_s": 0.01, "recovered_after_s": 0.0,
    });
    assert_eq!(fault, expected, "the first tick is flown with the demand before");
}

/// Checks that the first process of `node` ended with the event `first`, and that a later process became active. A
/// loaded machine may delay another process, of any node, for so long that it counts as hung and is replaced too.
fn check_replaced(events: &[(String, u64, String)], node: &str, first: &str) {
    let of_node: Vec<_> =
        events.iter().filter(|event| event.0 == node).map(|event| (event.1, event.2.as_str())).collect();
    assert_eq!(of_node.first(), Some(&(1, first)), "{events:?}");
    assert!(of_node.iter().any(|(epoch, what)| *epoch > 1 && *what == "took-over"), "{events:?}");
}

/// The restart is held off for so long that samples are missed, or not at all: then the next process may answer the
/// next sample.
#[test]
fn a_kill_in_real_time_is_detected_and_survived() {
    for (node, held_off) in NODES.into_iter().flat_map(|node| ["for_s=0.1, ", ""].map(|held_off| (node, held_off))) {
        let ns = namespace();
        let fault = format!("fault=[{{at_s=1.0, {held_off}target=\"{node}\", kind=\"kill\"}}]");
        // No process counts as hung before the kill, on a loaded machine either.
        let settings = ["--mode", "realtime", "--set", "run.duration_s=4.0", "--set", &fault, "--set", PATIENT];
        let outcome = Flight::start(&ns, &settings).finish();
        assert_eq!(outcome.code(), Some(0), "{node}: {}", outcome.stderr);
        let run = outcome.run();
        check_replaced(&events(&run), node, "died");
        assert!(run["faults"][0]["detected_after_s"].is_number(), "{}", run["faults"]);
        assert!(run["faults"][0]["recovered_after_s"].is_number(), "{}", run["faults"]);
        assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    }
}

/// One state machine decides in both modes: its actions come in the same order, and only their times differ.
#[test]
fn a_node_is_replaced_by_the_same_events_in_lockstep_and_in_real_time() {
    // What is killed is held off for 0.3 s; what is stopped is found and killed long before it would go on.
    for (kind, for_s) in [("kill", 0.3), ("stop", 1.9)] {
        let fault = format!("fault=[{{at_s=1.0, for_s={for_s:?}, target=\"mixer\", kind=\"{kind}\"}}]");
        let patience = "supervision={hang_ms=150.0, start_limit_s=60.0}"; // longer than a busy machine stalls
        let settings = ["run.duration_s=3.0", &fault, patience];
        let set = settings.map(|setting| ["--set", setting]).concat();
        let of_mixer = |mode| {
            let run = fly(&[&[HOVER, "--mode", mode, "--no-log"], &set[..]].concat()).run();
            let events = events(&run).into_iter();
            events.filter(|event| event.0 == "mixer").take(3).collect::<Vec<_>>() // a loaded machine may add events
        };
        assert_eq!(of_mixer("lockstep"), of_mixer("realtime"), "{kind}");
    }
}

#[test]
fn a_plant_that_ends_by_itself_ends_the_flight() {
    let fault = "fault=[{at_s=0.3, target=\"plant\", kind=\"exit\"}]";
    let outcome = fly(&["--mode", "realtime", "--no-log", "--set", "run.duration_s=2.0", "--set", fault]);
    assert_eq!(outcome.code(), Some(3), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("a fault `exit` ended this process"), "{}", outcome.stderr);
    assert!(outcome.run()["flown_s"].as_f64().is_some_and(|flown_s| flown_s < 1.0));
}

#[test]
fn a_process_that_goes_wrong_by_itself_in_real_time_is_replaced() {
    // No process counts as hung before the exit, on a loaded machine either.
    for (kind, for_s, first, hang_ms) in [("exit", 0.5, "died", 60_000.0), ("hog", 2.5, "hung", 150.0)] {
        let ns = namespace();
        let fault = format!("fault=[{{at_s=1.0, for_s={for_s:?}, target=\"attitude-mpc\", kind=\"{kind}\"}}]");
        let patience = format!("supervision={{hang_ms={hang_ms:?}, start_limit_s=60.0}}");
        // Without a limit on its CPU time, what burns it hangs until the launcher sees it.
        let mut settings = vec!["--mode", "realtime", "--set", "run.duration_s=4.0", "--set=realtime.rttime_ms=0"];
        settings.extend(["--set", &fault, "--set", &patience]);
        let outcome = Flight::start(&ns, &settings).finish();
        assert_eq!(outcome.code(), Some(0), "{kind}: {}", outcome.stderr);
        check_replaced(&events(&outcome.run()), "attitude-mpc", first);
        assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    }
}

#[test]
fn a_process_that_is_stopped_when_the_flight_ends_goes_on_and_leaves() {
    let fault = "fault=[{at_s=0.8, for_s=60.0, target=\"guidance\", kind=\"stop\"}]";
    let settings = ["--mode", "realtime", "--no-log", "--set", "run.duration_s=1.0", "--set", fault, "--set", PATIENT];
    let outcome = fly(&settings);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
}

#[test]
fn a_flight_without_a_fault_raises_no_alarm() {
    let run = fly(&[HOVER, "--mode", "lockstep", "--no-log"]).run();
    assert_eq!(events(&run), []);
    let counts = run["refused"]
        .as_object()
        .expect("counts")
        .values()
        .flat_map(|node| node.as_object().expect("causes").values());
    assert_eq!(counts.map(|count| count.as_u64().expect("a count")).sum::<u64>(), 0, "{}", run["refused"]);
}

#[test]
fn a_vehicle_without_rotor_1_comes_down_softly_behind_an_ekf_late_commands_and_a_killed_mixer() {
    let settings = [
        "run.duration_s=30.0",
        "run.command_delay_ms=20.0",
        "mission.trajectory=hover",
        "plant.ground={present=true, down_m=10.0}",
        "plant.sensors.preset=typical",
        "mixer.broken_vehicle=descend",
        "bounds.max_position_error_m=inf",
        "fault=[{at_s=3.0, target=\"rotor1\", kind=\"off\"}, {at_s=7.0, target=\"mixer\", kind=\"kill\"}]",
    ];
    let set = settings.iter().flat_map(|setting| ["--set", setting]);
    let outcome = fly(&["--mode", "lockstep", "--no-log"].into_iter().chain(set).collect::<Vec<_>>());
    let sink_mps = outcome.metric("touchdown_sink_mps");
    assert!((0.1..2.0).contains(&sink_mps), "{sink_mps} m/s: {}", outcome.stderr);
}
