//! Export for other tools: the FMU is valid, and flies a flight of the log again.

use std::process::Command;

use crate::harness::{fly, launcher, python_with, top};

/// Settings of the flight and of the FMU: gusts, sensor errors, an actuator fault, a delay between two samples.
const SETTINGS: [&str; 5] = [
    "run.duration_s=6",
    "run.command_delay_ms=3.7",
    "plant.noise.position_m=0.01",
    "plant.sensors.rates.noise_density=[0.01, 0.01, 0.01]",
    "fault=[{at_s=2, for_s=1, target='rotor1', kind='wrong', value=0.95}]",
];

fn export(arguments: &[&str]) -> (Option<i32>, String) {
    let output = launcher().args(["export", "fmu"]).args(arguments).output().expect("the launcher runs");
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
    let Some(python) = python_with(&packages, folder.path()) else { return };
    let script = top().join("tests/python/fmu.py");
    let checked = Command::new(python).arg(script).arg(&file).arg(flown.out.join("flight.mcap")).output().unwrap();
    let said = String::from_utf8_lossy(&[&checked.stdout[..], &checked.stderr].concat()).into_owned();
    assert!(checked.status.success(), "{said}");
    assert!(said.contains(r#"{"states": 601, "outputs": 10, "refused": 2}"#), "{said}");
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
