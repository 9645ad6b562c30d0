//! `trefoil compare`: recorded flights side by side.

use std::path::Path;
use std::process::Output;

use crate::harness::{PATIENT, fly, launcher};
use crate::replay::text;

fn compare(runs: &[&Path], more: &[&str]) -> Output {
    launcher().arg("compare").args(runs).args(more).output().expect("the launcher starts")
}

/// Returns the words that follow `begin` on the first line that starts with it.
fn line<'a>(text: &'a str, begin: &str) -> Vec<&'a str> {
    let line = text.lines().find(|line| line.starts_with(begin));
    line.unwrap_or_else(|| panic!("no line '{begin}': {text}"))[begin.len()..].split_whitespace().collect()
}

#[test]
fn flights_of_any_length_rate_and_mode_are_laid_side_by_side_and_over_each_other() {
    let long = fly(&["--mode", "inprocess", "--set", "run.duration_s=8.0"]);
    let fast = fly(&["--mode", "lockstep", "--set", "run.duration_s=2.0", "--set", "run.rate_hz=200"]);
    let real = fly(&[
        "--set",
        "run.duration_s=1.0",
        "--set",
        "name=\"real\"",
        "--set",
        "mission.trajectory=hover",
        "--set",
        PATIENT,
    ]);
    let page = tempfile::tempdir().expect("a temporary folder").path().join("side by side.html");
    std::fs::create_dir_all(page.parent().expect("a folder")).expect("made");
    let out = page.to_str().expect("a plain path");
    let output = compare(&[&long.out, &fast.out.join("flight.mcap"), &real.out], &["--out", out]);
    let said = text(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");

    assert_eq!(line(&said, "run.rate_hz"), ["100", "200", "100"]);
    assert_eq!(line(&said, "run.mode"), ["inprocess", "lockstep", "realtime"]);
    assert!(!said.contains("attitude.law"), "what is the same is not told: {said}");
    let flown_s = real.run()["flown_s"].as_f64().expect("a time"); // a sample more if the last one was skipped
    assert!(said.contains(&format!("Metrics, each over its whole flight, of 8.00, 2.00, {flown_s:.2} s")), "{said}");
    let told = line(&said, "position error, maximum [m]");
    let measured = [&long, &fast, &real].map(|run| format!("{:.4}", run.metric("max_position_error_m")));
    assert_eq!(told, measured);
    let misses = real.run()["timing"]["nodes"]["mixer"]["misses"].to_string();
    assert_eq!(line(&said, "mixer, misses"), ["-", "-", &misses], "only in real time is anything late");

    let html = std::fs::read_to_string(&page).expect("the page");
    assert_eq!(html.matches("\"span\":").count(), 11, "a plot for each quantity");
    let folder = |run: &Path| run.display().to_string();
    for told in [
        format!("survey ({})", folder(&long.out.join("flight.mcap"))),
        "\"label\":\"real\"".into(),
        "mission of real".into(),
    ] {
        assert!(html.contains(&told), "{told}");
    }
    let linked = html.replacen("https://github.com/leeoniya/uPlot", "", 1).contains("http"); // uPlot's licence
    assert!(said.contains(&format!("written to {out}")) && !linked, "{said}");
}

#[test]
fn a_torn_log_is_compared_as_far_as_it_goes() {
    let [whole, torn] = [(); 2].map(|()| fly(&["--mode", "inprocess", "--set", "run.duration_s=4.0"]));
    let log = torn.out.join("flight.mcap");
    let bytes = std::fs::read(&log).expect("a log");
    std::fs::write(&log, &bytes[..bytes.len() / 2]).expect("a shorter log");
    let output = compare(&[&whole.out, &torn.out], &[]);
    let said = text(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.starts_with("note: the log") && said.contains("Settings: all are the same"), "{said}");
    let named = compare(&[&whole.out, &torn.out], &["--out", torn.out.join("both").to_str().expect("a plain path")]);
    assert!(named.status.success() && torn.out.join("both.html").is_file(), "a page has its suffix: {}", text(&named));
    let beside = whole.out.with_file_name("compare.html");
    let html = std::fs::read_to_string(&beside).expect("beside the first run");
    assert!(said.contains(&format!("written to {}", beside.display())) && html.contains("is not whole"), "{said}");
}

#[test]
fn what_cannot_be_compared_is_told() {
    let run = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.2"]);
    let check = |runs: &[&Path], more: &[&str], part: &str| {
        let output = compare(runs, more);
        let said = text(&output);
        assert!(output.status.code() == Some(2) && said.contains(part), "{runs:?} {more:?} should say {part}: {said}");
    };
    check(&[&run.out], &[], "only 1 was provided");
    check(&[&run.out, &run.out.join("flight.mcap")], &[], "is named twice");
    check(&[&run.out, Path::new("no/such/run")], &[], "no/such/run");
    let other = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.2"]);
    check(&[&run.out, &other.out], &["--out", "no/such/folder/page.html"], "--out");
}
