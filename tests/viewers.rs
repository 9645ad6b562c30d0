//! Other tools open a log: Foxglove's schemas, Rerun, and the ten lines of docs/tools.md.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use flight::log;
use serde_json::{Value, json};
use view::scene::SceneChannel;

use crate::harness::{fly, launcher, python_with, top};

const WINDY: [&str; 7] = [
    "--mode",
    "lockstep",
    "--set",
    "run.duration_s=4.0",
    "--set=plant.drag_linear_nspm=[0.2, 0.2, 0.1]",
    "--set=plant.wind_ned_mps=[[1.0, [2.0, -1.0, 0.5]], [2.0, [0.0, 0.0, 0.0]], [3.0, [-1.0, 0.0, 0.0]]]",
    "--set=fault=[{ at_s = 0.5, for_s = 0.3, target = \"guidance\", kind = \"kill\" }]",
];

/// Runs a script of the repository, which must succeed.
fn script(python: &Path, script: &str, arguments: &[&Path]) -> Output {
    let ran = Command::new(python).arg(top().join(script)).args(arguments).env("RERUN_ANALYTICS", "0").output();
    let ran = ran.expect("python runs");
    assert!(ran.status.success(), "{script}: {}", String::from_utf8_lossy(&ran.stderr));
    ran
}

/// Exports the run in `out` with its scenes, and returns the file.
fn with_scenes(out: &Path) -> PathBuf {
    let exported = launcher().arg("export").arg(out).args(["--to", "foxglove"]).output().expect("the launcher runs");
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    out.join("foxglove.mcap")
}

#[test]
fn the_package_of_foxglove_reads_a_vehicle_that_moves_as_the_states_do() {
    let packages = ["mcap", "mcap-protobuf-support", "foxglove-schemas-protobuf==0.4.*"];
    let Some(python) = python_with(&packages) else { return };
    let flown = fly(&WINDY);
    let log_file = with_scenes(&flown.out);
    let read = script(&python, "tests/python/read_view.py", &[&log_file]);
    let read: Value = serde_json::from_slice(&read.stdout).expect("one line of JSON");
    // Every fifth, tenth and two-hundredth of 401 ticks; guidance's death, start and return.
    let expected = json!({ "/view/arrows": 41, "/view/course": 1, "/view/log": 3, "/view/path": 3, "/view/tf": 81,
        "/view/tf_static": 1, "/view/vehicle": 1 });
    assert_eq!(read["counts"], expected, "{read}");
    assert_eq!(read["gap_s"], json!([0.05, 0.05]), "{read}");
    assert_eq!((&read["path"], &read["course"][1]), (&json!(9), &json!("ned")), "{read}");
    assert!(read["share"].as_f64() < Some(0.12), "a tenth of the log: {read}");
    assert_eq!(read["log"][0], "ERROR guidance epoch 1 died", "{read}");
}

#[test]
fn the_ten_lines_of_the_page_read_a_log() {
    let text = std::fs::read_to_string(top().join("docs/read_mcap.py")).expect("a script");
    let page = std::fs::read_to_string(top().join("docs/tools.md")).expect("a page");
    assert!(page.contains(&format!("```python\n{text}```")) && text.lines().count() == 10, "the page shows the file");
    let Some(python) = python_with(&["mcap", "mcap-protobuf-support"]) else { return };
    let flown = fly(&["--mode", "inprocess", "--set", "run.duration_s=3.0"]);
    let log_file = flown.out.join("flight.mcap");
    let printed = script(&python, "docs/read_mcap.py", &[&log_file]);
    let printed = String::from_utf8_lossy(&printed.stdout).into_owned();
    let truths = log::read(&log_file).expect("the log reads").truths;
    let line = |truth: &contract::message::Truth| {
        let [x, y, z] = truth.actual.position_m;
        let at_s = truth.tick as f64 / 100.0;
        format!("{at_s:6.2} s  north {x:7.3}  east {y:7.3}  down {z:7.3} m")
    };
    let expected: Vec<String> = truths.iter().filter(|truth| truth.tick % 100 == 0).map(line).collect();
    assert_eq!(printed.lines().collect::<Vec<_>>(), expected);
}

/// Every `topic.field` or `/topic/field` that a layout draws is in the log.
#[test]
fn layouts_name_what_a_log_has() {
    let read = |name: &str| std::fs::read_to_string(top().join("docs/layouts").join(name)).expect("a layout");
    let known = |separator: &str| -> Vec<String> {
        let names = |(kind, channel): (usize, &log::Channel)| {
            let name =
                |field: &log::Column| format!("{}{separator}{}", channel.topic, field.name.replace('.', separator));
            log::fields(kind).iter().map(name).collect::<Vec<_>>()
        };
        log::channels()[..log::Record::KINDS].iter().enumerate().flat_map(names).collect()
    };
    let foxglove: Value = serde_json::from_str(&read("foxglove.json")).expect("a layout is JSON");
    let panels = foxglove["configById"].as_object().expect("panels");
    let mut drawn = 0;
    for path in panels.values().filter_map(|panel| panel["paths"].as_array()).flatten() {
        let value = path["value"].as_str().expect("a path").to_owned();
        assert!(known(".").contains(&value), "{value}");
        drawn += 1;
    }
    let scene = panels["3D!vehicle"]["topics"].as_object().expect("topics");
    let topics = SceneChannel::ALL.map(SceneChannel::topic);
    assert!(scene.keys().all(|topic| topics.contains(&topic.as_str())) && scene.len() == 6, "{scene:?}");
    let plotjuggler = read("plotjuggler.xml");
    for curve in plotjuggler.split("<curve name=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
        assert!(known("/").iter().any(|name| name == curve), "{curve}");
        drawn += 1;
    }
    assert!(drawn > 40, "{drawn}");
}

#[test]
fn rerun_converts_a_log_and_the_script_adds_the_vehicle() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let packages = ["rerun-sdk==0.41.*", "mcap", "mcap-protobuf-support"];
    let Some(python) = python_with(&packages) else { return };
    let flown = fly(&WINDY);
    let log_file = with_scenes(&flown.out);
    let recording = log_file.with_file_name("flight.rrd");
    script(&python, "docs/layouts/rerun_view.py", &[&flown.out]);
    let converted = folder.path().join("converted.rrd");
    let rerun = Command::new(python.with_file_name("rerun"))
        .args(["mcap", "convert"])
        .arg(&log_file)
        .arg("-o")
        .arg(&converted)
        .env("RERUN_ANALYTICS", "0")
        .output()
        .expect("rerun runs");
    assert!(rerun.status.success(), "{}", String::from_utf8_lossy(&rerun.stderr));
    let read = script(&python, "tests/python/read_rerun.py", &[&converted, &recording]);
    let read: Value = serde_json::from_slice(&read.stdout).expect("one line of JSON");
    let has = |of: &str, entity: &str, component: &str| {
        let entities = read[of].as_object().expect("entities");
        let components = entities.get(entity).unwrap_or_else(|| panic!("{of} has no {entity}: {entities:?}"));
        assert!(components.to_string().contains(component), "{of} {entity}: {components}");
    };
    has("converted", "/view/tf", "Transform3D");
    has("converted", "/view/path", "InstancePoses3D");
    has("converted", "/view/log", "TextLog");
    for (entity, component) in [
        ("/scene/body/cubes", "Boxes3D"),
        ("/scene/rotor_1/disc", "Cylinders3D"),
        ("/scene/thrust_1", "Arrows3D"),
        ("/scene/wind", "Arrows3D"),
        ("/frames/body", "Transform3D"),
        ("/scene/path", "LineStrips3D"),
        ("/position/true/x", "Scalars"),
        ("/events", "TextLog"),
    ] {
        has("recording", entity, component);
    }
}
