//! `trefoil swap` in real time: a good candidate is kept, a bad one rejected, the flight goes on, and can
//! be repeated.

use std::path::{Path, PathBuf};
use std::{fs, thread};

use contract::topic::Topic;
use flight::control::{ControlRequest, ask};
use runtime::domain::Domain;
use serde_json::{Value, json};
use settings::{Swap, from_merged};

use crate::control::{flying, status, tell};
use crate::harness::{Outcome, fly, launcher, namespace, shared_memory_of, wait_until, write_script};
use crate::swap::endings;

const HOVER: &str = "scenarios/faults/hover-gusts.toml";
/// Tolerance of a swap: on a busy machine every node is sometimes late.
const PATIENT: &str = "ticks=100";

/// Runs `trefoil swap` in a stack; returns its exit code and its output.
fn swap(namespace: &str, words: &[&str]) -> (Option<i32>, String) {
    let mut command = launcher();
    command.arg("swap").args(words).args(["--standby", "0.2s", "--watch", "0.3s", "--namespace", namespace]);
    let output = command.output().expect("swap runs");
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).expect("text"))
}

/// Runs a swap that must end with this exit code; returns its output.
fn swapped(namespace: &str, words: &[&str], code: i32) -> String {
    let (ended, said) = swap(namespace, words);
    assert_eq!(ended, Some(code), "{words:?}: {said}");
    said
}

/// Returns the path of the settings that the flight left in its folder.
fn settings(outcome: &Outcome) -> PathBuf {
    outcome.out.join("scenario.toml")
}

fn swaps(outcome: &Outcome) -> Vec<Swap> {
    let text = fs::read_to_string(settings(outcome)).expect("the settings");
    from_merged(&text, "scenario.toml").expect("they can be flown").swap
}

/// Writes a program that sleeps until it is killed; returns its path.
fn sleeper(folder: &Path) -> String {
    let path = folder.join("sleeper");
    write_script(&path, "#!/bin/sh\nexec sleep 1000\n");
    path.to_str().expect("text").into()
}

/// Returns the path of the example `own_controller` of `runtime`, as built beside the launcher.
fn own_controller() -> String {
    let path = Path::new(env!("CARGO_BIN_EXE_trefoil")).with_file_name("examples").join("own_controller");
    let how = "cargo build --workspace --example own_controller (cargo test --workspace does it too)";
    assert!(path.exists(), "{} is missing; build it: {how}", path.display());
    path.to_str().expect("text").into()
}

#[test]
fn a_flight_with_a_swap_by_hand_is_replayed() {
    let ns = namespace();
    let flight = flying(&ns, &[HOVER, "--set", "run.duration_s=20.0"]);
    let said = swapped(&ns, &["attitude-mpc", "--set", "attitude.law=lqr", "--bounds", PATIENT], 0);
    assert!(said.contains("epoch 2 on-standby") && said.contains("epoch 2 kept"), "{said}");
    let garbage = "fault=[{at_s=0, target=\"controls\", kind=\"garbage\"}]";
    let said = swapped(&ns, &["attitude-mpc", "--set", garbage, "--may-fail", "--bounds", "ticks=20"], 1);
    assert!(said.contains("cannot be used"), "{said}");
    swapped(&ns, &["mixer", "--exec", "/bin/false", "--may-fail"], 1);
    let said = swapped(&ns, &["mixer", "--bounds", PATIENT, "--json"], 0);
    let story: Value = serde_json::from_str(&said).expect("JSON");
    assert_eq!(story.as_array().and_then(|story| story.last()).map(|event| &event["what"]), Some(&json!("kept")));
    let restarts = || [2, 3].map(|i| status(&ns)["nodes"][i]["restarts"].clone());
    assert_eq!(restarts(), [json!(0), json!(0)], "a candidate is no restart");

    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.run();
    let [law, wrong, ended, again] = swaps(&outcome).try_into().expect("four of them");
    assert!(law.standby_s > 0.2, "ordered before it was ready: {law:?}");
    assert_eq!(wrong.watch_s, 0.0, "never active");
    assert!(ended.at_s < again.at_s && again.standby_s > 0.2, "{ended:?} {again:?}");

    let file = settings(&outcome);
    let file = file.to_str().expect("text");
    assert_eq!(launcher().args(["check", file]).output().expect("check runs").status.code(), Some(0));
    let repeated = fly(&[file, "--mode", "lockstep", "--no-log"]);
    assert_eq!(repeated.code(), Some(0), "{}", repeated.stderr);
    for (node, expected) in [("attitude-mpc", ["kept", "rejected"]), ("mixer", ["rejected", "kept"])] {
        for run in [&run, &repeated.run()] {
            assert_eq!(endings(run, node), expected, "{}", run["events"]);
        }
    }
}

#[test]
fn another_program_may_take_over_if_it_does_its_work() {
    let ns = namespace();
    let flight = flying(&ns, &[HOVER, "--set", "run.duration_s=20.0", "--set", "supervision.start_limit_s=5"]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let said = swapped(&ns, &["attitude-mpc", "--exec", &sleeper(folder.path())], 1);
    assert!(said.contains("rejected"), "{said}");
    let bounds = format!("{PATIENT},difference=1,similarity=-1,error_m=10");
    let said = swapped(&ns, &["attitude-mpc", "--exec", &own_controller(), "--bounds", &bounds], 0);
    assert!(said.contains("kept"), "{said}");
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(1), "the first was not allowed to fail: {}", outcome.stderr);
    assert_eq!(endings(&outcome.run(), "attitude-mpc"), ["rejected", "kept"]);
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_swap_is_seen_while_it_lasts_and_others_are_refused_meanwhile() {
    let ns = namespace();
    let later = "swap=[{at_s=2000, node=\"mixer\"}]";
    let flight = flying(&ns, &["--set", "run.duration_s=3600.0", "--set", later]);
    let said = swapped(&ns, &["plant"], 2);
    assert!(said.contains("it is the vehicle"), "{said}");
    let said = swapped(&ns, &["recorder"], 2);
    assert!(said.contains("a recorder is not swapped; kill it"), "{said}");
    let error = tell(&ns, &["swap", "mixer", "--exec", "/no/such/program"]).expect_err("there is none");
    assert!(error.starts_with("Some(2)") && error.contains("cannot find the program"), "{error}");
    let error = tell(&ns, &["swap", "mixer", "--watch", "3000s"]).expect_err("the scenario's is in its way");
    assert!(error.starts_with("Some(2)") && error.contains("two swaps of mixer at once"), "{error}");
    let domain = Domain::find(&ns).expect("it flies");
    let order = ControlRequest::Swap(Swap::new(Topic::Actuators, 0.0));
    ask(&domain, &order).expect("the first order");
    ask(&domain, &order).expect_err("whether the first has begun or not");
    let waiting = ["swap", "guidance", "--standby", "3000s", "--bounds", "ticks=100000"];
    thread::scope(|scope| {
        let waiting = scope.spawn(|| tell(&ns, &waiting).expect_err("it does not come to an end"));
        // The epochs vary, since a loaded machine may delay a node until it is replaced.
        let epochs = || ["epoch", "standby"].map(|who| status(&ns)["nodes"][1][who].as_u64());
        wait_until("two work for guidance", || epochs().iter().all(Option::is_some) || waiting.is_finished());
        let [epoch, standby] = epochs().map(|epoch| epoch.expect("both work").to_string());
        let table = launcher().arg("status").output().expect("status runs").stdout;
        let table = String::from_utf8(table).expect("text");
        let row = |line: &str| line.split_whitespace().take(3).eq(["guidance", &epoch, &standby]);
        assert!(table.contains("standby") && table.lines().any(row), "{table}");
        let said = swapped(&ns, &["guidance"], 2);
        assert!(said.contains("guidance has a candidate already"), "{said}");
        tell(&ns, &["stop"]).expect("it ends");
        let error = waiting.join().expect("it waited");
        assert!(error.starts_with("Some(3)") && error.contains("the flight ended before the swap did"), "{error}");
    });
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
    assert_eq!(swaps(&outcome).len(), 3);
}
