//! Deadline policies: handling of late messages, and the scheduling that the kernel grants.

use serde_json::Value;

use crate::harness::{Flight, Outcome, PATIENT, namespace};

/// Flies three seconds in real time. A process that a loaded machine delays is late, but not replaced.
fn fly(settings: &[&str]) -> Outcome {
    let set = ["--mode", "realtime", "--no-log", "--set", "run.duration_s=3.0", "--set", PATIENT].into_iter();
    let arguments: Vec<_> = set.chain(settings.iter().flat_map(|setting| ["--set", setting])).collect();
    Flight::start(&namespace(), &arguments).finish()
}

fn count(run: &Value, node: &str, what: &str) -> u64 {
    run["timing"]["nodes"][node][what].as_u64().unwrap_or_else(|| panic!("no {what} of {node}"))
}

/// No message is ready a microsecond after the sample.
const IMPOSSIBLE: &str = "node.mixer.deadline_ms=0.001";

#[test]
fn late_messages_are_sent_and_counted() {
    let outcome = fly(&[IMPOSSIBLE]);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.run();
    assert!(count(&run, "mixer", "misses") >= 90, "{run}");
    assert!(run["timing"]["age_at_actuator"]["n"].as_u64().is_some_and(|n| n > 50), "they arrive all the same");
}

#[test]
fn skipped_messages_never_arrive() {
    let run = fly(&[IMPOSSIBLE, "node.mixer.late=skip"]).run();
    assert_eq!(run["timing"]["age_at_actuator"]["n"], 0, "no command of the mixer is ever applied");
    assert_eq!(run["diverged"], Value::Bool(false));
}

#[test]
fn held_messages_repeat_the_last_timely_one() {
    // No command is in time. The first one is sent late, because there is none to repeat, and then repeated.
    let outcome = fly(&[IMPOSSIBLE, "node.mixer.late=hold", "mission.trajectory=hover"]);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    assert!(outcome.run()["timing"]["age_at_actuator"]["n"].as_u64().is_some_and(|n| n > 50));
}

#[test]
fn a_controller_that_is_late_does_without_its_solver() {
    let turn = [
        "mission.part=[{kind='loiter', duration_s=60, heading_deg=[[0.7, 90]]}]",
        "guidance.heading_rate_limit_dps=0",
        "attitude.mpc.constraints=cone",
        "attitude.mpc.r=[0.3, 70.0, 20.0, 100.0]",
        "node.attitude-mpc.deadline_ms=0.001",
    ];
    let solved = |outcome: &Outcome| outcome.run()["solver"]["solved"].as_u64().expect("a count");
    assert!(solved(&fly(&turn)) > 0, "the turn needs the solver");
    let hurried = fly(&[&turn[..], &["node.attitude-mpc.late=degrade"]].concat());
    assert_eq!(solved(&hurried), 0);
    assert!(hurried.run()["solver"]["fallback"].as_u64().is_some_and(|n| n > 0), "{}", hurried.run()["solver"]);
}

#[test]
fn the_policy_stop_ends_the_flight_with_its_own_code() {
    for node in ["plant", "mixer"] {
        let settings = [format!("node.{node}.deadline_ms=0.001"), format!("node.{node}.late=stop")];
        let outcome = fly(&settings.each_ref().map(String::as_str));
        assert_eq!(outcome.code(), Some(4), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("past its deadline of 0.001 ms"), "{}", outcome.stderr);
        let expected = format!("{node} missed its deadline");
        assert!(outcome.run()["ended"].as_str().is_some_and(|text| text.contains(&expected)), "{expected}");
    }
}

#[test]
fn what_was_asked_of_the_kernel_is_in_the_record() {
    let run = fly(&["realtime.affinity=[0]", "node.mixer.priority=40", "node.plant.policy=other"]).run();
    let scheduling = &run["provenance"]["scheduling"];
    assert_eq!(scheduling["guidance"]["affinity"], "0");
    assert_eq!(scheduling["plant"]["policy"], "other");
    if scheduling["guidance"]["policy"] == "fifo" {
        assert_eq!((&scheduling["guidance"]["priority"], &scheduling["mixer"]["priority"]), (&71.into(), &40.into()));
        assert_eq!(scheduling["guidance"]["rttime_us"], 500_000);
    }
}
