//! Processes that do not belong to a run do not get into it, and damage around a run is reported.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;

use crate::harness::{Flight, NOBODY, fly, has_root, land, launcher, namespace, shared_memory_of, skip, wait_until};
use crate::processes::{processes_of, start_flying};

/// Details of the events `what` of the host.
fn incidents(run: &Value, what: &str) -> Vec<String> {
    let all = run["events"].as_array().expect("events").iter().filter(|event| event["what"] == what);
    all.map(|event| event["why"].as_str().expect("a detail").to_owned()).collect()
}

fn refused(run: &Value, listener: &str, cause: &str) -> u64 {
    run["refused"][listener][cause].as_u64().unwrap_or_else(|| panic!("no {cause} of {listener} in {}", run["refused"]))
}

fn with_faults(mode: &str, duration_s: f64, faults: &str) -> Vec<String> {
    let set = |text: String| ["--set".to_owned(), text];
    let duration = set(format!("run.duration_s={duration_s}"));
    let mode = ["--mode".to_owned(), mode.to_owned()];
    [mode, duration, set(format!("fault=[{faults}]"))].concat()
}

fn fly_with(mode: &str, duration_s: f64, faults: &str) -> crate::harness::Outcome {
    let arguments = with_faults(mode, duration_s, faults);
    fly(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn nothing_of_a_run_is_open_to_other_users() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let paths = shared_memory_of(&ns);
    assert!(paths.len() > 10, "page and segments: {paths:?}");
    let folder = PathBuf::from(&paths[0]);
    assert!(paths.iter().all(|path| PathBuf::from(path).starts_with(&folder)), "{paths:?}");
    for folder in [folder.parent().expect("the user's folder"), &folder] {
        let mode = fs::metadata(folder).expect("it is there").permissions().mode();
        assert_eq!(mode & 0o7777, 0o700, "{}", folder.display());
    }
    land(flight);
}

#[test]
fn another_user_is_refused_and_the_flight_does_not_notice() {
    if !has_root() {
        return;
    }
    let ns = namespace();
    let flight = start_flying(&ns);
    let mut join = launcher();
    let joined = join.args(["node", "mixer", "--namespace", &ns]).uid(NOBODY).gid(NOBODY).output();
    match joined {
        Ok(output) => {
            let words = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(3), "{words}");
            assert!(words.contains("no stack runs"), "{words}");
        }
        Err(error) => skip(&format!("another user cannot run the launcher ({error})")),
    }
    for file in shared_memory_of(&ns) {
        let mut read = Command::new("head");
        let read = read.args(["-c1", &file]).current_dir("/dev/shm").uid(NOBODY).gid(NOBODY).output();
        assert!(!read.expect("head runs").status.success(), "{file}");
    }
    let run = land(flight);
    assert_eq!(run["events"].as_array().map(Vec::len), Some(0), "{}", run["events"]);
}

#[test]
fn a_second_process_for_a_node_is_turned_away() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let second = launcher().args(["node", "mixer", "--namespace", &ns]).output().expect("the launcher starts");
    assert_eq!(second.status.code(), Some(3));
    let words = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(words.contains("did not start it"), "{words}");
    let run = land(flight);
    assert_eq!(refused(&run, "plant", "publisher"), 0, "it has sent no message");
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn intruders_are_refused_and_change_nothing() {
    let topics = ["state", "reference", "controls", "actuators"];
    let kinds = ["second-publisher", "wrong-layout", "wrong-user"];
    let kinds = if has_root() { &kinds[..] } else { &kinds[..2] };
    let fault =
        |kind| topics.map(|topic| format!("{{at_s=1, for_s=50, target=\"{topic}\", kind=\"{kind}\"}}")).join(",");
    let faults: Vec<String> = kinds.iter().map(fault).collect();
    let outcome = fly_with("lockstep", 60.0, &faults.join(","));
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    assert_eq!(outcome.state_hash(), fly_with("inprocess", 60.0, "").state_hash());
    let run = outcome.run();
    assert_eq!(incidents(&run, "intruder-spoke").len(), topics.len(), "{}", run["events"]);
    let doors = (kinds.len() - 1) * topics.len();
    assert_eq!(incidents(&run, "intruder-refused").len(), doors, "{}", run["events"]);
    for listener in ["guidance", "attitude-mpc", "mixer", "plant"] {
        assert!(refused(&run, listener, "publisher") > 0, "a stolen epoch: {}", run["refused"]);
        assert!(refused(&run, listener, "epoch") > 0, "an epoch made up: {}", run["refused"]);
    }
}

#[test]
fn a_second_publisher_in_real_time_is_refused() {
    let fault = "{at_s=0.5, for_s=1, target=\"actuators\", kind=\"second-publisher\"}";
    let outcome = fly_with("realtime", 3.0, fault);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    assert!(refused(&outcome.run(), "plant", "publisher") > 0, "{}", outcome.run()["refused"]);
    assert!(outcome.metric("max_position_error_m") < 0.5, "its commands stop the motors");
}

#[test]
fn segments_that_are_removed_are_named_and_the_flight_goes_on() {
    let ns = namespace();
    let arguments = with_faults("realtime", 3.0, "{at_s=1, target=\"host\", kind=\"shm-removed\", process=\"mixer\"}");
    let outcome = Flight::start(&ns, &arguments.iter().map(String::as_str).collect::<Vec<_>>()).finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let files = incidents(&outcome.run(), "shm-removed");
    let of_the_run = format!("/{ns}/");
    assert!(!files.is_empty() && files.iter().all(|file| file.contains(&of_the_run)), "{files:?}");
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_node_that_cannot_map_a_segment_is_lost_by_name() {
    let removed = "{at_s=0.5, target=\"host\", kind=\"shm-removed\", process=\"plant\"}";
    let killed = "{at_s=1, target=\"guidance\", kind=\"kill\"}";
    let outcome = fly_with("realtime", 2.5, &format!("{removed},{killed}"));
    assert_eq!(outcome.code(), Some(3), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("topic 'state': plant cannot be heard"), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("lost guidance"), "{}", outcome.stderr);
}

#[test]
fn a_control_page_that_is_cut_short_ends_every_process_with_the_reason() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let page = shared_memory_of(&ns).into_iter().find(|path| path.ends_with("/page")).expect("a page");
    fs::OpenOptions::new().write(true).open(page).and_then(|file| file.set_len(0)).expect("it is ours");
    let outcome = flight.finish();
    assert_ne!(outcome.code(), Some(0));
    assert!(outcome.stderr.contains("SIGBUS"), "{}", outcome.stderr);
    wait_until("every process is gone", || processes_of(&ns).is_empty());
    let next = Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=0.5"]).finish();
    assert_eq!(next.code(), Some(0), "{}", next.stderr);
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_clock_that_is_off_is_flagged_and_the_flight_goes_on() {
    let ahead = "{at_s=1, for_s=1, target=\"clock\", kind=\"offset\", process=\"attitude-mpc\", ms=5}";
    let behind = "{at_s=1, for_s=1, target=\"clock\", kind=\"offset\", process=\"guidance\", ms=-5}";
    let contradictions = |run: &Value, node: &str| run["timing"]["clock_contradictions"][node].as_u64();
    let run = fly_with("realtime", 3.0, &format!("{ahead},{behind}")).run();
    assert!(contradictions(&run, "guidance") > Some(50), "before the sample: {}", run["timing"]);
    assert!(contradictions(&run, "mixer") > Some(50), "before the demand: {}", run["timing"]);
    assert_eq!(run["diverged"], false);

    let lockstep = fly_with("lockstep", 3.0, &format!("{ahead},{behind}"));
    assert_eq!(lockstep.state_hash(), fly_with("inprocess", 3.0, "").state_hash());
    assert!(contradictions(&lockstep.run(), "guidance") > Some(0));
    let quiet = fly_with("realtime", 3.0, "").run();
    assert_eq!(
        quiet["timing"]["clock_contradictions"],
        serde_json::json!({
            "plant": 0, "guidance": 0, "attitude-mpc": 0, "mixer": 0,
        })
    );
}

#[test]
fn a_disk_that_is_full_costs_the_log_and_nothing_else() {
    for mode in ["realtime", "lockstep", "inprocess"] {
        let outcome = fly_with(mode, 3.0, "{at_s=1.5, target=\"host\", kind=\"disk-full\"}");
        assert_eq!(outcome.code(), Some(3), "{mode}: {}", outcome.stderr);
        let run = outcome.run();
        assert_eq!(run["ended"], "flown to the end, 3.00 s", "{mode}");
        assert_eq!(run["unobserved"], 0, "{mode}");
        assert!(run["log"]["error"].as_str().is_some_and(|error| error.contains("No space left")), "{mode}: {run}");
        check_log_is_readable(&outcome.out);
        if mode == "lockstep" {
            assert_eq!(outcome.state_hash(), fly_with("inprocess", 3.0, "").state_hash());
        }
    }
}

/// A page is made from what there is of the log.
fn check_log_is_readable(out: &std::path::Path) {
    let log = flight::log::read(&out.join("flight.mcap")).expect("the good part can be read");
    assert!(log.states.len() > 40, "{} states", log.states.len());
}

#[test]
fn a_disk_that_fills_up_costs_no_tick() {
    let mounted = tempfile::tempdir().expect("a temporary folder");
    let tmpfs = ["-t", "tmpfs", "-o", "size=400k", "trefoil-test"];
    let mount = Command::new("mount").args(tmpfs).arg(mounted.path()).output();
    if !mount.is_ok_and(|mount| mount.status.success()) {
        return skip("needs root, to mount a small disk");
    }
    let out = mounted.path().join("run");
    let arguments = ["fly", "--mode", "lockstep", "--json", "--set", "run.duration_s=20.0", "--namespace"];
    let flown = launcher().args(arguments).arg(namespace()).arg("--out").arg(&out).output();
    let flown = flown.expect("the launcher starts");
    let log = std::panic::catch_unwind(|| check_log_is_readable(&out));
    let unmounted = Command::new("umount").arg(mounted.path()).status().expect("umount runs");
    assert!(unmounted.success());
    assert_eq!(flown.status.code(), Some(3), "{}", String::from_utf8_lossy(&flown.stderr));
    let run: Value = serde_json::from_slice(&flown.stdout).expect("run.json goes to stdout");
    assert_eq!(run["ended"], "flown to the end, 20.00 s");
    let undisturbed = fly(&["--mode", "inprocess", "--no-log", "--set", "run.duration_s=20.0"]).state_hash();
    assert_eq!(run["state_hash"], undisturbed.as_str());
    log.expect("the log is readable");
}
