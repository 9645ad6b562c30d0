//! The promise of exit code 0: the flight was seen whole, stayed inside its bounds, and run.json tells of every
//! interference, even if another process of the same user writes into the shared files of the run.

use std::fs::{self, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use runtime::domain::Domain;
use runtime::realtime::ControlPage;
use rustix::process::{Pid, Resource, Rlimit, getrlimit, prlimit};
use serde_json::Value;

use crate::control::status;
use crate::harness::{Flight, Outcome, PATIENT, fly, land, namespace, shared_memory_of, wait_until};
use crate::processes::{kill, process_of, processes_named, start_flying};

/// Number of flights whose files are written to.
const FLIGHTS: u64 = 48;

/// Lists every regular, non-empty file of the run in shared memory.
fn files_of(ns: &str) -> Vec<PathBuf> {
    fn walk(path: &Path, found: &mut Vec<PathBuf>) {
        match fs::read_dir(path) {
            Ok(entries) => entries.flatten().for_each(|entry| walk(&entry.path(), found)),
            Err(_) if fs::metadata(path).is_ok_and(|m| m.is_file() && m.len() > 0) => found.push(path.into()),
            Err(_) => {}
        }
    }
    let mut found = vec![];
    for name in shared_memory_of(ns) {
        walk(&Path::new("/dev/shm").join(name), &mut found);
    }
    found.sort();
    found
}

/// Returns the newest tick of the stack in `ns`; 0 before it flies.
fn plant_tick(ns: &str) -> u64 {
    let page = Domain::find(ns).ok().and_then(|domain| ControlPage::open(&domain.file("page")).ok());
    page.map_or(0, |page| page.plant_tick())
}

/// Draws the next random number: `SplitMix64`.
fn draw(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Writes random words into a file of the run; returns a description.
fn scribble(ns: &str, seed: u64) -> Option<String> {
    let mut random = seed;
    let files = files_of(ns);
    if files.is_empty() {
        return None;
    }
    // Every second write hits the control page, which is one file of many.
    let page = files.iter().find(|path| path.file_name().is_some_and(|name| name == "page"));
    let path = if seed.is_multiple_of(2) { page? } else { files.get(draw(&mut random) as usize % files.len())? };
    let words = fs::metadata(path).ok()?.len() / 8;
    let (count, of) = match seed % 3 {
        0 => (1, words.min(1)),              // the first word
        1 => (1, words.max(1)),              // any word
        _ => (words / 64 + 1, words.max(1)), // many words
    };
    let file = OpenOptions::new().write(true).open(path).ok()?;
    for _ in 0..count {
        let value = [0, u64::MAX, 1, draw(&mut random)][draw(&mut random) as usize % 4];
        let _ = file.write_at(&value.to_ne_bytes(), draw(&mut random) % of.max(1) * 8);
    }
    Some(format!("{count} words of {}", path.display()))
}

/// Describes how a flight contradicts its exit code; `None` if it does not.
fn broken_promise(outcome: &Outcome, duration_s: f64) -> Option<String> {
    match outcome.code() {
        Some(0) => {
            let run = outcome.run();
            let seen = run["flown_s"].as_f64() >= Some(duration_s) && run["unobserved"] == 0;
            let count = |value: &Value| value.as_u64().unwrap_or(0);
            let logged = count(&run["log"]["records"]) + count(&run["log"]["dropped"]);
            let nodes = run["timing"]["nodes"].as_object().into_iter().flatten();
            let slept: u64 = nodes.map(|(_, node)| count(&node["slips"])).sum();
            let inside =
                run["bounds"].as_array().is_some_and(|all| !all.is_empty() && all.iter().all(|b| b["ok"] == true));
            let whole = (logged + slept) as f64 >= 4.0 * duration_s * 100.0;
            (!(seen && inside && whole))
                .then(|| format!("exit 0, but {}: {} {}", run["ended"], run["reservations"], run["log"]))
        }
        Some(1) => {
            outcome.run()["reservations"].as_array().is_none_or(Vec::is_empty).then(|| "exit 1 without a reason".into())
        }
        Some(3) => {
            let told = ["error", "lost"].iter().any(|word| outcome.stderr.contains(word));
            (!told).then(|| format!("exit 3 without a reason: {}", outcome.stderr))
        }
        other => Some(format!("exit {other:?}: {}", outcome.stderr)),
    }
}

#[test]
fn no_lost_vehicle_exits_0_whatever_is_written_into_shared_files() {
    const DURATION_S: f64 = 1.5;
    let (next, written) = (AtomicU64::new(0), AtomicU64::new(0));
    let broken = std::sync::Mutex::new(vec![]);
    std::thread::scope(|scope| {
        for _ in 0..6 {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= FLIGHTS {
                        return;
                    }
                    let ns = namespace();
                    let set = format!("run.duration_s={DURATION_S:?}");
                    let mut flight = Flight::start(&ns, &["--mode", "realtime", "--set", &set]);
                    wait_until("the stack flies or has ended", || {
                        plant_tick(&ns) > 20 || matches!(flight.child.try_wait(), Ok(Some(_)))
                    });
                    let what = scribble(&ns, seed);
                    written.fetch_add(u64::from(what.is_some()), Ordering::Relaxed);
                    let what = what.unwrap_or_else(|| "nothing: it was not there yet, or no more".into());
                    if let Some(why) = broken_promise(&flight.finish(), DURATION_S) {
                        broken.lock().expect("no test panics there").push(format!("seed {seed}, {what}: {why}"));
                    }
                }
            });
        }
    });
    let broken = broken.into_inner().expect("no test panics there");
    assert!(broken.is_empty(), "{broken:#?}");
    assert!(written.into_inner() >= FLIGHTS / 2, "few flights were there to write into");
}

#[test]
fn every_fault_that_took_effect_stands_in_run_json() {
    let fault = |at_s: f64, what: &str| format!("{{at_s={at_s:?},for_s=0.1,{what}}}");
    let faults = [
        fault(0.5, "target=\"mixer\",kind=\"kill\""),
        fault(0.9, "target=\"controls\",kind=\"drop\",probability=1"),
        fault(1.2, "target=\"rates\",kind=\"stuck\""),
    ];
    for mode in ["inprocess", "lockstep", "realtime"] {
        let set = format!("fault=[{}]", faults.join(","));
        // In real time the mixer is away for as long as the machine needs to start the next one.
        let bound = if mode == "realtime" { "bounds.max_position_error_m=inf" } else { PATIENT };
        let settings = ["run.duration_s=2.0", &set, bound, PATIENT];
        let set = settings.map(|setting| ["--set", setting]).concat();
        let outcome = fly(&[&["--mode", mode], &set[..]].concat());
        assert_eq!(outcome.code(), Some(0), "{mode}: {}", outcome.stderr);
        let run = outcome.run();
        let injected = run["faults"].as_array().expect("faults").iter();
        let injected: Vec<_> =
            injected.map(|fault| (fault["target"].clone(), fault["injected_at_s"].as_f64())).collect();
        let expected = [("mixer", 0.5), ("controls", 0.9), ("rates", 1.2)].map(|(who, at_s)| (who.into(), Some(at_s)));
        assert_eq!(injected, expected, "{mode}");
        let log = flight::log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
        let logged = log.tick_by_tick().count() + log.events.len();
        assert_eq!(run["log"]["records"].as_u64(), Some(logged as u64), "{mode}: {}", run["log"]);
        assert_eq!(run["log"]["dropped"], 0, "{mode}: {}", run["log"]);
    }
}

fn but(run: &Value) -> String {
    run["reservations"].to_string()
}

#[test]
fn a_flight_outside_its_position_bound_exits_1() {
    // The mixer is away for so long that the vehicle falls; then the vehicle comes back to its path.
    let fault = "fault=[{at_s=2,target=\"mixer\",kind=\"kill\",for_s=2}]";
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=20.0", "--set", fault]);
    assert_eq!(outcome.code(), Some(1), "{}", outcome.stderr);
    assert!(but(&outcome.run()).contains("position error"), "{}", but(&outcome.run()));
}

#[test]
fn a_flight_with_the_mixer_on_its_fallback_for_too_long_exits_1() {
    let hover = "mission.trajectory=\"hover\"";
    let fault = |for_s: f64| format!("fault=[{{at_s=1,target=\"attitude-mpc\",kind=\"kill\",for_s={for_s:?}}}]");
    for (for_s, code) in [(1.0, 0), (2.5, 1)] {
        let outcome =
            fly(&["--mode", "inprocess", "--set", "run.duration_s=6.0", "--set", hover, "--set", &fault(for_s)]);
        assert_eq!(outcome.code(), Some(code), "{for_s} s: {}", but(&outcome.run()));
        assert!(but(&outcome.run()).contains("mixer on its fallback"), "{}", but(&outcome.run()));
    }
}

#[test]
fn a_node_that_can_open_no_more_files_is_replaced_when_it_receives_nothing() {
    let ns = namespace();
    let flight = start_flying(&ns);
    let mixer = process_of(&ns, "mixer");
    let limit = Rlimit { current: Some(3), ..getrlimit(Resource::Nofile) };
    prlimit(Pid::from_raw(mixer), Resource::Nofile, limit).expect("it is ours");
    kill("-KILL", &[process_of(&ns, "attitude-mpc")]);
    let deaf = |event: &Value| {
        event["node"] == "mixer" && event["what"] == "hung" && event["why"] == "it hears nothing of attitude-mpc"
    };
    wait_until("the mixer is replaced", || {
        let view = status(&ns);
        let replaced = view["events"].as_array().into_iter().flatten().skip_while(|event| !deaf(event));
        replaced.filter(|event| event["node"] == "mixer").any(|event| event["what"] == "took-over")
    });
    let run = land(flight);
    assert!(run["events"].as_array().expect("events").iter().any(deaf), "{}", run["events"]);
    assert!(run["metrics"]["max_position_error_m"].as_f64() < Some(0.5), "{}", but(&run));
}

#[test]
fn a_plant_that_hangs_before_its_second_sample_is_noticed() {
    for mode in ["realtime", "lockstep"] {
        let ns = namespace();
        let flight = Flight::start(&ns, &["--mode", mode, "--set", "run.duration_s=3600.0"]);
        // The plant is stopped as soon as it runs: before its first sample, or after it.
        wait_until("the plant is there", || !processes_named(&ns, "plant").is_empty());
        kill("-STOP", &processes_named(&ns, "plant"));
        let outcome = flight.finish();
        assert_eq!(outcome.code(), Some(3), "{mode}: {}", outcome.stderr);
        assert!(outcome.stderr.contains("plant"), "{mode}: {}", outcome.stderr);
        assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    }
}
