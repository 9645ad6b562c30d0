//! Export for other tools: the FMU is valid and repeats the flight of a log; other tools read the same values as the
//! log has.

use std::path::Path;
use std::process::Command;

use contract::Topic;
use flight::log::{self, Record};
use serde_json::{Value, json};

use crate::harness::{fly, launcher, python_with, top};

/// Settings of the flight and of the FMU: gusts, sensor errors, an actuator fault, a delay between two samples.
const SETTINGS: [&str; 5] = [
    "run.duration_s=6",
    "run.command_delay_ms=3.7",
    "plant.noise.position_m=0.01",
    "plant.noise.rates_dps=0.07",
    "fault=[{at_s=2, for_s=1, target='rotor1', kind='wrong', value=0.95}]",
];

fn export(arguments: &[&str]) -> (Option<i32>, String) {
    let output = launcher().args(["export", "--to", "fmu"]).args(arguments).output().expect("the launcher runs");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

#[test]
fn an_fmu_flies_the_states_of_a_log_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plant.fmu");
    let settings: Vec<&str> = SETTINGS.iter().flat_map(|set| ["--set", set]).collect();
    let arguments = [&["scenarios/wind.toml"], &settings[..]].concat();
    let (code, said) = export(&[&arguments[..], &["--out", file.to_str().unwrap()]].concat());
    assert_eq!(code, Some(0), "{said}");
    let flown = fly(&[&arguments[..], &["--mode", "inprocess"]].concat());
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    let packages = ["fmpy==0.3.32", "mcap==1.6.0", "mcap-protobuf-support==0.6.0"];
    let Some(python) = python_with(&packages) else { return };
    let script = top().join("tests/python/fmu.py");
    let checked = Command::new(python).arg(script).arg(&file).arg(flown.out.join("flight.mcap")).output().unwrap();
    let said = String::from_utf8_lossy(&[&checked.stdout[..], &checked.stderr].concat()).into_owned();
    assert!(checked.status.success(), "{said}");
    assert!(said.contains(r#"{"states": 601, "outputs": 10, "refused": 2}"#), "{said}");
}

#[test]
fn an_fmu_has_the_date_of_the_commit_and_none_of_today() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plant.fmu");
    let (code, said) = export(&["--out", plain(&file)]);
    assert_eq!(code, Some(0), "{said}");
    let mut archive = zip::ZipArchive::new(std::fs::File::open(&file).unwrap()).unwrap();
    for place in 0..archive.len() {
        let dated = archive.by_index(place).unwrap().last_modified();
        assert_eq!(dated, Some(zip::DateTime::default()), "1980, whenever it is written");
    }
    let description = std::io::read_to_string(archive.by_name("modelDescription.xml").unwrap()).unwrap();
    let format = ["show", "--no-patch", "--date=format-local:%Y-%m-%dT%H:%M:%SZ", "--format=%cd", "HEAD"];
    let asked = Command::new("git").arg("-C").arg(top()).args(format).env("TZ", "UTC").output();
    match asked.ok().filter(|asked| asked.status.success() && top().join(".git").exists()) {
        Some(asked) => {
            let date = String::from_utf8_lossy(&asked.stdout).trim().to_owned();
            assert!(description.contains(&format!("generationDateAndTime=\"{date}\"")), "{date}: {description}");
        }
        None => assert!(!description.contains("generationDateAndTime"), "{description}"),
    }
}

#[test]
fn what_cannot_be_exported_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("no/such/folder.fmu");
    for (arguments, why) in [
        (&["--set", "plant.substep_s=-1"][..], "`plant.substep_s`"),
        (&["scenarios/no-such.toml"], "no-such.toml"),
        (&["--set", "node.plant.exec=/bin/true", "--set", "run.mode=lockstep"], "an FMU has the launcher's own plant"),
        (&["--out", nowhere.to_str().unwrap()], "folder.fmu"),
    ] {
        let (code, said) = export(arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {said}");
        assert!(said.contains(why), "{arguments:?}: {said}");
    }
}

/// A flight through processes with an event, a damaged message and wind.
const FLOWN: [&str; 7] = [
    "--mode",
    "lockstep",
    "--set",
    "run.duration_s=2.0",
    "--set=fault=[{ at_s = 0.5, for_s = 0.3, target = \"guidance\", kind = \"kill\" }, \
     { at_s = 1.2, for_s = 0.1, target = \"controls\", kind = \"corrupt\" }]",
    "--set=plant.drag_linear_nspm=[0.2, 0.2, 0.1]",
    "--set=plant.wind_ned_mps=[[0.3, [2.0, -1.0, 0.0]]]",
];

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn export_run(out: &Path, to: &str, more: &[&str]) -> (Option<i32>, String) {
    let output = launcher().arg("export").arg(out).args(["--to", to]).args(more).output().expect("the launcher runs");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

/// Reads the lines of a CSV file without quotes, as cells.
fn cells(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).expect("a table");
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn a_table_has_the_bits_of_the_log() {
    let flown = fly(&FLOWN);
    for (to, place) in [("csv", "csv/state.csv"), ("parquet", "parquet/cycles.parquet"), ("ulog", "flight.ulg")] {
        let (code, said) = export_run(&flown.out, to, &[]);
        assert_eq!(code, Some(0), "{to}: {said}");
        assert!(flown.out.join(place).is_file(), "{place}");
    }
    let log = log::read(&flown.out.join("flight.mcap")).expect("the log reads");
    let table = cells(&flown.out.join("csv/state.csv"));
    assert_eq!(table.len(), 1 + log.states.len());
    let columns = log::columns(Topic::State);
    assert_eq!(table[0].len(), columns.len() + 3, "time_s, the words, status_name, is_intact");
    for ((row, state), truth) in table[1..].iter().zip(&log.states).zip(&log.truths) {
        let record = Record::from(*state);
        let bits = |(column, cell): (&log::Column, &String)| {
            if column.is_count {
                cell.parse().expect("a count")
            } else {
                cell.parse::<f64>().expect("a number").to_bits()
            }
        };
        let read: Vec<u64> = columns.iter().zip(&row[1..]).map(bits).collect();
        assert_eq!(read, log::words(&record, Some(truth)));
        assert_eq!((row[0].parse::<f64>(), &row[row.len() - 1][..]), (Ok(state.stamp.tick as f64 * 0.01), "1"));
    }
    let cycles = cells(&flown.out.join("csv/cycles.csv"));
    assert_eq!(cycles.iter().filter(|row| row[1] == "plant").count(), 201);
    let damaged = cells(&flown.out.join("csv/controls.csv"));
    assert!(damaged.iter().any(|row| row.last().is_some_and(|intact| intact == "0")), "the corrupt ones are there too");
}

#[test]
fn a_ulog_has_the_numbers_of_the_settings_as_parameters() {
    let flown = fly(&[
        "--mode",
        "inprocess",
        "--set=run.duration_s=1.5",
        "--set=run.seed=5000000000",
        "--set=fault=[{ at_s = 0.5, for_s = 0.3, target = \"rotor1\", kind = \"wrong\", value = 0.75 }]",
    ]);
    let (code, said) = export_run(&flown.out, "ulog", &[]);
    assert_eq!(code, Some(0), "{said}");
    let file = std::fs::read(flown.out.join("flight.ulg")).expect("a file");
    let mut rest = &file[16..]; // magic and time
    let mut parameters = std::collections::BTreeMap::new();
    while let [low, high, kind, message @ ..] = rest {
        let (message, after) = message.split_at(u16::from_le_bytes([*low, *high]).into());
        rest = after;
        if *kind == b'P' {
            let (key, value) = message[1..].split_at(message[0].into());
            let key = std::str::from_utf8(key).expect("a text").to_owned();
            assert!(parameters.insert(key, <[u8; 4]>::try_from(value).expect("32 bits")).is_none(), "twice");
        }
    }
    for (key, value) in [
        ("float run.duration_s", 1.5_f32.to_le_bytes()),
        ("float airframe.mass_kg", 1.1_f32.to_le_bytes()),
        ("float fault.0.value", 0.75_f32.to_le_bytes()),
        ("float initial.position_m.2", 0.0_f32.to_le_bytes()),
        ("int32_t run.rate_hz", 100_i32.to_le_bytes()),
        ("int32_t initial.standing", 0_i32.to_le_bytes()),
    ] {
        assert_eq!(parameters.get(key), Some(&value), "{key}");
    }
    assert!(!parameters.keys().any(|key| key.ends_with("run.seed") || key.ends_with("run.mode")), "{parameters:?}");
}

#[test]
fn an_export_of_a_part_and_of_an_incomplete_log_says_so() {
    let flown = fly(&["--mode", "inprocess", "--set", "run.duration_s=2.0"]);
    let out = flown.out.join("part");
    let (code, said) = export_run(&flown.out, "csv", &["--from", "0.5s", "--for", "500ms", "--out", plain(&out)]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("a flight in process has no clock"), "{said}");
    let table = cells(&out.join("state.csv"));
    assert_eq!((table.len(), &table[1][0][..], &table[51][0][..]), (52, "0.5", "1.0"));
    assert_eq!(cells(&out.join("cycles.csv")).len(), 1, "no clock, no cycles");

    let log = flown.out.join("flight.mcap");
    let whole = std::fs::read(&log).expect("a log");
    std::fs::write(&log, &whole[..whole.len() / 2]).expect("a torn log");
    let (code, said) = export_run(&flown.out, "ulog", &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("is not whole") && said.contains("messages before that are missing"), "{said}");
}

#[test]
fn a_run_that_cannot_be_exported_is_refused() {
    let flown = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.1"]);
    let run = plain(&flown.out).to_owned();
    for (arguments, why) in [
        (&["export", &run][..], "--to"),
        (&["export", &run, "--to", "xml"], "possible values: csv, parquet, ulog, foxglove, perfetto, fmu"),
        (&["export", "no/such/run", "--to", "csv"], "no/such/run is not there"),
        (
            &["export", &run, "--to", "csv", "--from", "7s"],
            "the flight lasted 0.10 s; choose another with --from and --for",
        ),
        (&["export", &run, "--to", "csv", "--for", "0"], "--for 0"),
        (&["export", &run, "--to", "csv", "--set", "run.rate_hz=50"], "a recorded run has its settings"),
        (&["export", "--to", "ulog"], "give the run"),
        (&["export", "--to", "fmu", "--for", "2s"], "--to fmu packs the plant"),
        (&["export", &run, "--to", "ulog", "--out", "/no/such/folder/x"], "--out"),
        (&["export", &run, "--to", "perfetto"], "no clock"),
    ] {
        let output = launcher().args(arguments).output().expect("the launcher runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(why), "{arguments:?}: {said}");
    }
    let log = std::fs::read(flown.out.join("flight.mcap")).expect("a log");
    let [mcap, page] = ["flight.mcap", "report.html"].map(|name| plain(&flown.out.join(name)).to_owned());
    for arguments in [
        &["export", &run, "--to", "ulog", "--out", &mcap][..],
        &["export", &run, "--to", "csv", "--out", &run],
        &["export", "--to", "fmu", "--out", &mcap],
        &["export", &run, "--to", "foxglove", "--out", &mcap],
        &["export", &run, "--to", "perfetto", "--out", &page],
        &["compare", &run, &mcap, "--out", &page],
    ] {
        let output = launcher().args(arguments).output().expect("the launcher runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains("name another with --out"), "{arguments:?}: {said}");
    }
    assert!(std::fs::read(&mcap).expect("a log") == log, "what it exports is as it was");
    let left = std::fs::read_dir(&flown.out).expect("a folder").flatten().map(|entry| entry.file_name());
    assert!(left.into_iter().all(|name| !name.to_string_lossy().contains(".part")), "nothing half-written is left");
}

#[test]
fn pandas_duckdb_and_pyulog_read_what_the_log_has() {
    let packages = ["mcap", "mcap-protobuf-support", "pandas", "pyarrow", "duckdb", "pyulog"];
    let Some(python) = python_with(&packages) else { return };
    let flown = fly(&FLOWN);
    for to in ["csv", "parquet", "ulog"] {
        let (code, said) = export_run(&flown.out, to, &[]);
        assert_eq!(code, Some(0), "{to}: {said}");
    }
    let script = top().join("tests/python/read_export.py");
    let checked = Command::new(python).arg(script).arg(&flown.out).output().unwrap();
    let said = String::from_utf8_lossy(&[&checked.stdout[..], &checked.stderr].concat()).into_owned();
    assert!(checked.status.success(), "{said}");
    let read: Value = serde_json::from_slice(&checked.stdout).expect("one line of JSON");
    assert_eq!(
        (&read["csv"]["state"], &read["parquet"]["state"], &read["ulog"]["state"]),
        (&json!(201), &json!(201), &json!(201))
    );
    assert_eq!(read["cycles"]["plant"], 201, "{read}");
    let events: Vec<&str> = read["events"].as_array().expect("events").iter().filter_map(Value::as_str).collect();
    assert_eq!(events[..2], ["guidance died", "guidance started"], "{read}");
    assert!(read["logged"][0].as_str().is_some_and(|text| text.starts_with("guidance epoch 1 died")), "{read}");
    let parameters = &read["parameters"];
    assert_eq!((&parameters["run.rate_hz"], &parameters["fault.0.at_s"]), (&json!(100), &json!(0.5)), "{parameters}");
}
