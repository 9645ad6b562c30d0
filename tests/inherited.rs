//! Signal settings and limits that the launcher inherits, and a program file that is replaced in flight.

use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};

use crate::control::{status, tell};
use crate::harness::{PATIENT, copy_program, launcher, namespace, shared_memory_of, skip, wait_until};

/// Returns the command `trefoil fly` into `out`, started by `wrapper`; `None` if `wrapper` cannot be run here.
fn fly_by(wrapper: &[&str], namespace: &str, arguments: &[&str], out: &tempfile::TempDir) -> Option<Command> {
    if !Command::new(wrapper[0]).args(&wrapper[1..]).arg("true").status().is_ok_and(|status| status.success()) {
        skip(&format!("{wrapper:?} cannot be run"));
        return None;
    }
    let mut command = Command::new(wrapper[0]);
    command.args(&wrapper[1..]).arg(launcher().get_program()).arg("fly").args(arguments);
    command.args(["--namespace", namespace, "--out"]).arg(out.path().join("run"));
    command.stdin(Stdio::null()).stdout(Stdio::null());
    Some(command)
}

/// Sends `signal` to a real-time flight of `duration_s` started by `wrapper`. Returns the exit code, or 128 plus the
/// number of the signal that ended the flight; `None` if `wrapper` cannot be run here.
fn signalled(wrapper: &[&str], signal: Signal, duration_s: f64) -> Option<i32> {
    let (ns, out) = (namespace(), tempfile::tempdir().expect("a temporary folder"));
    let duration = format!("run.duration_s={duration_s:?}");
    let arguments = ["--no-log", "--set", &duration, "--set", PATIENT];
    let mut flight = fly_by(wrapper, &ns, &arguments, &out)?.spawn().expect("starts");
    wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(0.1));
    kill_process(Pid::from_child(&flight), signal).expect("signalled");
    let status = flight.wait().expect("it ends");
    status.code().or_else(|| status.signal().map(|signal| 128 + signal))
}

#[test]
fn a_parent_that_ignores_its_children_is_no_parent_of_ours() {
    let (ns, out) = (namespace(), tempfile::tempdir().expect("a temporary folder"));
    let arguments = ["--mode", "lockstep", "--set", "run.duration_s=0.5"];
    let Some(mut flight) = fly_by(&["env", "--ignore-signal=CHLD"], &ns, &arguments, &out) else { return };
    assert_eq!(flight.status().expect("it ends").code(), Some(0));
    assert!(shared_memory_of(&ns).is_empty());
}

#[test]
fn a_signal_that_the_parent_has_blocked_still_stops_a_flight() {
    let code = signalled(&["env", "--block-signal=INT"], Signal::INT, 3600.0);
    assert!(code.is_none_or(|code| code == 130), "{code:?}");
}

#[test]
fn a_flight_under_nohup_outlives_its_terminal() {
    let code = signalled(&["env", "--ignore-signal=HUP"], Signal::HUP, 5.0);
    assert!(code.is_none_or(|code| code == 0), "{code:?}");
}

#[test]
fn a_limit_on_the_size_of_files_is_a_reason() {
    for (mode, code, reason) in [("inprocess", 3, "File too large"), ("lockstep", 2, "`ulimit -f`")] {
        let out = tempfile::tempdir().expect("a temporary folder");
        let wrapper = ["bash", "-c", "ulimit -f 100 && exec \"$0\" \"$@\""];
        let arguments = ["--mode", mode, "--set", "run.duration_s=20.0"];
        let Some(mut flight) = fly_by(&wrapper, &namespace(), &arguments, &out) else { return };
        let output = flight.output().expect("it ends");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), said.contains(reason)), (Some(code), true), "{mode}: {said}");
    }
}

#[test]
fn a_program_that_is_built_anew_in_flight_is_still_the_one_that_flies() {
    let (ns, folder) = (namespace(), tempfile::tempdir().expect("a temporary folder"));
    let program = folder.path().join("trefoil");
    copy_program(Path::new(launcher().get_program()), &program);
    let mut flight = Command::new(&program);
    flight.args(["fly", "--no-log", "--set", "run.duration_s=3600.0", "--set", PATIENT, "--namespace", &ns, "--out"]);
    let mut flight = flight.arg(folder.path().join("run")).stdout(Stdio::null()).spawn().expect("the launcher starts");
    wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(0.1));
    std::fs::remove_file(&program).expect("removed");
    std::fs::write(&program, "half a program").expect("written");
    tell(&ns, &["inject", "mixer", "kill"]).expect("a fault");
    wait_until("a restarted process is active", || status(&ns)["nodes"][3]["restarts"].as_u64() >= Some(1));
    wait_until("it works", || status(&ns)["nodes"][3]["tick"].as_u64() > Some(0));
    let stopped = tell(&ns, &["stop"]).expect("it stops");
    assert!(stopped.contains(&format!("namespace '{ns}', process {}", flight.id())), "{stopped}");
    assert_eq!(flight.wait().expect("it ends").code(), Some(130));
}
