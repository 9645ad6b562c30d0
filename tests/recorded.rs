//! The flight log: the same in every mode, and readable by others.

use std::process::Command;

use crate::harness::{fly, launcher, python_with, top};
use contract::message::{Message, Stamp, State};
use flight::log::{self, LogWriter};
use serde_json::json;
use settings::{Scenario, to_toml};

#[test]
fn the_log_holds_every_message() {
    for mode in ["inprocess", "lockstep"] {
        let outcome = fly(&["--mode", mode, "--set", "run.duration_s=2.0"]);
        assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
        let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
        assert!(log.complete());
        let counts =
            [log.states.len(), log.references.len(), log.controls.len(), log.actuators.len(), log.truths.len()];
        assert_eq!(counts, [201; 5], "{mode}");
        let samples = log.states.iter().zip(&log.truths);
        assert!(
            samples
                .clone()
                .all(|(state, truth)| (truth.tick, truth.sequence) == (state.stamp.tick, state.stamp.sequence))
        );
        for (i, controls) in log.controls.iter().enumerate() {
            let tick = i as u64;
            assert_eq!(controls.stamp.tick, tick);
            assert_eq!(controls.stamp.inputs, [tick + 1, tick + 1, 0, 0], "every message names what it came from");
        }
        assert_eq!(outcome.run()["log"]["dropped"], 0);
    }
}

#[test]
fn a_run_tells_when_where_and_by_what_it_was_made() {
    let outcome = fly(&["--mode", "inprocess", "--no-log", "--set", "run.duration_s=0.1"]);
    let provenance = outcome.run()["provenance"].clone();
    assert_eq!(provenance["schema_version"], 6);
    let date = provenance["date"].as_str().expect("a date");
    assert!(date.len() == 20 && date.starts_with("20") && date.ends_with('Z') && date.as_bytes()[10] == b'T', "{date}");
    assert!(provenance["host"].as_str().is_some_and(|host| !host.is_empty()), "{provenance}");
    let command = provenance["command"].as_array().expect("the command line");
    assert!(command.contains(&json!("run.duration_s=0.1")), "{command:?}");
    if top().join(".git").exists() {
        let git = &provenance["git"];
        assert!(
            git["commit"].as_str().is_some_and(|commit| commit.len() == 40) && git["changed"].is_boolean(),
            "{git}"
        );
    }
}

/// Returns a command of the launcher with this much address space \[kB\].
pub fn confined(kilobytes: u32, arguments: &[&str]) -> Command {
    let launcher = launcher().get_program().to_owned();
    let limited = format!("ulimit -v {kilobytes}; exec \"$0\" \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &limited]).arg(launcher).args(arguments);
    command
}

/// In memory these two logs would take 450 MB and 6 GB.
#[test]
fn logs_are_read_in_bounded_memory_whatever_stands_in_them() {
    const LIMIT_KB: u32 = 300_000;
    let long = fly(&["--mode", "inprocess", "--set", "run.duration_s=1000.0", "--set", "mission.trajectory=hover"]);
    assert_eq!(long.code(), Some(0), "{}", long.stderr);
    let short = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.1"]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let forged = folder.path().join("forged");
    std::fs::create_dir(&forged).expect("a folder can be made");
    let mut scenario = Scenario::default();
    (scenario.run.duration_s, scenario.run.rate_hz) = (86_400.0, 2000);
    (scenario.attitude.mpc.prediction_horizon_s, scenario.attitude.mpc.control_horizon_s) = (0.1, 0.1);
    let mut log = LogWriter::create(&forged.join("flight.mcap"), &to_toml(&scenario), 10_000_000).expect("a log");
    for (tick, sequence) in [(0, 1), (172_000_000, 2)] {
        let stamp = Stamp { tick, sequence, epoch: 1, ..Stamp::default() };
        log.write(&State { stamp, ..State::default() }.with_checksum().into()).expect("written");
    }
    log.finish().expect("closed");
    for run in [&long.out, &forged] {
        let page = run.join("page.html");
        let run = run.to_str().expect("a path");
        let (page, short) = (page.to_str().expect("a path"), short.out.to_str().expect("a path"));
        for arguments in [vec!["report", run], vec!["compare", run, short, "--out", page], vec!["replay", run]] {
            let output = confined(LIMIT_KB, &arguments).output().expect("a shell starts");
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.code().is_some_and(|code| code < 2), "{arguments:?}: {:?} {said}", output.status);
        }
        let report = std::fs::metadata(format!("{run}/report.html")).expect("a report");
        assert!(report.len() < 10_000_000, "{run}: {} bytes", report.len());
    }
}

/// Arguments of a flight in which guidance is killed.
const KILLED: [&str; 6] = [
    "scenarios/faults/hover-gusts.toml",
    "--mode",
    "lockstep",
    "--set",
    "run.duration_s=2.0",
    "--set=fault=[{ at_s = 0.5, for_s = 0.3, target = \"guidance\", kind = \"kill\" }]",
];

#[test]
fn the_log_holds_every_event() {
    let outcome = fly(&KILLED);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    let run = outcome.run();
    assert!(log.complete() && log.events.len() >= 3, "{:?}", log.events);
    assert_eq!(run["log"]["dropped"], 0);
    let told: Vec<_> = log.events.iter().map(|event| (event.node.as_str(), event.epoch, json!(event.what))).collect();
    let events = run["events"].as_array().expect("a list of events");
    let expected = events.iter().map(|event| {
        let epoch = event["epoch"].as_u64().and_then(|epoch| u32::try_from(epoch).ok()).expect("an epoch");
        (event["node"].as_str().expect("a node"), epoch, event["what"].clone())
    });
    assert_eq!(told, expected.collect::<Vec<_>>());
    let messages = log.tick_by_tick().count();
    assert_eq!(run["log"]["records"].as_u64(), Some((messages + log.events.len()) as u64));
}

#[test]
fn the_python_reader_reads_it() {
    let Some(python) = python_with(&["mcap", "mcap-protobuf-support"]) else { return };
    let outcome = fly(&KILLED);
    let script = top().join("tests/python/read_log.py");
    let read = Command::new(&python).arg(script).arg(outcome.out.join("flight.mcap")).output().expect("python runs");
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let seen: serde_json::Value = serde_json::from_slice(&read.stdout).expect("one line of JSON");
    assert_eq!(seen["counts"]["/state"], 201, "{seen}");
    assert!(seen["counts"]["/events"].as_u64() >= Some(3), "{seen}");
}

#[test]
fn a_report_of_a_part_draws_every_sample_of_it() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=70.0"]);
    let report = |more: &[&str]| launcher().arg("report").arg(&outcome.out).args(more).output().expect("it runs");
    let data = |name: &str| {
        let page = std::fs::read_to_string(outcome.out.join(name)).expect("a page");
        let (_, data) = page.split_once("id=\"flight\">").expect("data");
        let data: serde_json::Value =
            serde_json::from_str(data.split_once("</script>").expect("data").0).expect("JSON");
        (data["rows"].as_u64().expect("rows"), data["begin_s"].as_f64(), data["dt_s"].as_f64(), page)
    };
    let (rows, begin_s, dt_s, page) = data("report.html");
    assert!(rows < 7001 && begin_s == Some(0.0) && dt_s > Some(0.01), "{rows} {dt_s:?}");
    assert!(page.contains("7001 samples from 0.00 to 70.00 s, drawn as the smallest and the largest of every"));
    assert_eq!(report(&["--from", "30s", "--to", "32s"]).status.code(), Some(0));
    let (rows, begin_s, dt_s, part) = data("report-30.00-32.00.html");
    assert_eq!((rows, begin_s, dt_s), (201, Some(30.0), Some(0.01)));
    assert!(part.contains("201 samples from 30.00 to 32.00 s, each one drawn."));
    assert_eq!(data("report.html").3, page, "the page of the whole is left alone");
    let beyond = report(&["--from", "80s"]);
    assert_eq!(beyond.status.code(), Some(2));
    let said = String::from_utf8_lossy(&beyond.stderr).into_owned();
    assert!(said.contains("the flight has nothing from 80 s on: it ends at 70.00 s"), "{said}");
}

#[test]
fn a_plain_file_beside_the_folders_of_runs_is_no_flight() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=1.0"]);
    let folder = outcome.out.parent().expect("a folder");
    std::fs::write(folder.join("notes.txt"), "").expect("a file");
    let listed = launcher().arg("runs").arg(folder).output().expect("it runs");
    let said = String::from_utf8_lossy(&listed.stdout);
    assert!(listed.status.success() && said.contains("survey") && !said.contains("notes.txt"), "{said}");
}
