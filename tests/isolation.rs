//! Foreign processes cannot join a run, and damage to the files of a run is reported.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

use contract::message::{Actuators, Controls, Message, Reference, Stamp, State, Truth};
use runtime::domain::Domain;
use runtime::port::{Bus, NODE_DEPTH};
use runtime::realtime::ControlPage;
use rustix::process::Signal;
use serde_json::Value;

use crate::control::status;
use crate::harness::{
    Flight, NOBODY, PATIENT, fly, has_root, land, launcher, namespace, shared_memory_of, skip, wait_until,
};
use crate::processes::{processes_named, processes_of, start_flying};

/// Returns the details of all events `what`.
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
    [mode, duration, set(PATIENT.to_owned()), set(format!("fault=[{faults}]"))].concat()
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

/// Sends a forged TRUTH for each of 100 ticks, with the vehicle far off its course.
fn forge_truths(namespace: &str) {
    let domain = Domain::find(namespace).expect("it flies");
    let page = ControlPage::open(&domain.file("page")).expect("a page");
    let port = Bus::attach(&domain).expect("the same user").sender::<Truth>().expect("a port");
    for tick in (page.plant_tick()..).take(100) {
        let mut forged = Truth { tick, sequence: tick + 1, ..Truth::default() };
        forged.actual.position_m = [100.0; 3];
        port.send(&forged.with_checksum()).expect("the launcher receives");
    }
}

/// Answers messages on the topic of `M` for 100 ticks with two forgeries each: newer, all zero, with a valid checksum;
/// one has the epoch of the message, the other the next epoch.
fn forge_on<M: Message>(namespace: &str) {
    let domain = Domain::find(namespace).expect("it flies");
    let page = ControlPage::open(&domain.file("page")).expect("a page");
    let bus = Bus::attach(&domain).expect("the same user");
    let port = bus.sender::<M>().expect("a port");
    let receiver = bus.receiver::<M>(NODE_DEPTH).expect("a port");
    let until = page.plant_tick() + 100;
    let forge = |message: &M, epoch: u64| {
        let (mut forged, stamp) = (M::default(), *message.stamp());
        *forged.stamp_mut() = Stamp { tick: stamp.tick + 1, sequence: stamp.sequence + 1, epoch, ..stamp };
        forged.with_checksum()
    };
    wait_until("the messages are answered", || {
        let mut answer = |message: &M, from| {
            if from != port.number() {
                let epoch = message.stamp().epoch;
                for epoch in [epoch, epoch + 1] {
                    let _ = port.send(&forge(message, epoch)); // a receiver may be full
                }
            }
        };
        while receiver.receive(&mut answer) == Ok(true) {}
        page.plant_tick() >= until
    });
}

#[test]
fn a_foreign_publisher_is_refused_and_changes_nothing() {
    let ns = namespace();
    let flight = start_flying(&ns);
    std::thread::scope(|scope| {
        scope.spawn(|| forge_on::<State>(&ns));
        scope.spawn(|| forge_on::<Reference>(&ns));
        scope.spawn(|| forge_on::<Controls>(&ns));
        scope.spawn(|| forge_on::<Actuators>(&ns));
        scope.spawn(|| forge_truths(&ns));
    });
    let run = land(flight);
    for listener in ["guidance", "attitude-mpc", "mixer", "plant"] {
        assert!(refused(&run, listener, "publisher") > 0, "a stolen epoch: {}", run["refused"]);
        assert!(refused(&run, listener, "epoch") > 0, "an epoch made up: {}", run["refused"]);
    }
    let error_m = run["metrics"]["max_position_error_m"].as_f64();
    assert!(
        error_m.is_some_and(|error_m| error_m < 0.5),
        "its commands stop the motors, and its TRUTH is far off: {error_m:?}"
    );
}

#[test]
fn a_process_with_another_layout_is_refused() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let bus = Bus::attach(&Domain::find(&ns).expect("it flies")).expect("the same user");
    assert!(bus.open_as_another_version::<State>().is_err() && bus.open_as_another_version::<Actuators>().is_err());
    land(flight);
}

/// Removes the segments of `node` from shared memory.
fn remove_segments_of(namespace: &str, node: &str) {
    let of_it = processes_named(namespace, node);
    for path in shared_memory_of(namespace) {
        let name = PathBuf::from(&path).file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if runtime::port::makers(&name).next().is_some_and(|maker| of_it.contains(&(maker as i32))) {
            let _ = fs::remove_file(path); // a port that closed may have removed it
        }
    }
}

#[test]
fn segments_that_are_removed_are_named_and_the_flight_goes_on() {
    let ns = namespace();
    let flight = start_flying(&ns);
    remove_segments_of(&ns, "mixer");
    wait_until("it is seen", || status(&ns).to_string().contains("shm-removed"));
    let run = land(flight);
    let files = incidents(&run, "shm-removed");
    let of_the_run = format!("/{ns}/");
    assert!(!files.is_empty() && files.iter().all(|file| file.contains(&of_the_run)), "{files:?}");
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn a_node_that_cannot_map_a_segment_is_lost_by_name() {
    let ns = namespace();
    let flight = start_flying(&ns);
    remove_segments_of(&ns, "plant");
    for pid in processes_named(&ns, "guidance") {
        let _ = rustix::process::kill_process(rustix::process::Pid::from_raw(pid).expect("a process"), Signal::KILL);
    }
    let outcome = flight.finish();
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

/// Checks that the log can be read and has more than 40 states.
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
