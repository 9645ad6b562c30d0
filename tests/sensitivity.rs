//! `trefoil measure sensitivity`: a map that tells where the limits are, and is the same every time.

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::harness::{fly, launcher};

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// Writes the run.json of a flight in lockstep, changed into that of one in `mode` with known times.
pub fn realtime_run(folder: &Path, mode: &str) {
    let mut run = fly(&["--mode", "lockstep", "--no-log", "--set", "run.duration_s=0.1"]).run();
    run["mode"] = mode.into();
    let timing = &mut run["timing"];
    (timing["age_at_actuator"]["p50_us"], timing["age_at_actuator"]["p99_us"]) = (240.0.into(), 1350.0.into());
    let mixer = &mut timing["nodes"]["mixer"];
    (mixer["response"]["n"], mixer["misses"], mixer["slips"]) = (498.into(), 5.into(), 2.into());
    std::fs::write(folder.join("run.json"), run.to_string()).expect("can be written");
}

fn sensitivity(arguments: &[&str], folder: &Path) -> Output {
    let out = folder.join("map");
    launcher()
        .args(["measure", "sensitivity", "--out", plain(&out), "--run", plain(folder)])
        .args(arguments)
        .output()
        .expect("the launcher starts")
}

#[test]
fn the_map_finds_the_limit_of_the_papers_controller() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    realtime_run(folder.path(), "realtime");
    let grid = ["--delays", "0,4ms,10ms,58ms", "--jitters", "0", "--misses", "0", "--json"];
    let output = sensitivity(&grid, folder.path());
    let printed: Value = serde_json::from_slice(&output.stdout).expect("stdout is JSON");
    let map = folder.path().join("map");
    let file = std::fs::read_to_string(map.join("sensitivity.json")).expect("sensitivity.json");
    assert_eq!(printed, serde_json::from_str::<Value>(&file).expect("the file is JSON"));

    let cells = printed["results"]["cells"].as_array().expect("cells");
    let of = |profile: &str, field: &str| {
        let cells = cells.iter().filter(|cell| cell["controller"] == profile);
        cells.map(|cell| cell[field].as_f64()).collect::<Vec<_>>()
    };
    assert_eq!(of("paper", "lost"), [0.0, 0.0, 1.0, 1.0].map(Some));
    let paper = of("paper", "max_position_error_m");
    assert!(paper[0] < paper[1] && paper[2..] == [None, None], "more delay is not better: {paper:?}");
    assert_eq!(of("robust", "lost"), [0.0; 4].map(Some));
    let robust = of("robust", "max_position_error_m");
    assert!(robust[2] < paper[0] && robust[3] > robust[0], "{robust:?}");

    let targets = printed["targets"].as_array().expect("targets");
    let verdicts: Vec<_> = targets.iter().map(|target| target["verdict"].as_str().expect("a verdict")).collect();
    assert_eq!(verdicts, ["ok", "ok", "ok", "inconclusive"], "misses are not on this map");
    assert_eq!(output.status.code(), Some(0), "none is short");
    let csv = std::fs::read_to_string(map.join("sensitivity.csv")).expect("sensitivity.csv");
    assert_eq!(csv.lines().count(), 1 + 8);
    let page = std::fs::read_to_string(map.join("sensitivity.html")).expect("sensitivity.html");
    assert!(page.contains("p50 0.24 ms, p99 1.35 ms, 1.00 % missed") && page.matches("class=\"point\"").count() == 2);
}

#[test]
fn the_map_is_the_same_every_time() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    realtime_run(folder.path(), "realtime");
    let short = folder.path().join("short.toml");
    std::fs::write(&short, "name = \"short\"\n[run]\nduration_s = 3.0\n").expect("can be written");
    let [first, again] = [(); 2].map(|()| {
        let arguments = [plain(&short), "--delays", "5ms,0", "--jitters", "5ms", "--misses", "0.2,0", "--seeds", "2"];
        let output = sensitivity(&arguments, folder.path());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let table = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(table.contains("promised of the survey only") && table.contains("20 % missed"), "{table}");
        std::fs::read_to_string(folder.path().join("map/sensitivity.csv")).expect("sensitivity.csv")
    });
    assert_eq!(first, again);
    assert_eq!(first.lines().count(), 1 + 2 * 4 * 2);
}

#[test]
fn what_cannot_be_mapped_is_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    realtime_run(folder.path(), "lockstep");
    let check = |arguments: &[&str], parts: &[&str]| {
        let output = sensitivity(arguments, folder.path());
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(parts.iter().all(|part| stderr.contains(part)), "{arguments:?} should say {parts:?}: {stderr}");
    };
    check(&[], &["run.json", "lockstep", "--mode realtime"]);
    check(&["no/such.toml"], &["no/such.toml"]);
    check(&["--delays=-1ms,2ms"], &["--delays", "'-1ms' is no duration"]);
    check(&["--delays=2s"], &["run.command_delay_ms", "2000.0"]);
    check(&["--misses", "0.5,1.5"], &["run.command_drop_probability", "1.5"]);
    check(&["--seeds", "0"], &["--seeds"]);
    std::fs::remove_file(folder.path().join("run.json")).expect("was there");
    check(&[], &["run.json", "--run"]);
}
