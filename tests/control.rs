//! Commands to a flying stack: status, faults and their end.

use flight::control::{ControlRequest, ask};
use runtime::domain::Domain;
use serde_json::Value;
use settings::fault_schedule::MAX_LIVE_FAULTS;
use settings::{Fault, FaultKind, FaultTarget, from_merged};

use crate::harness::{Flight, PATIENT, land, launcher, namespace, shared_memory_of, wait_until};

/// Returns the answer of `status --json` for a stack; null if it does not fly.
pub fn status(namespace: &str) -> Value {
    let output = launcher().args(["status", "--json", "--namespace", namespace]).output().expect("status runs");
    let stacks: Value = serde_json::from_slice(&output.stdout).unwrap_or_default(); // nothing is printed without a stack
    stacks[0].clone()
}

/// Waits until the flight of `namespace` is `seconds` further, in simulated time.
pub fn fly_on(namespace: &str, seconds: f64) {
    let time_s = || status(namespace)["time_s"].as_f64();
    let until_s = time_s().expect("it flies") + seconds;
    wait_until("the flight is further", || time_s().is_some_and(|time_s| time_s >= until_s));
}

/// Runs a command on a stack; returns stdout if it succeeds, stderr if it is refused.
pub fn tell(namespace: &str, words: &[&str]) -> Result<String, String> {
    let output = launcher().args(words).args(["--namespace", namespace]).output().expect("the command runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    match output.status.code() {
        Some(0) => Ok(text(output.stdout)),
        code => Err(format!("{code:?} {}", text(output.stderr))),
    }
}

/// Starts a flight in which no process counts as hung, and waits until it is under way.
pub fn flying(namespace: &str, settings: &[&str]) -> Flight {
    let flight = Flight::start(namespace, &[&["--no-log", "--set", PATIENT], settings].concat());
    wait_until("the stack flies", || status(namespace)["time_s"].as_f64() > Some(0.2));
    flight
}

#[test]
fn status_shows_every_node_of_a_flight() {
    let ns = namespace();
    let flight = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    let view = status(&ns);
    for (i, node) in ["plant", "guidance", "attitude-mpc", "mixer"].into_iter().enumerate() {
        let seen = &view["nodes"][i];
        assert_eq!([&seen["node"], &seen["epoch"], &seen["restarts"]], [&Value::from(node), &1.into(), &0.into()]);
        assert!(seen["pid"].as_u64() > Some(1) && seen["tick"].as_u64() > Some(10), "{seen}");
        assert!(seen["behind"].is_u64() && seen["age_ms"].is_number(), "{seen}");
        assert!(seen["refused"]["range"].is_u64() && seen["misses"].is_u64(), "{seen}");
    }
    assert_eq!(view["events"], serde_json::json!([]));
    assert!(view["position_error_m"].as_f64() < Some(1.0) && view["mixer"].is_string(), "{view}");
    let of = |name: &str| launcher().args(["status", "--namespace", name]).output().expect("status runs");
    let (text, other) = (of(&ns).stdout, of("wtb-nobody-flies-here"));
    let text = String::from_utf8(text).expect("text");
    assert!(text.contains("position error") && !text.contains("epochstandby"), "{text}");
    let said = String::from_utf8_lossy(&other.stderr).into_owned();
    assert!(other.status.code() == Some(2) && said.contains("no stack is flying in namespace"), "{said}");
    assert!(text.contains(&ns) && text.contains("attitude-mpc") && text.contains("restarts"), "{text}");
    land(flight);
}

#[test]
fn a_watched_status_is_lines_for_a_pipe_and_ends_with_its_reader() {
    use std::io::{BufRead, BufReader, Read};
    let watch = |arguments: &[&str]| {
        let mut command = launcher();
        command.args(["status", "--watch"]).args(arguments).stdout(std::process::Stdio::piped());
        let mut child = command.spawn().expect("status runs");
        (BufReader::new(child.stdout.take().expect("a pipe")), child)
    };
    let (mut lines, mut child) = watch(&["--json"]);
    for _ in 0..2 {
        let mut line = String::new();
        lines.read_line(&mut line).expect("a line");
        assert!(serde_json::from_str::<Value>(&line).expect("a document").is_array(), "{line}");
    }
    drop(lines);
    assert!(child.wait().expect("it ends").success());

    let (mut text, mut child) = watch(&[]);
    let mut first = [0; 40];
    text.read_exact(&mut first).expect("two looks");
    assert!(!first.contains(&0x1b), "no escapes for a pipe");
    drop(text);
    assert!(child.wait().expect("it ends").success());
}

#[test]
fn a_flight_is_broken_and_mended_from_outside() {
    let ns = namespace();
    let settings = ["--set", "run.duration_s=3600.0", "--set", "bounds.max_position_error_m=10.0"];
    let flight = flying(&ns, &[&["scenarios/faults/hover-gusts.toml"], &settings[..]].concat());
    let done = |words: &[&str]| tell(&ns, words).unwrap_or_else(|error| panic!("{words:?}: {error}"));
    assert!(done(&["inject", "wind", "step", "--vector", "-1,0,0", "--for", "inf"]).contains("to the end"));
    assert!(done(&["inject", "controls", "garbage"]).starts_with("injected: controls garbage from"));
    wait_until("the mixer refuses", || status(&ns)["nodes"][3]["refused"]["range"].as_u64() >= Some(5));
    done(&["inject", "position", "wrong", "--value", "-0.1", "--for", "60s", "--in", "0.05s"]);
    wait_until("the position is wrong", || status(&ns)["faults"].to_string().contains("position"));
    done(&["inject", "guidance", "kill"]);
    done(&["inject", "payload", "mass", "--in", "3000s"]);
    wait_until("guidance was restarted", || status(&ns)["nodes"][1]["restarts"].as_u64() >= Some(1));
    assert!(done(&["clear", "wind"]).starts_with("cleared: wind step"));
    assert!(done(&["clear"]).contains("payload mass"));
    let nothing = done(&["clear", "wind"]);
    let named = format!("in 'hover-gusts' in namespace '{ns}', process {}, flying for ", flight.child.id());
    assert!(nothing.starts_with("no fault was active\n") && nothing.contains(&named), "{nothing}");
    for (words, expected) in [
        (["inject", "mpc", "kill"], "mpc cannot have kill"),
        (["inject", "rudder", "kill"], "unknown variant `rudder`, expected one of `plant`"),
        (["inject", "wind", "breeze"], "unknown variant `breeze`"),
    ] {
        let error = tell(&ns, &words).expect_err("refused");
        assert!(error.starts_with("Some(2)") && error.contains(expected), "{error}");
    }

    fly_on(&ns, 1.0); // the vehicle recovers
    done(&["stop"]);
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
    let run = outcome.run();
    assert!(run["bounds"].as_array().expect("bounds").iter().all(|bound| bound["ok"] == true), "{}", run["bounds"]);
    let [wind, garbage, position, kill, mass] = std::array::from_fn(|i| &run["faults"][i]);
    for struck in [garbage, kill] {
        assert!(struck["injected_at_s"].is_number() && struck["recovered_after_s"].is_number(), "{struck}");
    }
    assert!(wind["injected_at_s"].is_number() && wind["for_s"].as_f64() < run["flown_s"].as_f64(), "{wind}");
    assert!(position["injected_at_s"].is_number(), "{position}");
    assert_eq!([&mass["injected_at_s"], &mass["for_s"]], [&Value::Null, &Value::from(0.0)]);
    assert!(run["refused"]["mixer"]["range"].as_u64() > Some(0), "{}", run["refused"]);
    let events = run["events"].as_array().expect("events");
    let user = rustix::process::getuid().as_raw();
    let by_hand = |event: &Value| event["by"]["user"] == user && event["by"]["pid"].as_u64() > Some(1);
    for event in events {
        let what = event["what"].as_str().expect("a word");
        assert_eq!(by_hand(event), ["injected", "cleared"].contains(&what), "{event}");
    }
    let count = |what: &str| events.iter().filter(|event| event["what"] == what).count();
    assert!(count("injected") == 5 && count("cleared") >= 3 && count("took-over") >= 1, "{events:?}");
    let settings = std::fs::read_to_string(outcome.out.join("scenario.toml")).expect("the settings");
    let flown = from_merged(&settings, "scenario.toml").expect("it can be flown again").fault;
    assert_eq!(flown.len(), 5);
    assert_eq!(flown[0].for_s, wind["for_s"].as_f64());
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn what_cannot_be_done_is_refused_with_the_reason() {
    let error = tell(&namespace(), &["inject", "wind", "step"]).expect_err("nobody flies");
    assert!(error.contains("no stack runs"), "{error}");

    // Requests that are invalid for every flight are refused before any flight is contacted.
    for (words, expected) in [
        (&["inject", "rates", "wrong", "--value", "nan"][..], "`value` = NaN, which is out of range"),
        (&["inject", "wind", "step", "--vector", "1,inf,0"], "`vector` of -200 to 200"),
        (&["inject", "wind", "step", "--vector", "1,2"], "give three"),
        (&["inject", "state", "corrupt", "--count", "1000000000000"], "`count` of 1 to 10000"),
        (&["inject", "mixer", "slow", "--ms", "2min"], "`ms` of 0 to 60000"),
        (&["inject", "mixer", "slow", "--for", "nan"], "'nan' is no duration"),
        (&["inject", "mixer", "slow", "--for", "0s"], "a time above 0"),
        (&["inject", "rotr1", "off"], "did you mean `rotor1`?"),
        (&["inject", "mpc", "iteration_cop"], "did you mean `iteration-cap`?"),
        (&["clear", "mixr"], "did you mean `mixer`?"),
        (&["swap", "mixr"], "did you mean `mixer`?"),
    ] {
        let error = tell(&namespace(), words).expect_err("refused");
        assert!(error.starts_with("Some(2)") && error.contains(expected), "{words:?}: {error}");
    }

    let ns = namespace();
    let flight = flying(&ns, &["--mode", "lockstep", "--set", "run.duration_s=86400.0"]);
    for words in [&["inject", "wind", "step"][..], &["clear"]] {
        let error = tell(&ns, words).expect_err("it must repeat");
        assert!(error.starts_with("Some(2)") && error.contains("write the fault into its scenario"), "{error}");
    }
    tell(&ns, &["stop"]).expect("it ends");
    assert_eq!(flight.finish().code(), Some(130));
}

#[test]
fn a_flight_takes_so_many_faults_and_no_more() {
    let ns = namespace();
    let flight = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    let domain = Domain::find(&ns).expect("it flies");
    let later = ControlRequest::Inject { fault: Fault::new(FaultTarget::Payload, FaultKind::Mass, 3000.0, None) };
    for _ in 0..MAX_LIVE_FAULTS {
        ask(&domain, &later).expect("there is room");
    }
    let error = ask(&domain, &later).expect_err("no room").to_string();
    assert!(error.contains("128 faults") && error.contains("fly again"), "{error}");
    let cleared = ask(&domain, &ControlRequest::Clear { target: None }).expect("those that stand can end");
    assert_eq!(cleared.as_array().map(Vec::len), Some(MAX_LIVE_FAULTS));
    tell(&ns, &["stop"]).expect("it ends");
    assert_eq!(flight.finish().code(), Some(130));
}
