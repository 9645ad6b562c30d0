//! A flying stack asked from outside.

use serde_json::Value;

use crate::harness::{Flight, launcher, namespace, wait_until};

/// What `status --json` says of a stack.
fn status(namespace: &str) -> Value {
    let output = launcher().args(["status", "--json"]).output().expect("status runs");
    let stacks: Value = serde_json::from_slice(&output.stdout).expect("status prints JSON");
    stacks.as_array().into_iter().flatten().find(|stack| stack["namespace"] == namespace).cloned().unwrap_or_default()
}

/// A flight in real time that is under way.
fn flying(namespace: &str, settings: &[&str]) -> Flight {
    let flight = Flight::start(namespace, &[&["--mode", "realtime", "--no-log"], settings].concat());
    wait_until("the stack flies", || status(namespace)["time_s"].as_f64() > Some(0.2));
    flight
}

#[test]
fn status_shows_every_node_of_a_flight() {
    let ns = namespace();
    let flight = flying(&ns, &["--set", "run.duration_s=2.0"]);
    let view = status(&ns);
    for (i, node) in ["plant", "guidance", "attitude-mpc", "mixer"].into_iter().enumerate() {
        let seen = &view["nodes"][i];
        assert_eq!([&seen["node"], &seen["epoch"], &seen["restarts"]], [&Value::from(node), &1.into(), &0.into()]);
        assert!(seen["pid"].as_u64() > Some(1) && seen["tick"].as_u64() > Some(10), "{seen}");
        assert!(seen["behind"].is_u64() && seen["age_ms"].is_number(), "{seen}");
        assert!(seen["refused"]["range"].is_u64(), "{seen}");
    }
    assert_eq!(view["events"], serde_json::json!([]));
    let text = launcher().arg("status").output().expect("status runs").stdout;
    let text = String::from_utf8(text).expect("text");
    assert!(text.contains(&ns) && text.contains("attitude-mpc") && text.contains("restarts"), "{text}");
    assert_eq!(flight.finish().code(), Some(0));
}
