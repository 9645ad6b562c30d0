//! Real processes: flying in real time, stopping, dying, and leaving shared memory clean.
//!
//! No test here asserts a duration.

use std::process::Command;

use rustix::process::Pid;

use crate::control::{fly_on, status};
use crate::harness::{Flight, PATIENT, fly, launcher, namespace, shared_memory_of, skip, wait_until, write_script};

/// Returns the ids of the processes whose command line names `namespace`.
pub fn processes_of(namespace: &str) -> Vec<i32> {
    processes().filter(|pid| runs(*pid, namespace)).collect()
}

/// Returns the ids of all processes.
fn processes() -> impl Iterator<Item = i32> {
    let all = std::fs::read_dir("/proc").expect("/proc can be listed");
    all.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok())
}

/// Returns the ids of the processes that run `node` in `namespace`.
pub fn processes_named(namespace: &str, node: &str) -> Vec<i32> {
    processes_of(namespace).into_iter().filter(|pid| runs(*pid, node)).collect()
}

/// Returns the id of a process that runs `node` in `namespace`; panics if there is none.
pub fn process_of(namespace: &str, node: &str) -> i32 {
    *processes_named(namespace, node).first().unwrap_or_else(|| panic!("{node} does not run"))
}

/// Returns whether process `pid` has `word` in its command line, as the name of a node or of a namespace.
fn runs(pid: i32, word: &str) -> bool {
    let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    line.split(|b| *b == 0).any(|of| of == word.as_bytes())
}

/// Returns the ids of the children of process `pid` that run `command`.
pub fn children_of(pid: u32, command: &str) -> Vec<i32> {
    let parent = format!("PPid:\t{pid}");
    let status = |of: i32| std::fs::read_to_string(format!("/proc/{of}/status")).unwrap_or_default();
    let is_child = |of: &i32| status(*of).lines().any(|line| line == parent) && runs(*of, command);
    processes().filter(is_child).collect()
}

pub fn niceness(pid: i32) -> i32 {
    rustix::process::getpriority_process(Pid::from_raw(pid)).expect("it runs")
}

pub fn kill(signal: &str, pids: &[i32]) {
    for pid in pids {
        let _ = Command::new("kill").args([signal, &pid.to_string()]).stderr(std::process::Stdio::null()).status();
    }
}

/// Starts a flight in which no process counts as hung.
pub fn start_flying(namespace: &str) -> Flight {
    start_flying_with(namespace, PATIENT)
}

/// Starts a flight with one more setting.
fn start_flying_with(namespace: &str, setting: &str) -> Flight {
    let flight = Flight::start(namespace, &["--mode", "realtime", "--set", setting]);
    wait_until_it_flies(namespace);
    flight
}

/// Returns the active process of a `node`.
fn active(namespace: &str, node: &str) -> Option<i32> {
    let view = status(namespace);
    let node = view["nodes"].as_array()?.iter().find(|seen| seen["node"] == node)?;
    i32::try_from(node["pid"].as_i64()?).ok()
}

/// Waits until the plant has sampled for a tenth of a second.
pub fn wait_until_it_flies(namespace: &str) {
    wait_until("the stack flies", || status(namespace)["time_s"].as_f64() > Some(0.1));
}

/// A group of processes that the kernel stops, so that not even SIGKILL ends them.
struct Frozen(std::path::PathBuf);

impl Frozen {
    /// Freezes process `pid`; `None` without a usable freezer.
    fn with(pid: i32, name: &str) -> Option<Self> {
        let frozen = Self(["/sys/fs/cgroup/freezer", name].iter().collect());
        std::fs::create_dir(&frozen.0).ok()?;
        let write = |file: &str, word: &str| std::fs::write(frozen.0.join(file), word).is_ok();
        (write("cgroup.procs", &pid.to_string()) && write("freezer.state", "FROZEN")).then_some(frozen)
    }
}

impl Drop for Frozen {
    fn drop(&mut self) {
        let _ = std::fs::write(self.0.join("freezer.state"), "THAWED");
        wait_until("the frozen process ends", || std::fs::remove_dir(&self.0).is_ok());
    }
}

#[test]
fn a_process_that_cannot_be_killed_is_waited_for_with_a_line_and_left_behind() {
    let ns = namespace();
    let mut flight = start_flying(&ns);
    let Some(frozen) = Frozen::with(process_of(&ns, "mixer"), &ns) else {
        return skip("no freezer of cgroups (version 1) that this user may use");
    };
    let stopped = launcher().args(["stop", "--namespace", &ns]).status().expect("stop runs");
    assert!(stopped.success());
    wait_until("the launcher ends", || matches!(flight.child.try_wait(), Ok(Some(_))));
    drop(frozen); // the frozen process holds the launcher's stderr open
    let outcome = flight.finish();
    assert!(matches!(outcome.code(), Some(3 | 130)), "{:?} {}", outcome.code(), outcome.stderr);
    let lines = outcome.stderr.lines().filter(|line| line.contains("was killed and does not end")).count();
    assert_eq!(lines, 1, "{}", outcome.stderr);
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn real_time_flies_through_processes() {
    let ns = namespace();
    let outcome = Flight::start(&ns, &["--mode", "realtime", "--set", "run.duration_s=3.0", "--set", PATIENT]).finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.run();
    assert_eq!(run["diverged"], false);
    assert!(outcome.metric("max_position_error_m") < 0.5);
    assert!(run["log"]["records"].as_u64() > Some(1000), "{}", run["log"]);
    assert!(run["timing"]["age_at_actuator"]["n"].as_u64() > Some(200), "{}", run["timing"]);
    assert!(outcome.out.join("report.html").exists());
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    assert_eq!(processes_of(&ns), Vec::<i32>::new());
}

#[test]
fn ctrl_c_stops_cleanly() {
    let ns = namespace();
    let flight = start_flying(&ns);
    kill("-INT", &[flight.child.id() as i32]);
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
    assert_eq!(outcome.run()["exit_code"], 130);
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    assert_eq!(processes_of(&ns), Vec::<i32>::new());
}

#[test]
fn stop_ends_a_flight() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let stop = launcher().args(["stop", "--namespace", &ns]).status().expect("stop runs");
    assert!(stop.success());
    assert_eq!(flight.finish().code(), Some(130));
    let again = launcher().args(["stop", "--namespace", &ns]).output().expect("stop runs");
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("no stack runs"));
}

/// Lists the events of `node`, in order.
pub fn events(run: &serde_json::Value, node: &str) -> Vec<String> {
    let all = run["events"].as_array().expect("events");
    let of_node = all.iter().filter(|event| event["node"] == node);
    of_node.map(|event| event["what"].as_str().expect("what").to_owned()).collect()
}

fn position_error_m(outcome: &crate::harness::Outcome) -> f64 {
    outcome.metric("max_position_error_m")
}

#[test]
fn without_the_plant_the_run_ends_with_its_name() {
    let ns = namespace();
    let flight = start_flying(&ns);
    kill("-KILL", &[process_of(&ns, "plant")]);
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(3), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("plant"), "{}", outcome.stderr);
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_process_that_dies_or_hangs_is_replaced_in_flight() {
    for (signal, seen) in [("-KILL", "died"), ("-STOP", "hung")] {
        let ns = namespace();
        // No successor is late, or one too many, because the machine has stalled it.
        let patience = "supervision={ restart_ms = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], start_limit_s = 60.0 }";
        let flight = start_flying_with(&ns, patience);
        for victim in ["guidance", "attitude-mpc", "mixer", "guidance", "mixer"] {
            wait_until("a process is active", || active(&ns, victim).is_some());
            let before = active(&ns, victim).expect("it was");
            kill(signal, &[before]);
            wait_until("another process is active", || active(&ns, victim).is_some_and(|pid| pid != before));
        }
        fly_on(&ns, 2.0); // the vehicle returns to its path
        kill("-INT", &[flight.child.id() as i32]);
        let outcome = flight.finish();
        assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
        let run = outcome.run();
        for victim in ["guidance", "attitude-mpc", "mixer"] {
            let events = events(&run, victim);
            // Other events may occur: on a loaded machine a delayed process may count as hung.
            assert!(events.contains(&seen.to_owned()), "{signal} {victim}: {events:?}");
            assert_eq!(events.last().map(String::as_str), Some("took-over"), "{signal} {victim}: {events:?}");
        }
        assert!(position_error_m(&outcome) < 1.0, "{signal}: {}", position_error_m(&outcome));
        assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    }
}

#[test]
fn a_successor_that_hangs_while_it_starts_is_replaced_too() {
    let ns = namespace();
    let flight = start_flying_with(&ns, "supervision.restart_ms=[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]");
    let first = process_of(&ns, "guidance");
    kill("-KILL", &[first]);
    let successor = || processes_of(&ns).into_iter().find(|pid| *pid != first && runs(*pid, "guidance"));
    wait_until("its successor is there", || successor().is_some());
    let second = successor().expect("it lives");
    kill("-STOP", &[second]);
    wait_until("a third is active", || active(&ns, "guidance").is_some_and(|pid| ![first, second].contains(&pid)));
    kill("-INT", &[flight.child.id() as i32]);
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
    let events = events(&outcome.run(), "guidance");
    assert!(events.contains(&"hung".to_owned()), "{events:?}");
    assert_eq!(events.last().map(String::as_str), Some("took-over"), "{events:?}");
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_node_that_dies_too_often_is_given_up_and_the_vehicle_comes_down() {
    let start = |node| {
        let kill = |at_s| format!("{{at_s={at_s:?}, target=\"{node}\", kind=\"kill\"}}");
        // Four of them hit a process, also if some come at once because the launcher was stalled.
        let kills: Vec<String> = (1..=10).map(|i| kill(0.4 * f64::from(i))).collect();
        let faults = format!("fault=[{}]", kills.join(","));
        Flight::start(
            &namespace(),
            &["--mode", "realtime", "--set", "run.duration_s=7.0", "--set", &faults, "--set", PATIENT],
        )
    };
    let flights = ["guidance", "attitude-mpc"].map(|node| (node, start(node)));
    for (node, flight) in flights {
        let outcome = flight.finish();
        assert_eq!(outcome.code(), Some(3), "{node}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(node), "{}", outcome.stderr);
        let run = outcome.run();
        assert_eq!(run["diverged"], false, "{node}");
        let events = events(&run, node);
        assert_eq!(events.iter().filter(|what| *what == "died").count(), 4, "{node}: {events:?}");
        assert_eq!(events.last().map(String::as_str), Some("given-up"), "{node}: {events:?}");
        let log = flight::log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
        let last = log.truths.last().expect("truths").actual;
        let [roll, pitch, _] = last.attitude_rad;
        assert!(roll.abs().max(pitch.abs()) < 0.2, "{node}: it is level, {roll} {pitch}");
        assert!((0.4..1.0).contains(&last.velocity_mps[2]), "{node}: it sinks at {} m/s", last.velocity_mps[2]);
    }
}

#[test]
fn after_killing_everything_or_the_launcher_alone_the_next_flight_starts_clean() {
    for alone in [false, true] {
        let ns = namespace();
        let flight = start_flying(&ns);
        let launcher = flight.child.id() as i32;
        kill("-KILL", &if alone { vec![launcher] } else { processes_of(&ns) });
        drop(flight);
        wait_until("every process is gone", || processes_of(&ns).is_empty());
        // A launcher of another test may have removed the leftovers already.
        let outcome =
            Flight::start(&ns, &["--mode", "realtime", "--set", "run.duration_s=0.5", "--set", PATIENT]).finish();
        assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
        assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    }
}

/// Returns whether process `pid` has ended. A process that is not reaped yet has an empty command line.
fn is_gone(pid: i32) -> bool {
    std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default().is_empty()
}

#[test]
fn a_foreign_program_and_its_children_do_not_outlive_the_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // Neither program joins. `family` starts a child and reads the mode of its settings; both programs write the ids of
    // their processes.
    let program = |name: &str, text: &str| {
        let path = folder.path().join(name);
        write_script(&path, &format!("#!/bin/sh\n{text}\n"));
        path.display().to_string()
    };
    let family = program("family", "sleep 60 & echo $$ $! $(stat -c %a $6) > $0.says; wait");
    let loner = program("loner", "echo $$ > $0.says; exec sleep 60");
    let says = |program: &str| -> Vec<i32> {
        let text = std::fs::read_to_string(format!("{program}.says")).unwrap_or_default();
        text.split_whitespace().map(|word| word.parse().expect("a number")).collect()
    };

    let ns = namespace();
    let swap = |at_s: f64, node, program| format!("{{at_s={at_s:?}, node=\"{node}\", exec=\"{program}\"}}");
    let swaps = format!("swap=[{}, {}]", swap(0.5, "mixer", &family), swap(3.0, "guidance", &loner));
    let patience = "supervision={ hang_ms = 60000.0, start_limit_s = 5.0 }"; // a program that does not join is sent away
    let flight = Flight::start(&ns, &["--mode", "realtime", "--set", &swaps, "--set", patience]);
    wait_until("a script and its child are there", || says(&family).len() == 3);
    let [parent, child, mode] = says(&family).try_into().expect("three numbers");
    assert_eq!(mode, 600, "its settings are for its user only");
    wait_until("it is sent away with its child", || is_gone(parent) && is_gone(child));

    wait_until("another is there", || says(&loner).len() == 1);
    kill("-KILL", &[flight.child.id() as i32]);
    wait_until("it goes with the launcher", || is_gone(says(&loner)[0]));
    drop(flight);
    wait_until("every process is gone", || processes_of(&ns).is_empty());
}

#[test]
fn ten_stacks_at_once_do_not_disturb_each_other() {
    let arguments = ["--mode", "lockstep", "--no-log", "--set", "run.duration_s=5.0"];
    let flights: Vec<Flight> = (0..10).map(|_| Flight::start(&namespace(), &arguments)).collect();
    let hashes: Vec<String> = flights.into_iter().map(|flight| flight.finish().state_hash()).collect();
    let alone = fly(&["--mode", "inprocess", "--no-log", "--set", "run.duration_s=5.0"]).state_hash();
    assert!(hashes.iter().all(|hash| *hash == alone), "{hashes:?} against {alone}");
}

#[test]
fn a_namespace_holds_one_stack() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let second = Flight::start(&ns, &["--mode", "realtime"]).finish();
    assert_eq!(second.code(), Some(2));
    assert!(second.stderr.contains("in use"), "{}", second.stderr);
    assert!(!second.out.exists(), "a refused flight leaves no folder");
    // A process that the launcher did not start cannot join either.
    let stray = launcher().args(["node", "mixer", "--namespace", &ns]).output().expect("the launcher starts");
    assert_eq!(stray.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&stray.stderr).contains("did not start it"));
    kill("-INT", &[flight.child.id() as i32]);
    assert_eq!(flight.finish().code(), Some(130), "the first flight goes on undisturbed");
}

#[test]
fn a_node_that_was_stopped_counts_what_it_slept_through() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let plant = process_of(&ns, "plant"); // any other node would be replaced
    kill("-STOP", &[plant]);
    std::thread::sleep(std::time::Duration::from_millis(300)); // 30 samples of the plant's clock, or more
    kill("-CONT", &[plant]);
    fly_on(&ns, 0.1);
    kill("-INT", &[flight.child.id() as i32]);
    let run = flight.finish().run();
    let plant = &run["timing"]["nodes"]["plant"];
    assert!(plant["slips"].as_u64() > Some(10), "{plant}");
    assert!(plant["misses"].as_u64() >= plant["slips"].as_u64(), "{plant}");
}
