//! Closed loops against the independent simulator's values, and the claims of the paper's section 5.

use crate::harness::{Outcome, fly};
use outcome::recorded::{Recorded, TimeSpan};
use outcome::ticks::Joined;
use serde_json::Value;
use view::report::claims::Reach;

/// Reference name of a metric, and ours.
const METRICS: [(&str, &str); 3] =
    [("max_e", "max_position_error_m"), ("rms_e", "rms_position_error_m"), ("iae", "position_error_integral_ms")];

fn case_file(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let stem: String = name.chars().map(plain).collect();
    let squeezed = stem.split('_').filter(|part| !part.is_empty()).collect::<Vec<_>>().join("_");
    format!("tests/reference/cases/{squeezed}.toml")
}

/// Returns the largest altitude errors from 10 to 50 s and in the rest of a flight, from its log \[m\].
fn altitude_errors_m(flown: &Outcome) -> [f64; 2] {
    let mut gathered = None;
    let read = Recorded::read_each(&flown.out, TimeSpan::ALL, |scenario, record| {
        let (joined, reach) = gathered.get_or_insert_with(|| (Joined::new(scenario, 0), Reach::new(scenario)));
        joined.observe(record, |tick| reach.observe(tick));
    });
    read.expect("a log");
    let (mut joined, mut reach) = gathered.expect("a message");
    joined.finish(|tick| reach.observe(tick));
    reach.altitude_m
}

fn check_inside(outcome: &Outcome, name: &str, expect: &Value) {
    let errors = METRICS.map(|(theirs, ours)| (theirs, outcome.metric(ours)));
    let [horizontal_m, vertical_m] = altitude_errors_m(outcome);
    for (theirs, value) in errors.into_iter().chain([("max_ez_h", horizontal_m), ("max_ez_v", vertical_m)]) {
        let [low, high] = [0, 1].map(|i| expect[theirs][i].as_f64().expect("a range"));
        assert!((low..=high).contains(&value), "{name}: {theirs} = {value}, expected {low} to {high}");
    }
    assert_eq!(outcome.metric("negative_squares"), 0.0, "{name}");
}

#[test]
fn val_closed_loop_cases() {
    let reference = include_str!("reference/reference.json");
    let reference: Value = serde_json::from_str(reference).expect("the reference is JSON");
    let cases = reference["closed_loop_cases"].as_array().expect("a list of cases");
    assert!(cases.len() >= 9);
    for case in cases {
        let name = case["name"].as_str().expect("a name");
        let outcome = fly(&[&case_file(name)]);
        if case["expect"]["unstable"] == Value::Bool(true) {
            let lost = outcome.run()["diverged"] == Value::Bool(true) || outcome.metric("max_position_error_m") > 10.0;
            assert!(lost, "{name} should be unstable");
        } else {
            check_inside(&outcome, name, &case["expect"]);
        }
    }
}

#[test]
fn the_papers_claims_hold_in_process_and_in_lockstep() {
    for mode in ["inprocess", "lockstep"] {
        let outcome = fly(&["scenarios/survey-paper.toml", "--mode", mode]);
        assert_eq!(outcome.code(), Some(0), "{mode}: {}", outcome.stderr);
        assert!(outcome.metric("max_position_error_m") < 0.7);
        let [horizontal_m, vertical_m] = altitude_errors_m(&outcome);
        assert!(horizontal_m < 0.1 && vertical_m < 0.2 && outcome.metric("max_altitude_error_m") == vertical_m);
        assert_eq!(outcome.metric("commands_saturated"), 0.0);
    }
}

#[test]
fn the_robust_profile_follows_within_six_centimetres() {
    for mode in ["inprocess", "lockstep"] {
        let outcome = fly(&["scenarios/survey.toml", "--mode", mode, "--no-log"]);
        assert_eq!(outcome.code(), Some(0), "{mode}: {}", outcome.stderr);
        assert!(outcome.metric("max_position_error_m") <= 0.06);
    }
}

#[test]
fn every_shipped_scenario_flies_inside_its_bounds() {
    let folders = ["scenarios", "scenarios/aggressive", "scenarios/faults", "scenarios/missions"]
        .map(|name| crate::harness::top().join(name));
    let entries = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("a folder"));
    for path in entries.map(|entry| entry.expect("an entry").path()).filter(|path| path.is_file()) {
        let outcome = fly(&[path.to_str().expect("a plain name"), "--mode", "inprocess", "--no-log"]);
        assert_eq!(outcome.code(), Some(0), "{}: {}", path.display(), outcome.stderr);
    }
}
