//! Output of a flight: to stdout and stderr of any kind, and into a folder of its own.

use std::fs;
use std::io::{BufRead, BufReader, PipeReader, PipeWriter, Write, pipe};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use rustix::fs::{OFlags, fcntl_setfl};
use rustix::process::{Pid, Signal, kill_process};

use crate::control::{flying, status};
use crate::harness::{Flight, PATIENT, fly, land, launcher, namespace, skip, wait_until, write_script};

/// Returns the command of a flight in lockstep that prints to stderr in flight, because the program of its swap cannot
/// be started.
fn talking(folder: &Path) -> Command {
    let program = folder.join("program");
    write_script(&program, "#!/nonexistent/interpreter\n");
    let swap = "at_s = 0.1\nstandby_s = 0.1\nwatch_s = 0.1\nnode = \"mixer\"";
    let text =
        format!("[run]\nmode = \"lockstep\"\nduration_s = 0.5\n[[swap]]\n{swap}\nexec = \"{}\"\n", program.display());
    fs::write(folder.join("scenario.toml"), text).expect("written");
    let mut command = launcher();
    command.arg("fly").arg(folder.join("scenario.toml")).args(["--namespace", &namespace(), "--out"]);
    command.arg(folder.join("run")).stdin(Stdio::null()).stdout(Stdio::null());
    command
}

/// Returns a pipe that is full.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = pipe().expect("a pipe");
    fcntl_setfl(&writer, OFlags::NONBLOCK).expect("set");
    while writer.write(&[b'x'; 4096]).is_ok() {}
    fcntl_setfl(&writer, OFlags::empty()).expect("set");
    (reader, writer)
}

fn finish(mut child: Child) -> Option<i32> {
    child.wait().expect("the launcher ends").code()
}

#[test]
fn stderr_that_takes_nothing_neither_ends_nor_holds_up_a_flight() {
    let closed = || pipe().expect("a pipe").1;
    let device = || fs::File::options().write(true).open("/dev/full").expect("opens");
    let (_unread, full) = full_pipe();
    for (what, stderr) in [("closed", Stdio::from(closed())), ("full", device().into()), ("not read", full.into())] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let child = talking(folder.path()).stderr(stderr).spawn().expect("the launcher starts");
        assert_eq!(finish(child), Some(1), "without its swap; stderr is {what}");
        assert!(folder.path().join("run/run.json").exists(), "stderr is {what}");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = talking(folder.path()).stderr(Stdio::piped()).output().expect("the launcher runs");
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot start"), "it does say something");
}

#[test]
fn what_was_asked_for_and_cannot_be_printed_is_an_error() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let full = || fs::File::options().write(true).open("/dev/full").expect("opens");
    let flight = talking(folder.path()).arg("--json").stdout(full()).stderr(Stdio::piped()).output();
    let listing = launcher().args(["status", "--json"]).stdout(full()).output();
    let help = launcher().arg("--help").stdout(full()).output();
    for (said, output) in [("cannot write to stdout", flight), ("cannot write to stdout", listing), ("", help)] {
        let output = output.expect("the launcher runs");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), stderr.contains(said)), (Some(3), true), "{stderr}");
    }
}

#[test]
fn flights_side_by_side_have_folders_of_their_own() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let start = || {
        let mut command = launcher();
        command.args(["fly", "--mode", "inprocess", "--no-log", "--set", "run.duration_s=0.05"]);
        command.current_dir(folder.path()).stdout(Stdio::null()).spawn().expect("the launcher starts")
    };
    let flights: Vec<Child> = (0..24).map(|_| start()).collect();
    let codes: Vec<_> = flights.into_iter().map(finish).collect();
    assert!(codes.iter().all(|code| *code == Some(0)), "{codes:?}");
    let runs: Vec<_> = fs::read_dir(folder.path().join("runs")).expect("runs").flatten().collect();
    assert_eq!(runs.len(), 24);
    assert!(runs.iter().all(|run| run.path().join("run.json").exists()));
}

#[test]
fn a_folder_that_is_flown_into_is_refused() {
    let ns = namespace();
    let flight = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    let second = launcher().args(["fly", "--mode", "inprocess", "--out"]).arg(&flight.out).output().expect("runs");
    let said = String::from_utf8_lossy(&second.stderr).into_owned();
    assert_eq!((second.status.code(), said.contains("another flight is writing to it")), (Some(2), true), "{said}");
    assert_eq!(land(flight)["mode"], "realtime");
}

#[test]
fn a_start_that_fails_leaves_no_folder() {
    let ns = namespace();
    let flight = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    for out in [&["--out", "deep/down/run"][..], &[]] {
        let second = launcher().args(["fly", "--namespace", &ns]).args(out).current_dir(folder.path()).output();
        assert_eq!(second.expect("runs").status.code(), Some(2));
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0, "{out:?}");
    }
    land(flight);
}

#[test]
fn a_trace_replaces_nothing_but_a_file() {
    let outcome = fly(&["--mode", "lockstep", "--set", "run.duration_s=0.2"]);
    let pipe = outcome.out.join("pipe");
    if !Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()) {
        return skip("there is no mkfifo");
    }
    let trace = launcher()
        .args(["export", "--to", "perfetto"])
        .arg(&outcome.out)
        .arg("--out")
        .arg(&pipe)
        .output()
        .expect("export runs");
    let said = String::from_utf8_lossy(&trace.stderr).into_owned();
    assert_eq!((trace.status.code(), said.contains("a regular file belongs there")), (Some(2), true), "{said}");
    assert!(pipe.metadata().expect("it is there").file_type().is_fifo());
}

#[test]
fn the_shortest_flights_are_seen_whole() {
    for i in 0..24 {
        let ticks = [1, 2, 5, 30][i % 4];
        let duration = format!("run.duration_s={}", f64::from(ticks) / 100.0);
        let log: &[&str] = if i % 3 == 0 { &["--no-log"] } else { &[] };
        let outcome = fly(&[&["--mode", "lockstep", "--set", &duration], log].concat());
        let run = outcome.run();
        assert_eq!(outcome.code(), Some(0), "{}: {}", run["ended"], outcome.stderr);
        assert!(run["state_hash"].is_string(), "{ticks} ticks, {log:?}");
        if log.is_empty() {
            let logged = ["records", "dropped"].map(|key| run["log"][key].as_i64());
            assert_eq!(logged, [Some(5 * (i64::from(ticks) + 1)), Some(0)], "{ticks} ticks");
        }
    }
}

#[test]
fn a_launcher_that_waits_for_a_slow_recorder_says_so() {
    let ns = namespace();
    let mut flight = Flight::start(&ns, &["--set", PATIENT]);
    wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(0.1));
    let parent = flight.child.id().to_string();
    let found = Command::new("pgrep").args(["-P", &parent, "-f", "node recorder"]).output();
    let Ok(found) = found else { return skip("there is no pgrep") };
    let pid = String::from_utf8_lossy(&found.stdout).trim().parse().ok().and_then(Pid::from_raw).expect("a recorder");
    kill_process(pid, Signal::STOP).expect("stopped");
    kill_process(Pid::from_child(&flight.child), Signal::INT).expect("it flies");
    let mut lines = BufReader::new(flight.child.stderr.take().expect("a pipe")).lines();
    let said = lines.by_ref().map_while(Result::ok).find(|line| line.contains("for the recorder to end"));
    kill_process(pid, Signal::CONT).expect("it goes on");
    assert!(said.is_some());
    assert_eq!(flight.finish().code(), Some(130));
}

#[test]
fn a_flight_that_diverges_is_not_said_to_be_inside_its_bounds() {
    let lost = ["plant.rotor_lag_s=0.2", "bounds.max_position_error_m=inf", "bounds.max_fallback_s=inf"];
    let sets = lost.iter().flat_map(|set| ["--set", set]);
    let arguments: Vec<&str> = ["--mode", "inprocess", "--no-log"].into_iter().chain(sets).collect();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = launcher().arg("fly").args(&arguments).arg("--out").arg(folder.path().join("run")).output();
    let output = output.expect("it ends");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let first = said.lines().next().expect("a line");
    assert!(output.status.code() == Some(1) && first.contains("diverged") && !first.contains("inside"), "{said}");
}
