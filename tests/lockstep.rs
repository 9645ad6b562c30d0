//! A flight is the same, bit for bit, in process, in lockstep, and in lockstep again.

use crate::harness::fly;

fn check_same(arguments: &[&str]) {
    let hash = |mode: &str| {
        let outcome = fly(&[arguments, &["--mode", mode, "--no-log"]].concat());
        outcome.state_hash()
    };
    let inprocess = hash("inprocess");
    assert_eq!(inprocess, hash("lockstep"), "{arguments:?}");
    assert_eq!(inprocess, hash("lockstep"), "{arguments:?}, again");
}

const NOISE: &str = "plant.noise={position_m=0.002, velocity_mps=0.005, attitude_deg=0.05, rates_dps=0.1}";

#[test]
fn the_robust_profile_is_the_same_flight_in_every_mode() {
    check_same(&["--set", "profile=robust"]);
}

#[test]
fn the_paper_profile_is_the_same_flight_in_every_mode() {
    check_same(&["--set", "profile=paper"]);
}

#[test]
fn noise_jitter_and_drops_are_the_same_in_every_mode() {
    for profile in ["profile=robust", "profile=paper"] {
        check_same(&[
            "--set",
            profile,
            "--set",
            NOISE,
            "--set",
            "run.command_drop_probability=0.2",
            "--set",
            "run.command_delay_ms=1.5",
            "--set",
            "run.command_jitter_ms=3.0",
        ]);
    }
}

#[test]
fn the_seed_decides_the_noise() {
    let hash = |seed: &str| {
        fly(&["--mode", "inprocess", "--no-log", "--set", NOISE, "--set", seed, "--set", "run.duration_s=2.0"])
            .state_hash()
    };
    assert_eq!(hash("run.seed=1"), hash("run.seed=1"));
    assert_ne!(hash("run.seed=1"), hash("run.seed=2"));
}

#[test]
fn a_run_repeats_from_its_folder_alone() {
    let first = fly(&["--mode", "inprocess", "--set", NOISE, "--set", "run.seed=7", "--set", "run.duration_s=3.0"]);
    let settings = first.out.join("scenario.toml");
    let again = fly(&[settings.to_str().expect("a plain path")]);
    assert_eq!(first.state_hash(), again.state_hash());
}

#[test]
fn nodes_share_a_cpu_unless_they_are_given_others() {
    let affinities = |more: &[&str]| {
        let outcome = fly(&[&["--mode", "lockstep", "--set", "run.duration_s=0.2"], more].concat());
        assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
        let scheduling = outcome.run()["provenance"]["scheduling"].clone();
        ["plant", "guidance", "attitude-mpc", "mixer", "recorder"]
            .map(|process| scheduling[process]["affinity"].clone())
    };
    let [plant, guidance, mpc, mixer, recorder] = affinities(&[]);
    assert!(plant.as_str().is_some_and(|cpus| cpus.parse::<usize>().is_ok()), "{plant} is one CPU");
    assert_eq!([&guidance, &mpc, &mixer], [&plant; 3]);
    let [plant, _, _, mixer, _] = affinities(&["--set", "realtime.affinity=[0, 1]"]);
    assert_eq!(plant, mixer);
    assert!(plant == "0-1" || recorder == "0", "{plant} where {recorder} are there");
}
