//! Bad input: a clear message with the place, exit 2, nothing half-written.

use crate::harness::{Outcome, fly};

fn check_refused(arguments: &[&str], message: &[&str]) -> Outcome {
    let outcome = fly(arguments);
    assert_eq!(outcome.code(), Some(2), "{arguments:?}: {}", outcome.stderr);
    for part in message {
        assert!(outcome.stderr.contains(part), "{arguments:?} should say '{part}': {}", outcome.stderr);
    }
    assert!(!outcome.out.exists(), "{arguments:?} leaves no folder");
    outcome
}

#[test]
fn settings_that_cannot_be() {
    check_refused(&["--set", "mpc.np=30"], &["--set mpc.np=30", "`attitude.mpc.prediction_horizon_s = 0.3`"]);
    check_refused(&["--set", "attitude.mpc.max_iterations=\"many\""], &["--set attitude.mpc.max_iterations"]);
    check_refused(&["--set", "attitude.mpc.r=[1, 2]"], &["--set attitude.mpc.r", "4"]);
    check_refused(&["--set", "plant.rotor_lag_s=-1.0"], &["rotor_lag_s"]);
    check_refused(
        &["--set", "attitude.mpc={prediction_horizon_s=0.03, control_horizon_s=0.05}"],
        &["attitude.mpc.control_horizon_s", "5 and 3 samples at 100 Hz"],
    );
    check_refused(&["--set", "run.duration_s=nan"], &["duration_s"]);
    check_refused(&["--set", "mission.trajectory=loop"], &["survey", "expected one of `survey`, `hover`, `parts`"]);
    check_refused(&["no/such/file.toml"], &["no/such/file.toml"]);
}

#[test]
fn a_file_is_named_with_its_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("wrong.toml");
    std::fs::write(&path, "profile = \"robust\"\n\n[plant]\nrotor_lag = 0.03\n").expect("can be written");
    check_refused(&[path.to_str().expect("a plain path")], &["wrong.toml:4", "rotor_lag_s"]);
}

#[test]
fn what_is_no_regular_file_of_sane_size_is_refused_at_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (fifo, log, large) = (at("fifo"), at("flight.mcap"), at("large.toml"));
    for path in [&fifo, &log] {
        rustix::fs::mkfifoat(rustix::fs::CWD, path, rustix::fs::Mode::RUSR).expect("a FIFO");
    }
    std::fs::write(&large, "key = 1\n".repeat(200_000)).expect("can be written");
    check_refused(&[&fifo], &["it is a FIFO; give a regular file"]);
    check_refused(&["/dev/zero"], &["/dev/zero", "it is a device"]);
    check_refused(&[&at("")], &["it is a directory"]);
    check_refused(&[&large], &["it has 1600000 bytes, and 1048576 are the most that is read"]);
    for arguments in [&["check", &fifo][..], &["report", &at("")], &["export", &log, "--to", "perfetto"]] {
        let output = crate::harness::launcher().args(arguments).output().expect("the launcher runs");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && stderr.contains("it is a FIFO"), "{arguments:?}: {stderr}");
    }
}

#[test]
fn check_refuses_what_fly_refuses() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scenario.toml");
    let path = path.to_str().expect("a plain path");
    for (text, expected) in [
        (
            "[attitude.mpc]\nq = [0, 0, 0, 1e12, 0, 0, 0]\nr = [1e-12, 1e-12, 1e-12, 1e-12]\nterminal = \"zero\"",
            "`attitude.mpc.r` is so small beside `attitude.mpc.q`",
        ),
        ("[mission]\nwaypoints_m = [[0, 0, 0], [1, 2, 3]]", "[[mission.part]] kind = \"waypoints\""),
        (
            "[[fault]]\nat_s = 100\ntarget = \"mixer\"\nkind = \"kill\"",
            "a fault at 100.0 s in a flight that ends at 60.0 s",
        ),
        ("[[swap]]\nat_s = 100\nnode = \"mixer\"", "a swap at 100.0 s in a flight that ends at 60.0 s"),
        ("airframe.g_mps2 = 1e308", "`airframe.g_mps2` = 1e308 is out of range"),
        ("[[swap]]\nat_s = 1.0\nnode = \"mixer\"\nexec = \"./no-such-mixer\"", "`./no-such-mixer`"),
    ] {
        std::fs::write(path, text).expect("can be written");
        let flown = check_refused(&[path], &[expected]);
        let checked = crate::harness::launcher().args(["check", path]).output().expect("the launcher runs");
        assert_eq!(
            (checked.status.code(), String::from_utf8_lossy(&checked.stderr).into_owned()),
            (Some(2), flown.stderr)
        );
    }
}

#[test]
fn an_output_folder_that_cannot_be_written() {
    // A file takes the place of the folder, since root may write into a folder of any mode.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("occupied");
    std::fs::write(&file, "precious").expect("can be written");
    let inside = file.join("run");
    let outcome = crate::harness::launcher()
        .args(["fly", "--mode", "inprocess", "--out"])
        .arg(&inside)
        .output()
        .expect("the launcher runs");
    assert_eq!(outcome.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&outcome.stderr).contains("occupied"));
    assert_eq!(std::fs::read_to_string(&file).expect("still there"), "precious");
}

#[test]
fn an_earlier_run_in_the_folder_is_kept() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("run");
    for _ in 0..2 {
        let status = crate::harness::launcher()
            .args(["fly", "--mode", "inprocess", "--set", "run.duration_s=0.1", "--out"])
            .arg(&out)
            .output()
            .expect("the launcher runs")
            .status;
        assert!(status.success());
    }
    assert!(out.join("run.json").exists() && folder.path().join("run.1").join("run.json").exists());
}

#[test]
fn an_error_of_input_says_what_to_write_instead() {
    let said = |arguments: &[&str]| {
        let output = crate::harness::launcher().args(arguments).output().expect("the launcher runs");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let swap = said(&["swap", "mpc"]);
    assert!(swap.contains("did you mean `attitude-mpc`?") && !swap.contains("`plant`"), "{swap}");
    let turned = said(&["inject", "drop", "controls"]);
    assert!(turned.contains("`trefoil inject controls drop`"), "{turned}");
    let unknown = said(&["inject", "nothing", "drop"]);
    assert!(unknown.contains("`mpc`") && !unknown.contains("solver"), "{unknown}");
    let shard = said(&["campaign", "campaigns/laws.toml", "--shard", "0"]);
    assert!(shard.contains("1 or more") && !shard.contains("18446744073709551615"), "{shard}");
    let campaign = said(&["campaign", "scenarios/wind.toml", "--plan"]);
    assert!(campaign.contains("is a scenario, which `trefoil fly scenarios/wind.toml` flies once"), "{campaign}");
    let legs =
        "mission.part=[{kind='waypoints', curve='trapezoid', ramp_s=9, points_m=[[1,0,0],[0,0,0]], times_s=[3,2]}]";
    let times = said(&["fly", "--set", legs]);
    assert!(times.contains("does not rise") && !times.contains("leg of"), "{times}");
    for verb in [&["report"][..], &["replay"], &["explain"], &["export", "--to", "perfetto"]] {
        for (run, expected) in [("docs", "is a folder without a log"), ("README.md", "is no log of a flight")] {
            let said = said(&[verb, &[run]].concat());
            assert!(said.contains(expected) && said.contains("as `trefoil fly` makes it"), "{verb:?} {run}: {said}");
        }
    }
}
