//! Plants of users: a vehicle in C flies in every mode with the same bits, and settings without effect are refused.

use std::path::{Path, PathBuf};
use std::process::Command;

use airframe::Parameters;
use contract::exit;

use crate::controllers::{compiled, replay};
use crate::harness::{Outcome, PATIENT, fly, python_with, top};
use crate::libtrefoil::{library_folder, linked};

/// Compiles `tests/controllers/plant.c` into `folder/name.so`, with these flags for the compiler.
fn vehicle(folder: &Path, name: &str, flags: &[&str]) -> PathBuf {
    compiled(&top().join("tests/controllers/plant.c"), folder, name, flags)
}

/// Flies the vehicle of `library` for 4 s through the survey in `mode`, with these settings.
fn survey(library: &Path, mode: &str, settings: &[&str]) -> Outcome {
    let exec = format!("node.plant.exec={}", library.display());
    let mut arguments = vec!["scenarios/survey.toml", "--mode", mode, "--set", "run.duration_s=4", "--set", &exec];
    for set in settings {
        arguments.extend(["--set", set]);
    }
    fly(&arguments)
}

#[test]
fn a_vehicle_in_c_flies_with_the_same_bits_in_every_mode() {
    let folder = tempfile::tempdir().unwrap();
    let library = vehicle(folder.path(), "plant", &[]);
    // The command changes between two samples, and the sensors and the link are the plant's own.
    let settings = [
        "run.command_delay_ms=3.7",
        "run.command_jitter_ms=9.0",
        "run.command_drop_probability=0.05",
        "plant.noise.attitude_deg=0.05",
        "initial.position_m=[0.5, -0.3, 0.2]",
        "bounds.max_position_error_m=1.0",
        "fault=[{at_s=1, for_s=0.5, target='position', kind='stuck'}, {at_s=2, target='mixer', kind='kill'}]",
    ];
    let flights = ["inprocess", "lockstep"].map(|mode| survey(&library, mode, &settings));
    for flown in &flights {
        assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
    let drag = survey(&library, "inprocess", &[&settings[..], &["node.plant.settings.drag_nspm=0.3"]].concat());
    assert_ne!(drag.state_hash(), flights[0].state_hash(), "it reads its settings");
}

#[test]
fn a_flight_in_real_time_with_a_vehicle_in_c_is_replayed_bit_for_bit_if_the_user_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let library = vehicle(folder.path(), "plant", &[]);
    let flown = survey(&library, "realtime", &["run.duration_s=12", PATIENT]);
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    let (code, said) = replay(&flown.out, &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("not computed: plant 1"), "{said}");
    let named = format!("plant={}", library.display());
    for (arguments, words) in [(&[][..], "the same bits"), (&["--from", "11s"], "begun with the snapshots")] {
        let (code, said) = replay(&flown.out, &[&["--program", &named], arguments].concat());
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains(words) && !said.contains("not computed"), "{said}");
    }
}

#[test]
fn a_vehicle_of_casadi_flies_in_every_mode_as_it_was_generated() {
    let folder = tempfile::tempdir().unwrap();
    let Some(python) = python_with(&["casadi==3.8.2"]) else { return };
    let source = folder.path().join("vehicle.c");
    let generated = Command::new(python).arg(top().join("tests/python/casadi_plant.py")).arg(&source).output().unwrap();
    assert!(generated.status.success(), "{}", String::from_utf8_lossy(&generated.stderr));
    let library = compiled(&source, folder.path(), "vehicle", &["-Wno-unused-parameter", "-Wno-unused-function"]);
    let Parameters { mass_kg, g_mps2, kf, km, l1_m, l2_m, l3_m, ixx_kgm2, iyy_kgm2, izz_kgm2, .. } =
        Parameters::default();
    let p = [mass_kg, g_mps2, kf, km, l1_m, l2_m, l3_m, ixx_kgm2, iyy_kgm2, izz_kgm2];
    let settings = [
        &format!("node.plant.settings.p={p:?}"),
        "initial.position_m=[0.2, 0, 0]",
        "bounds.max_position_error_m=0.5",
        PATIENT,
    ];
    let flights = ["inprocess", "lockstep", "realtime"].map(|mode| survey(&library, mode, &settings));
    for flown in &flights {
        assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
    let (code, said) = replay(&flights[2].out, &["--program", &format!("plant={}", library.display())]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the same bits") && said.contains(&flights[2].state_hash()), "{said}");
    // plant.c has the same equations and midpoint rule, so the two courses differ by the steps only.
    let in_c = survey(&vehicle(folder.path(), "plant", &[]), "inprocess", &settings[1..]);
    let errors = [&flights[0], &in_c].map(|flown| flown.run()["metrics"]["max_position_error_m"].as_f64().unwrap());
    assert!((errors[0] - errors[1]).abs() < 1e-4, "{errors:?}");
}

#[test]
fn a_program_with_the_functions_of_a_vehicle_flies_the_bits_of_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let library = vehicle(folder.path(), "plant", &[]);
    let program = linked("plant.c", &library_folder(folder.path()), "own-plant", &["-DOWN_MAIN"]);
    let drag = "node.plant.settings.drag_nspm=0.3";
    let flights = [survey(&library, "lockstep", &[drag]), survey(&program, "lockstep", &[drag])];
    for flown in &flights {
        assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
    let realtime = survey(&program, "realtime", &[PATIENT]);
    assert_eq!(realtime.code(), Some(0), "{}", realtime.stderr);
    let (code, said) = replay(&realtime.out, &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("not computed: plant 1"), "{said}");
    let failing = linked("plant.c", folder.path(), "failing", &["-DOWN_MAIN", "-DTRAP=5"]);
    let failed = survey(&failing, "lockstep", &[]);
    assert_eq!(failed.code(), Some(i32::from(exit::PROCESS_LOST)), "{}", failed.stderr);
    assert!(failed.stderr.contains("`step` returned 7"), "{}", failed.stderr);
}

#[test]
fn a_vehicle_without_a_memory_is_replayed_from_the_beginning() {
    let folder = tempfile::tempdir().unwrap();
    let library = vehicle(folder.path(), "cold", &["-DCOLD"]);
    let flown = survey(&library, "inprocess", &["run.duration_s=12"]);
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    let named = format!("plant={}", library.display());
    let (code, said) = replay(&flown.out, &["--program", &named, "--from", "11s"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("no difference") && !said.contains("begun with the snapshots"), "{said}");
}

#[test]
fn a_vehicle_that_cannot_be_tried_is_refused_before_the_flight() {
    let folder = tempfile::tempdir().unwrap();
    for (trap, why) in [
        (1, "ended the process that tried it"),
        (2, "ended the process that tried it"),
        (3, "it did not load and answer within 10 s"),
        (4, "build it with the header of this launcher"),
    ] {
        let library = vehicle(folder.path(), &format!("trap{trap}"), &[&format!("-DTRAP={trap}")]);
        let outcome = survey(&library, "inprocess", &[]);
        assert_eq!(outcome.code(), Some(i32::from(exit::USAGE)), "trap {trap}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(why), "trap {trap}: {}", outcome.stderr);
    }
    let library = vehicle(folder.path(), "plant", &[]);
    let refused = survey(&library, "inprocess", &["node.plant.settings.drag_nspm=-1"]);
    assert!(refused.stderr.contains("it cannot create plant: a drag below 0"), "{}", refused.stderr);
}

#[test]
fn a_vehicle_that_fails_in_flight_ends_it() {
    let folder = tempfile::tempdir().unwrap();
    let rounding = "it changed the rounding mode of the processor";
    for (trap, code, why) in [
        (5, exit::PROCESS_LOST, "`step` returned 7"),
        (6, exit::PROCESS_LOST, ""),
        (7, exit::OUT_OF_BOUNDS, ""),
        (8, exit::PROCESS_LOST, rounding),
        (9, exit::PROCESS_LOST, ""),
    ] {
        if trap == 8 && !cfg!(target_arch = "x86_64") {
            continue;
        }
        let library = vehicle(folder.path(), &format!("trap{trap}"), &[&format!("-DTRAP={trap}")]);
        let lockstep = survey(&library, "lockstep", &[]);
        assert_eq!(lockstep.code(), Some(i32::from(code)), "trap {trap}: {}", lockstep.stderr);
        assert!(lockstep.stderr.contains(why), "trap {trap}: {}", lockstep.stderr);
        if trap == 9 {
            assert!(lockstep.stderr.contains("lost plant"), "it ended before its last sample: {}", lockstep.stderr);
        } else if trap != 6 {
            let same = survey(&library, "inprocess", &[]);
            assert_eq!((same.code(), same.state_hash()), (lockstep.code(), lockstep.state_hash()), "trap {trap}");
            assert!(same.stderr.contains(why), "trap {trap}: {}", same.stderr);
        }
    }
}

#[test]
fn settings_and_faults_without_effect_on_a_vehicle_of_a_user_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let library = vehicle(folder.path(), "plant", &[]);
    for (setting, why) in [
        ("plant.rotor_effectiveness=[0.9, 1.0, 1.0]", "`plant.rotor_effectiveness` has no effect here"),
        ("plant.wind_ned_mps=[[0, [1, 0, 0]]]", "`plant.wind_ned_mps` has no effect here"),
        ("plant.airframe.mass_kg=1.3", "`plant.airframe.mass_kg` has no effect here"),
        ("plant.ground.present=true", "`plant.ground.present` has no effect here"),
        ("fault=[{at_s=1, target='rotor1', kind='off'}]", "a fault of rotor1 where the plant is a library"),
        (
            "fault=[{at_s=1, target='payload', kind='mass', value=0.1}]",
            "a fault of payload where the plant is a library",
        ),
    ] {
        let outcome = survey(&library, "inprocess", &[setting]);
        assert_eq!(outcome.code(), Some(i32::from(exit::USAGE)), "{setting}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(why), "{setting}: {}", outcome.stderr);
    }
}
