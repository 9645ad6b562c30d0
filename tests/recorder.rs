//! Recorders that are swapped, die or stand still: the flight goes on, and its log is whole where somebody recorded.

use launcher::log;

use crate::harness::{Flight, launcher, namespace, shared_memory_of, wait_until};
use crate::processes::{events, kill, process_of, processes_of};

#[test]
fn programs_that_do_not_record_are_rejected_and_nothing_is_missing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let script = folder.path().join("never-ready");
    std::fs::write(&script, "#!/bin/sh\nexec sleep 100\n").expect("a script can be written");
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o700);
    std::fs::set_permissions(&script, mode).expect("it can be made a program");
    let never_ready = script.to_str().expect("its path is text");
    // The last is our own program, then one that is still waited for when the flight ends, or was killed.
    let programs = ["/bin/false", "/bin/true", "/dev/null", "", never_ready];
    let swap = |(i, program): (usize, &&str)| {
        let exec = if program.is_empty() { String::new() } else { format!(", exec={program:?}") };
        format!("{{at_s={}, node=\"recorder\", shadow_s=0.0, watch_s=0.0{exec}}}", i + 1)
    };
    let swaps = format!("swap=[{}]", programs.iter().enumerate().map(swap).collect::<Vec<_>>().join(", "));
    let ns = namespace();
    let outcome = Flight::start(&ns, &["--mode", "lockstep", "--set", "run.duration_s=40.0", "--set", &swaps]).finish();

    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.run();
    let endings: Vec<String> =
        events(&run, "recorder").into_iter().filter(|what| !["started", "died", "hung"].contains(&&**what)).collect();
    assert!(endings.join(" ").starts_with("rejected rejected rejected took-over"), "{}", run["events"]);
    assert_eq!(run["log"]["dropped"], 0);
    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert!(log.complete());
    assert!(log.states.iter().map(|state| state.stamp.tick).eq(0..=4000));
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
    assert_eq!(processes_of(&ns), Vec::<i32>::new());
}

#[test]
fn a_recorder_that_stands_still_holds_up_no_lockstep_flight() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "lockstep"]);
    let log = flight.out.join("flight.mcap");
    wait_until("something is recorded", || log.metadata().is_ok_and(|log| log.len() > 65_536));
    kill("-STOP", &[process_of(&ns, "recorder")]);
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.run();
    assert_eq!(events(&run, "recorder"), ["hung", "died", "started", "took-over"]);
    assert!(run["log"]["dropped"].as_u64() > Some(0), "{}", run["log"]);
    assert!(log::read(&outcome.out.join("flight.mcap")).expect("the log reads").complete());
}

#[test]
fn where_nobody_records_nobody_takes_over() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--mode", "realtime", "--no-log"]);
    wait_until("the swap is refused", || {
        let swap = launcher().args(["swap", "recorder", "--namespace", &ns]).output().expect("swap runs");
        swap.status.code() == Some(2) && String::from_utf8_lossy(&swap.stderr).contains("nobody records this flight")
    });
    kill("-INT", &[flight.child.id() as i32]);
    assert_eq!(flight.finish().code(), Some(130));
}
