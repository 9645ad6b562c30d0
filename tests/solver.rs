//! Failures of the solver: no gap, no NaN, the same flight in every mode, and a report in run.json.

use contract::message::SolveStatus;
use serde_json::json;

use crate::harness::{Outcome, fly};
use flight::log;

const UPSET: &str = "scenarios/aggressive/upset.toml";
const KINDS: [&str; 3] = ["nan", "infeasible", "iteration-cap"];
const SOLVERS: [&str; 2] = ["attitude.mpc.solver=clarabel", "attitude.mpc.solver=active-set"];
/// Ticks on which the faults of these tests act.
const FAULTY: std::ops::Range<usize> = 30..40;

/// Flies the upset with a fault of the solver while the actuators are at their limits.
fn faulty(kind: &str, solver: &str, mode: &str) -> Outcome {
    let fault = format!("fault=[{{at_s=0.3, for_s=0.1, target=\"mpc\", kind=\"{kind}\"}}]");
    fly(&[UPSET, "--mode", mode, "--set", "attitude.mpc.constraints=cone", "--set", &fault, "--set", solver])
}

fn check_flies_on(kind: &str, solver: &str) {
    let outcome = faulty(kind, solver, "inprocess");
    assert_eq!(outcome.code(), Some(0), "{kind}, {solver}: {}", outcome.stderr);

    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert_eq!([log.controls.len(), log.actuators.len()], [log.states.len(); 2], "no tick without a command");
    for (controls, actuators) in log.controls.iter().zip(&log.actuators) {
        let command = actuators.command;
        let mut numbers = controls.demand.into_iter().chain(command.rotor_speed).chain([command.tilt_rad]);
        assert!(numbers.all(f64::is_finite), "{kind}, {solver}: {controls:?} {actuators:?}");
    }
    let failed = |tick: &usize| log.controls[*tick].status >= SolveStatus::LimitReached as u64;
    let failures: Vec<usize> = (0..log.controls.len()).filter(failed).collect();
    // A single iteration is sometimes enough.
    let expected: Vec<usize> = FAULTY.filter(|tick| kind != "iteration-cap" || failed(tick)).collect();
    assert!(!failures.is_empty() && failures == expected, "{kind}, {solver}: {failures:?}");

    let expected = json!([{
        "target": "mpc", "kind": kind, "at_s": 0.3, "for_s": 0.1, "injected_at_s": 0.3, "ended_at_s": 0.4,
        "detected_after_s": (failures[0] - FAULTY.start) as f64 / 100.0, "recovered_after_s": 0.0,
    }]);
    assert_eq!(outcome.run()["faults"], expected, "{solver}");
    let page = std::fs::read_to_string(outcome.out.join("report.html")).expect("the report reads");
    assert!(page.contains("id=\"faults\"") && page.contains(kind));
}

#[test]
fn a_failing_solver_costs_no_tick_and_no_nan() {
    for kind in KINDS {
        for solver in SOLVERS {
            check_flies_on(kind, solver);
        }
    }
}

#[test]
fn a_failing_solver_fails_the_same_way_in_every_mode() {
    for kind in KINDS {
        for solver in SOLVERS {
            let hash = |mode: &str| faulty(kind, solver, mode).state_hash();
            let inprocess = hash("inprocess");
            assert_eq!(inprocess, hash("inprocess"), "{kind}, {solver}, again");
            assert_eq!(inprocess, hash("lockstep"), "{kind}, {solver}");
        }
    }
}

#[test]
fn run_json_counts_every_tick_of_the_solver() {
    let run = fly(&[UPSET, "--mode", "inprocess", "--no-log", "--set", "attitude.mpc.constraints=cone"]).run();
    let solver = &run["solver"];
    let count = |key: &str| solver[key].as_u64().unwrap_or_else(|| panic!("no {key} in {solver}"));
    assert!(count("solved") > 0, "{solver}");
    let failed = ["limit_reached", "fallback", "bad_input"].map(count);
    assert_eq!(failed, [0; 3]);
    assert_eq!(count("explicit") + count("solved"), 1001);
    assert!(solver["iterations"]["max"].as_u64() > Some(0), "{solver}");
    assert_eq!(run["faults"], json!([]));
}
