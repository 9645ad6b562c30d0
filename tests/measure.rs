//! `trefoil measure`: every promise has a verdict, and the raw samples are kept.
//! No time is judged here.

use std::path::Path;
use std::process::{Output, Stdio};

use serde_json::Value;

use crate::harness::{in_memory, launcher};

const QUICK: [&str; 2] = ["--rounds", "1"];

fn measure(arguments: &[&str], out: &Path) -> Output {
    launcher().args(["measure", "mpc"]).args(arguments).arg("--out").arg(out).output().expect("the launcher starts")
}

fn read(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).expect("the file is JSON")
}

/// Checks that only targets on times, which depend on the machine, are missed, and that the exit code agrees.
fn check_verdict(targets: &[Value], output: &Output) {
    let missed: Vec<&str> = targets
        .iter()
        .filter(|target| target["verdict"] == "short")
        .map(|target| target["figure"].as_str().expect("a figure"))
        .collect();
    let is_a_time =
        |figure: &&str| ["p50", "p99", "the longest step", "share of one core"].iter().any(|of| figure.contains(of));
    assert!(missed.iter().all(is_a_time), "missed, whatever the machine: {missed:?}");
    assert_eq!(output.status.code(), Some(i32::from(!missed.is_empty())), "the exit code is the verdict: {missed:?}");
}

#[test]
#[should_panic(expected = "missed, whatever the machine")]
fn a_missed_target_that_is_no_time_fails_a_test() {
    let missed = |figure: &str| serde_json::json!({ "figure": figure, "verdict": "short" });
    let output = std::process::Command::new("false").output().expect("a program that exits with 1");
    check_verdict(&[missed("active-set, p99")], &output);
    check_verdict(&[missed("active-set, steps without an optimum")], &output);
}

#[test]
fn every_target_has_a_verdict() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = measure(&[QUICK.as_slice(), &["--json"]].concat(), folder.path());
    let printed: Value = serde_json::from_slice(&output.stdout).expect("stdout is JSON");
    assert_eq!(printed, read(&folder.path().join("measure.json")));

    let targets = printed["targets"].as_array().expect("targets");
    let verdict = |figure: &str| {
        let target = targets.iter().find(|t| t["figure"].as_str().is_some_and(|f| f.starts_with(figure)));
        target.unwrap_or_else(|| panic!("no target '{figure}'"))["verdict"].as_str().expect("a verdict").to_owned()
    };
    // Targets that do not depend on the machine must be met.
    for figure in ["clarabel, steps without an optimum", "active-set, steps without an optimum"] {
        assert_eq!(verdict(figure), "ok", "{figure}: {printed}");
    }
    for figure in
        ["explicit path, p99", "clarabel, p99", "active-set, p50", "active-set, p99", "active-set, share", "navigation"]
    {
        assert!(["ok", "short"].contains(&verdict(figure).as_str()), "{figure} is measured");
    }
    check_verdict(targets, &output);
}

#[test]
fn the_samples_are_kept() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = measure(&["--rounds", "2"], folder.path());
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    let csv = std::fs::read_to_string(folder.path().join("samples.csv")).expect("samples.csv");
    for flight in ["survey", "upset", "yaw", "weak"] {
        let log = flight::log::read(&folder.path().join(flight).with_extension("mcap")).expect("the log reads");
        let lines = csv.lines().filter(|line| line.starts_with(&format!("{flight},"))).count();
        assert_eq!(lines, 6 * 2 * log.references.len(), "six controllers, two rounds");
        assert!(table.contains(flight), "{table}");
    }
    assert!(table.contains("floor") && table.contains("sample of the IMU"), "{table}");
}

#[test]
fn a_flight_of_ones_own_is_measured() {
    let settings = ["--set", "run.duration_s=1", "--set", "attitude.mpc.constraints=cone"];
    let flown =
        crate::harness::fly(&[&["scenarios/aggressive/upset.toml", "--mode", "inprocess"], &settings[..]].concat());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = measure(&[flown.out.to_str().expect("a plain path"), "--rounds", "1"], folder.path());
    let measured = read(&folder.path().join("measure.json"));
    check_verdict(measured["targets"].as_array().expect("targets"), &output);
    let rows = measured["results"]["rows"].as_array().expect("rows");
    let steps = |path: &str| rows.iter().find(|row| row["sequence"] == "all" && row["path"] == path);
    assert!(steps("solver").is_some(), "an upset takes the plan out of the set");
    assert_eq!(steps("all").expect("a row")["step"]["n"], 101);
}

#[test]
fn what_cannot_be_measured_is_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("occupied");
    std::fs::write(&file, "no log").expect("can be written");
    let occupied = file.to_str().expect("a plain path");
    let check = |arguments: &[&str], out: &Path, parts: &[&str]| {
        let output = measure(arguments, out);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(parts.iter().all(|part| stderr.contains(part)), "{arguments:?} should say {parts:?}: {stderr}");
    };
    let out = folder.path().join("out");
    check(&["no/such.mcap"], &out, &["no/such.mcap"]);
    check(&[occupied], &out, &["occupied", "not a flight log"]);
    check(&["--rounds", "0"], &out, &["--rounds", "0"]);
    check(&["--fast"], &out, &["--fast"]);
    check(&QUICK, &file, &["occupied", "--out"]);
}

/// Runs `trefoil measure` with `arguments`. Returns the JSON that it printed and wrote to `folder`, the beginning of
/// its namespaces, and its output.
fn measured(arguments: &[&str], folder: &Path) -> (Value, String, Output) {
    let mut command = launcher();
    command.arg("measure").args(arguments).args(["--json", "--out"]).arg(folder);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the launcher starts");
    let namespace = format!("measure-{}-", child.id());
    let output = child.wait_with_output().expect("the launcher ends");
    let said = String::from_utf8_lossy(&output.stderr);
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {said}"));
    assert_eq!(printed, read(&folder.join("measure.json")));
    (printed, namespace, output)
}

#[test]
fn timing_gives_every_promise_a_verdict_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (printed, namespace, output) = measured(&["timing", "--quick"], folder.path());

    let targets = printed["targets"].as_array().expect("targets");
    for figure in [
        "1 kHz loop over cyclictest, p50",
        "1 kHz loop over cyclictest, p99",
        "1 kHz loop over cyclictest, max",
        "ring over raw futex ring, one CPU, p50",
        "ring over raw futex ring, all CPUs, p99",
        "age at the actuator, 100 Hz, p50",
        "age at the actuator, 100 Hz, p99",
        "profile paper in real time",
        "idle, SCHED_FIFO, 100 Hz: misses not explained",
        "misses under stress-ng --cpu 4, SCHED_FIFO over SCHED_OTHER",
        "lockstep through four processes, times real time",
        "in process, times real time",
        "stamping over the ring's time, one CPU",
    ] {
        assert!(targets.iter().any(|target| target["figure"] == figure), "no verdict on '{figure}': {printed}");
    }
    assert!(targets.iter().all(|target| target["verdict"] == "inconclusive"), "a quick run judges nothing: {printed}");
    assert_eq!((output.status.code(), &printed["quick"]), (Some(0), &Value::Bool(true)));
    assert_eq!(printed["provenance"]["schema_version"], 6, "{}", printed["provenance"]);

    // Every ring came round, in both placements, and every flight at every rate has its slots.
    let results = &printed["results"];
    for ring in ["stack", "raw futex"] {
        for placement in ["one CPU", "all CPUs"] {
            let n = results["series"][format!("{ring}, {placement}")]["n"].as_u64();
            assert!(n > Some(0), "no turn of '{ring}, {placement}': {results}");
        }
    }
    let rates: Vec<u64> = results["flights"]
        .as_array()
        .expect("flights")
        .iter()
        .filter(|flight| flight["slots"].as_u64() > Some(0))
        .filter_map(|flight| flight["rate_hz"].as_u64())
        .collect();
    for rate in [100, 250, 500, 1000, 2000] {
        assert!(rates.contains(&rate), "{rates:?}");
    }
    let csv = std::fs::read_to_string(folder.path().join("histograms.csv")).expect("histograms.csv");
    assert!(csv.lines().any(|line| line.starts_with("canary,")), "the canary's histogram is kept");

    assert_eq!(in_memory(&namespace), Vec::<String>::new());
}

#[test]
fn timing_ends_its_processes_when_it_is_interrupted() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut command = launcher();
    command.args(["measure", "timing", "--out"]).arg(folder.path()).stderr(Stdio::piped());
    let mut child = command.stdout(Stdio::null()).spawn().expect("the launcher starts");
    let namespace = format!("measure-{}-", child.id());
    crate::harness::wait_until("it measures", || !in_memory(&namespace).is_empty());
    let pid = child.id().to_string();
    std::process::Command::new("kill").args(["-INT", &pid]).status().expect("kill runs");
    assert_eq!(child.wait().expect("the launcher ends").code(), Some(130));
    assert_eq!(in_memory(&namespace), Vec::<String>::new());
}

#[test]
fn kills_are_survived_told_of_and_leave_nothing_behind() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (printed, namespace, output) = measured(&["stress", "--kills", "10", "--replays", "0"], folder.path());

    let rows = printed["results"]["rows"].as_array().expect("rows");
    let kills: usize = rows.iter().map(|row| row["kills"].as_array().expect("kills").len()).sum();
    assert!(kills >= 10, "{printed}");
    assert!(rows.iter().any(|row| row["code"] == 0), "a flight went on: {printed}");
    let went_on = rows.iter().filter(|row| row["code"] == 0);
    assert!(
        went_on.into_iter().all(|row| row["again"]["messages"].as_u64() > Some(0) && row["again"]["differs"].is_null()),
        "and is the same again: {printed}"
    );
    let targets = printed["targets"].as_array().expect("targets");
    let short = targets.iter().any(|target| target["verdict"] == "short");
    assert_eq!(output.status.code(), Some(i32::from(short)), "the exit code is the verdict");
    // Speed and distance may depend on the machine; on every machine nothing may be left.
    let left = targets.iter().find(|target| target["figure"].as_str().is_some_and(|figure| figure.starts_with("left")));
    assert_eq!(left.expect("a target")["verdict"], "ok", "{printed}");
    assert_eq!(in_memory(&namespace), Vec::<String>::new());
    let files = std::fs::read_dir(std::env::temp_dir()).expect("it can be listed").flatten();
    assert!(!files.into_iter().any(|entry| entry.file_name().to_string_lossy().starts_with(&namespace)));
}

#[test]
fn flights_in_real_time_are_flown_again_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (printed, namespace, output) =
        measured(&["stress", "--kills", "0", "--replays", "2", "--seconds", "6s"], folder.path());
    let rows = printed["results"]["rows"].as_array().expect("rows");
    let kinds: Vec<&Value> = rows.iter().map(|row| &row["kind"]).collect();
    assert_eq!(kinds, ["disturbed", "fast"]);
    for row in rows {
        let again = &row["again"];
        assert!(again["differs"].is_null() && again["messages"].as_u64() > Some(100), "{row}");
    }
    let again = &rows[0]["again"];
    assert!(again["faults"].as_u64() == Some(3) && again["deaths"].as_u64() > Some(0), "{}", rows[0]);
    assert_eq!(rows[1]["code"], 0, "nothing disturbed it: {printed}");
    let targets = printed["targets"].as_array().expect("targets");
    let differs = |target: &&Value| target["figure"].as_str().is_some_and(|figure| figure.contains("replay differs"));
    let verdict = &targets.iter().find(differs).expect("a target")["verdict"];
    assert_eq!((verdict, output.status.code()), (&Value::from("ok"), Some(0)), "{printed}");
    let is_told = |target: &Value| target["verdict"] != "inconclusive" || target["note"] != "";
    assert!(targets.iter().all(is_told), "each target that is not judged says why: {printed}");
    assert_eq!(in_memory(&namespace), Vec::<String>::new());
    let files = std::fs::read_dir(std::env::temp_dir()).expect("it can be listed").flatten();
    assert!(!files.into_iter().any(|entry| entry.file_name().to_string_lossy().starts_with(&namespace)));

    let too_short = launcher().args(["measure", "stress", "--seconds", "0.1s"]).output().expect("the launcher starts");
    assert_eq!(too_short.status.code(), Some(2), "{}", String::from_utf8_lossy(&too_short.stderr));
}
