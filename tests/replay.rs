//! Replay of a recorded flight from its folder.

use std::path::Path;
use std::process::Output;

use contract::message::Message;
use flight::log::{self, LogWriter, Record};
use settings::Scenario;

use crate::control::{fly_on, status, tell};
use crate::harness::{Flight, PATIENT, fly, launcher, namespace, wait_until, write_script};

pub fn of_run(arguments: &[&str], run: &Path) -> Output {
    let (verb, more) = arguments.split_first().expect("a command");
    launcher().arg(verb).arg(run).args(more).output().expect("the launcher starts")
}

pub fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// Asserts that the flight at `run` repeats with the same hash.
fn assert_repeats(run: &Path) {
    let output = of_run(&["replay"], run);
    let said = text(&output);
    assert!(output.status.success() && said.contains("the same bits: state hash"), "{said}");
}

const KILLED_AND_SWAPPED: [&str; 5] = [
    "--set=fault=[{ at_s = 0.5, target = \"attitude-mpc\", kind = \"kill\" }, { at_s = 2.6, for_s = 0.2, target = \
     \"controls\", kind = \"drop\" }, { at_s = 3.0, for_s = 0.2, target = \"guidance\", kind = \"stop\" }]",
    "--set=swap=[{ at_s = 1.0, node = \"mixer\", standby_s = 0.5, watch_s = 0.5, may_fail = true }]",
    "--set=run.duration_s=3.5",
    "--set",
    PATIENT,
];

#[test]
fn a_flight_with_deaths_swaps_and_losses_repeats_from_its_folder() {
    for mode in ["realtime", "lockstep"] {
        let outcome = fly(&[&["--mode", mode], &KILLED_AND_SWAPPED[..]].concat());
        assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
        assert_repeats(&outcome.out);
    }
}

#[test]
fn a_torn_log_is_flown_again_as_far_as_it_reads() {
    let flown = fly(&["--mode", "inprocess", "--set", "run.duration_s=4.0"]);
    let file = flown.out.join("flight.mcap");
    let whole = std::fs::read(&file).expect("a log");
    std::fs::write(&file, &whole[..whole.len() / 2]).expect("a shorter log");
    let log = log::read(&file).expect("the scenario and what follows");
    let states = log.states.len();
    assert!((100..300).contains(&states), "{states} of 401");
    let sent = states + log.truths.len();
    let output = of_run(&["replay"], &flown.out);
    let said = text(&output);
    assert!(output.status.code() == Some(1) && said.contains("is not whole"), "{said}");
    assert!(
        said.contains("no difference in what was compared") && said.contains(&format!("plant {sent} of")),
        "{said}"
    );
}

#[test]
fn a_flight_that_was_given_faults_in_flight_repeats_from_its_folder() {
    let name = namespace();
    let flight = Flight::start(&name, &["--set", PATIENT]);
    wait_until("the stack flies", || status(&name)["time_s"].as_f64() > Some(0.2));
    for order in [["rates", "noise"], ["controls", "drop"], ["rotor1", "slow"], ["attitude-mpc", "kill"]] {
        tell(&name, &[&["inject"], &order[..]].concat()).expect("injected");
    }
    tell(&name, &["clear"]).expect("cleared");
    fly_on(&name, 0.5);
    tell(&name, &["stop"]).expect("stopped");
    assert_repeats(&flight.finish().out);
}

#[test]
fn what_deadlines_withheld_repeats_too() {
    let late = "--set=fault=[{ at_s = 0.5, for_s = 0.2, target = \"attitude-mpc\", kind = \"slow\", ms = 4.0 }]";
    for policy in ["skip", "hold", "degrade", "send"] {
        let due = format!("node.attitude-mpc={{ deadline_ms = 3.0, late = '{policy}' }}");
        let outcome = fly(&["--set", "run.duration_s=1.0", late, "--set", &due, "--set", PATIENT]);
        assert!(outcome.code().is_some_and(|code| code <= 1), "{policy}: {}", outcome.stderr);
        assert_repeats(&outcome.out);
    }
}

#[test]
fn other_settings_show_what_another_controller_would_have_done() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=3.0"]);
    let ask = |more: &[&str]| text(&of_run(&[&["replay", "--node", "attitude-mpc"], more].concat(), &outcome.out));
    let alone = ask(&[]);
    assert!(alone.contains("no difference in what was compared\ncompared: 301 of 1505 messages"), "{alone}");
    assert!(alone.contains("not computed: plant (not asked for), guidance (not asked for), mixer"), "{alone}");
    let open = ask(&["--set", "attitude.law=lqr"]);
    assert!(open.contains("other answers from tick") && open.contains("attitude-mpc 1, demand["), "{open}");
    let closed = ask(&["--set", "attitude.law=lqr", "--closed"]);
    assert!(closed.contains("with these settings") && closed.contains("position error, maximum [m]"), "{closed}");
    let wrong = of_run(&["replay", "--node", "attitude-mpc", "--set", "guidance.kp=1"], &outcome.out);
    assert_eq!(wrong.status.code(), Some(2), "{}", text(&wrong));
}

#[test]
fn another_program_may_answer_in_the_place_of_a_node() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=3.0"]);
    let program = outcome.out.join("own");
    let text_of_it = format!("#!/bin/sh\nexec {} node attitude-mpc \"$@\"\n", env!("CARGO_BIN_EXE_trefoil"));
    write_script(&program, &text_of_it);
    let program = program.to_str().expect("a path");
    let ask = |more: &[&str]| of_run(&[&["replay", "--node", "attitude-mpc", "--exec"], more].concat(), &outcome.out);
    let same = text(&ask(&[program]));
    assert!(same.contains("attitude-mpc 301 of 301") && same.contains("the same answers, bit for bit"), "{same}");
    let closed = text(&ask(&[program, "--closed"]));
    assert!(closed.contains("compared: 1505 of 1505 messages") && closed.contains("with these settings"), "{closed}");
    let gone = ask(&["/bin/true"]);
    assert!(gone.status.code() == Some(2) && text(&gone).contains("has ended instead of answering"), "{}", text(&gone));
}

#[test]
fn a_torn_log_repeats_up_to_where_it_is_torn() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=10.0"]);
    let log = outcome.out.join("flight.mcap");
    let bytes = std::fs::read(&log).expect("a log");
    std::fs::write(&log, &bytes[..bytes.len() / 2]).expect("a shorter log");
    let output = of_run(&["replay"], &outcome.out);
    let said = text(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("is not whole") && said.contains("no difference in what was compared, which is not all"),
        "{said}"
    );
}

/// Writes the log at `path` again with the records that are `kept`, closed as if it were whole.
fn rewrite(path: &Path, kept: impl Fn(&Record) -> bool) {
    let log = log::read(path).expect("the log reads");
    let memories = log::memories(path, u64::MAX).expect("the log reads");
    let mut writer = LogWriter::create(path, &log.scenario_toml, Scenario::default().sample_ns()).expect("a log");
    log.tick_by_tick().filter(kept).for_each(|record| writer.write(&record).expect("written"));
    log.events.iter().for_each(|event| writer.write_event(event).expect("written"));
    for memory in &memories {
        writer.write_memory(memory).expect("written");
    }
    writer.finish().expect("written");
}

/// Flight with noise, latency, jitter, losses, a delaying link while the memory is taken, and kills before and after.
const REMEMBERED: [&str; 7] = [
    "scenarios/typical-sensors.toml",
    "--set=fault=[{ at_s = 9.0, for_s = 2.0, target = \"controls\", kind = \"delay\", ms = 15.0 }, { at_s = 9.5, target = \
     \"guidance\", kind = \"kill\" }, { at_s = 11.0, target = \"mixer\", kind = \"kill\" }]",
    "--set=run.command_jitter_ms=3.0",
    "--set=run.command_drop_probability=0.05",
    "--set=run.duration_s=12.5",
    "--set",
    PATIENT,
];

#[test]
fn a_replay_begins_with_what_the_nodes_remembered_and_so_flies_what_comes_after_a_hole() {
    for mode in ["inprocess", "lockstep"] {
        let outcome = fly(&[&["--mode", mode], &REMEMBERED[..]].concat());
        assert_repeats(&outcome.out);
        let check = |more: &[&str], code: i32, parts: &[&str]| {
            let output = of_run(&[&["replay"], more].concat(), &outcome.out);
            let said = text(&output);
            assert_eq!(output.status.code(), Some(code), "{mode} {more:?}: {said}");
            for part in parts {
                assert!(said.contains(part), "{mode} {more:?} should say {part}: {said}");
            }
        };
        let begun = "begun with the snapshots at 10.00 s";
        check(&["--from", "10.2s"], 0, &["no difference in what was compared\n", "10.20 to 12.50 s of 12.50 s", begun]);
        check(&["--from", "11s", "--node", "mixer"], 0, &["no difference in what was compared\n", begun]);
        check(&["--from", "10s"], 0, &["10.00 to 12.50 s of 12.50 s"]); // the snapshots are not before 10 s
        let sets = ["--from", "11s", "--node", "attitude-mpc", "--set", "attitude.law=lqr", "--closed"];
        check(&sets, 0, &["other answers from tick 11", begun]);
        rewrite(&outcome.out.join("flight.mcap"), |record| !(300..310).contains(&record.tick()));
        check(
            &[],
            1,
            &["no difference in what was compared, which is not all that was asked for", "the log lacks messages 301"],
        );
        check(&["--from", "10.2s"], 0, &["no difference in what was compared\n", "10.20 to 12.50 s of 12.50 s", begun]);
        check(
            &["--from", "2s", "--to", "4s"],
            1,
            &["not all that was asked for", "50 messages before that are missing"],
        );
        check(&["--to", "2.9s"], 0, &["no difference in what was compared\n"]);
    }
}

#[test]
fn what_was_not_compared_is_not_the_same() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=2.0"]);
    let check = |more: &[&str], code: i32, part: &str| {
        let output = of_run(&[&["replay"], more].concat(), &outcome.out);
        let said = text(&output);
        assert!(output.status.code() == Some(code) && said.contains(part), "{more:?} should say {part}: {said}");
        assert_eq!(said.contains("the same bits"), code == 0 && more.is_empty(), "{more:?}: {said}");
    };
    check(&[], 0, "compared: 1005 of 1005 messages (plant 402 of 402, guidance 201 of 201, attitude-mpc 201 of 201");
    check(&["--from", "100s"], 1, "nothing was compared");
    check(&["--from", "1s"], 0, "1.00 to 2.00 s of 2.00 s");
    check(&["--to", "1s"], 0, "0.00 to 1.00 s of 2.00 s");

    let path = outcome.out.join("flight.mcap");
    let whole = std::fs::read(&path).expect("a log");
    let run = std::fs::read(outcome.out.join("run.json")).expect("run.json");
    // The last message of the mixer is missing, which no other message shows.
    rewrite(&path, |record| !matches!(record, Record::Actuators(_)) || record.tick() < 200);
    check(&[], 1, "it has 1004 records, and run.json tells of 1005");
    rewrite(&path, |record| record.tick() < 150);
    check(&[], 1, "what was read ends at 1.49 s of 2.00 s");
    check(&["--node", "attitude-mpc", "--set", "attitude.law=lqr"], 1, "other answers from");
    std::fs::write(&path, &whole).expect("written");
    std::fs::remove_file(outcome.out.join("run.json")).expect("removed");
    check(&[], 1, "there is no run.json");
    let hash = outcome_hash(&run);
    let other = String::from_utf8_lossy(&run).replace(&hash, &hash.replace(&hash[..4], "0000"));
    std::fs::write(outcome.out.join("run.json"), other).expect("written");
    check(&[], 1, "its states have another hash than run.json's");
}

fn outcome_hash(run: &[u8]) -> String {
    let run: serde_json::Value = serde_json::from_slice(run).expect("JSON");
    run["state_hash"].as_str().expect("a hash").to_owned()
}

#[test]
fn what_another_program_flew_is_told_and_not_the_same() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = folder.path().join("own");
    let text_of_it = format!("#!/bin/sh\nexec {} node attitude-mpc \"$@\"\n", env!("CARGO_BIN_EXE_trefoil"));
    write_script(&program, &text_of_it);
    let swap = format!(
        "swap=[{{ at_s = 0.2, node = \"attitude-mpc\", standby_s = 0.3, watch_s = 0.3, exec = \"{}\" }}]",
        program.display()
    );
    let outcome = fly(&["--mode", "lockstep", "--set", "run.duration_s=2.0", "--set", &swap]);
    let ask = |more: &[&str]| of_run(&[&["replay"], more].concat(), &outcome.out);
    let all = ask(&[]);
    let said = text(&all);
    assert!(all.status.code() == Some(0) && said.contains("no difference in what was compared\n"), "{said}");
    assert!(said.contains("not computed: attitude-mpc 2 (another program)"), "{said}");
    let none = ask(&["--node", "attitude-mpc", "--from", "1.5s"]);
    assert!(none.status.code() == Some(1) && text(&none).contains("nothing was compared"), "{}", text(&none));
}

#[test]
fn a_log_without_its_end_is_told_first_by_every_command() {
    let outcome = fly(&["--mode", "lockstep", "--set", "run.duration_s=2.0"]);
    let stray = outcome.out.join("flight.2.mcap");
    let path = outcome.out.join("flight.mcap");
    std::fs::copy(&path, &stray).expect("copied");
    rewrite(&stray, |_| true); // a log of its own, which only has the name of a part
    assert_repeats(&outcome.out);
    rewrite(&path, |record| record.tick() < 120);
    let run = outcome.out.display().to_string();
    for command in ["report", "explain", "compare"] {
        let other = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.5"]);
        let more = if command == "compare" { vec![other.out.to_str().expect("a path")] } else { vec![] };
        let output = of_run(&[&[command], &more[..]].concat(), &outcome.out);
        let said = text(&output);
        let note = format!("note: the log {run}/flight.mcap is not whole");
        let told = if command == "compare" { &output.stdout } else { &output.stderr };
        assert!(String::from_utf8_lossy(told).starts_with(&note), "{command}: {said}");
        assert!(said.contains("what was read ends at 1.19 s of 2.00 s"), "{command}: {said}");
        assert_eq!(output.status.code(), Some(i32::from(command == "explain")), "{command}: {said}");
    }
    let page = std::fs::read_to_string(outcome.out.join("report.html")).expect("a report");
    assert!(page.contains("The log is not whole: the log"), "above everything else");
    let page = std::fs::read_to_string(outcome.out.join("explain.html")).expect("a page");
    assert!(page.contains("is not whole (") && page.contains("what was read ends at 1.19 s of 2.00 s"), "{page}");
}

/// A stall costs the same in a part of a flight as in the whole; bit for bit if the cost does not depend on earlier
/// ticks.
#[test]
fn the_cost_of_a_stall_in_a_part_of_a_flight_is_that_in_the_whole() {
    let stall = "--set=fault=[{ at_s = 11.0, for_s = 0.05, target = \"mixer\", kind = \"stop\" }]";
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=12.5", stall]);
    let costs = |more: &[&str]| -> serde_json::Value {
        let output = of_run(&[&["explain", "--json"], more].concat(), &outcome.out);
        serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", text(&output)))
    };
    let (whole, part) = (costs(&[]), costs(&["--from", "10.5s", "--to", "12.5s"]));
    assert_eq!((&whole["disturbed_ticks"], part["another_flight"].is_null()), (&part["disturbed_ticks"], true));
    for figure in ["max_distance_m", "worst_tilt_deg"] {
        assert_eq!(whole["bursts"][0][figure], part["bursts"][0][figure], "{figure}");
    }
    assert!(whole["bursts"][0]["max_distance_m"].as_f64() > Some(0.0));
}

/// A mixer takes longer than a period: each of its commands arrives after the next sample.
#[test]
fn a_command_that_comes_after_the_period_disturbs_its_tick() {
    let slow = "--set=fault=[{ at_s = 1.0, for_s = 0.5, target = \"mixer\", kind = \"slow\", ms = 90.0 }]";
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=4.0", slow]);
    let output = of_run(&["explain", "--json"], &outcome.out);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("50 disturbed ticks: 51 flights of 4.00 s, about "), "the work is told first: {said}");
    let costs: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&costs["disturbed_ticks"], &costs["bursts"][0]["ticks"]), (&50.into(), &serde_json::json!([100, 149])));
    let apart_m = costs["all_together"]["max_distance_m"].as_f64().expect("a distance");
    assert!(apart_m > 1e-4, "the courses part, wherever the largest error is: {costs}");
    assert_eq!(costs["flight"]["state_hash"], outcome.state_hash());
    let errors_m = ["flight", "without_any"].map(|of| costs[of]["max_error_m"].as_f64().expect("an error"));
    assert_eq!(costs["all_together"]["max_error_m"], errors_m[0] - errors_m[1]);
}

#[test]
fn what_would_take_long_is_told_and_not_begun_unless_it_is_asked_for() {
    let slow = "--set=fault=[{ at_s = 1.0, for_s = 20.0, target = \"mixer\", kind = \"slow\", ms = 20.0 }]";
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=21.0", slow]);
    let output = of_run(&["explain", "--json"], &outcome.out);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("2000 disturbed ticks: 2001 flights of 21.00 s") && said.contains("--all"), "{said}");
    let costs: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&costs["disturbed_ticks"], &costs["ticks"]), (&2000.into(), &serde_json::json!([])));
    assert!(costs["all_together"]["max_distance_m"].as_f64() > Some(0.0), "{costs}");
}

/// The cost of a stall is the difference between the flight with and the flight without it.
#[test]
fn the_cost_of_a_stall_is_that_of_the_flights_with_and_without_it() {
    let stall = "--set=fault=[{ at_s = 5.0, for_s = 0.03, target = \"attitude-mpc\", kind = \"stop\" }]";
    let seconds = ["--mode", "lockstep", "--set", "run.duration_s=12.0", "--set", PATIENT];
    let (with, without) = (fly(&[&seconds[..], &[stall]].concat()), fly(&seconds));
    let known =
        ["position_error_integral_ms", "max_position_error_m"].map(|name| with.metric(name) - without.metric(name));
    let output = of_run(&["explain", "--json"], &with.out);
    let costs: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let burst = &costs["bursts"][0];
    assert_eq!((costs["bursts"].as_array().map(Vec::len), &burst["ticks"]), (Some(1), &serde_json::json!([500, 502])));
    let told = [&burst["error_integral_ms"], &burst["max_error_m"]].map(|cost| cost.as_f64().expect("a number"));
    assert_eq!(told, known);
    assert!(known[0].abs() > 0.0, "it cost something: {known:?}");
    assert!(with.out.join("explain.html").exists());
}

#[test]
fn the_hash_of_a_flight_in_real_time_is_shown_with_what_gives_it_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = folder.path().join("run");
    let fly = |more: &[&str]| {
        let settings = ["--set", "run.duration_s=1.0", "--set", PATIENT];
        let mut command = launcher();
        command.arg("fly").args(settings).args(more).args(["--namespace", &namespace(), "--out"]).arg(&run);
        text(&command.output().expect("the launcher starts"))
    };
    assert!(!fly(&["--no-log"]).contains("state hash"), "nothing gives it again");
    let said = fly(&[]).split_whitespace().collect::<Vec<_>>().join(" "); // long lines are broken
    let (_, after) = said.split_once("state hash ").expect("a hash");
    let (hash, told) = after.split_once(": ").expect("what gives it again");
    assert!(told.starts_with("`trefoil replay RUN` gives the same"), "{told}");
    assert!(text(&of_run(&["replay"], &run)).contains(&format!("the same bits: state hash {hash}")), "{hash}");
    let page = std::fs::read_to_string(run.join("report.html")).expect("a report");
    assert!(page.contains(hash) && page.contains("trefoil replay RUN"), "{hash}");
}

/// Fault by which no demand reaches the mixer for 0.05 s.
const LOST: &str = "{ at_s = 0.3, for_s = 0.05, target = \"controls\", kind = \"drop\", probability = 1.0 }";

#[test]
fn the_report_has_the_costs_of_a_few_ticks_and_says_how_to_learn_those_of_many() {
    let page = |fault: &str| {
        let outcome =
            fly(&["--mode", "inprocess", "--set", "run.duration_s=4.0", "--set", &format!("fault=[{fault}]")]);
        std::fs::read_to_string(outcome.out.join("report.html")).expect("a report")
    };
    let lost = |for_s: f64| page(&LOST.replace("0.05", &for_s.to_string()));
    assert!(!page("").contains("#costs"), "no tick is disturbed");
    let few = lost(0.05);
    assert!(few.contains("href=\"#costs\"") && few.contains("Bursts, the costliest first"), "the costs");
    let many = lost(0.8);
    assert!(many.contains("<code>trefoil explain RUN</code>") && !many.contains("Bursts, the costliest"), "too many");
}

#[test]
fn a_difference_may_be_that_of_the_program_which_flew() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=1.0", "--set", &format!("fault=[{LOST}]")]);
    let path = outcome.out.join("flight.mcap");
    let mut log = log::read(&path).expect("the log reads");
    log.controls[57].demand[2] += 1.0;
    log.controls[57] = log.controls[57].with_checksum();
    // The program of this test writes the log, and knows of no commit.
    let mut writer = LogWriter::create(&path, &log.scenario_toml, Scenario::default().sample_ns()).expect("a log");
    log.tick_by_tick().for_each(|record| writer.write(&record).expect("written"));
    writer.finish().expect("written");
    let output = of_run(&["replay"], &outcome.out);
    let said = text(&output);
    let version = "version 0.1.0";
    let other = format!("the log was written by {version} of an unknown commit, and this is {version}");
    assert!(said.contains(&other) && said.contains("a difference may be the program's"), "{said}");
    assert!(said.find(&other) < said.find("DIFFERENT from tick 57"), "{said}");
    assert_eq!(output.status.code(), Some(1));

    let output = of_run(&["report"], &outcome.out);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let page = std::fs::read_to_string(outcome.out.join("report.html")).expect("a report");
    assert!(page.contains("the flight cannot be flown again: the flight does not repeat"), "why there are no costs");
}

#[test]
fn a_log_of_another_layout_is_refused_with_both_versions_and_what_to_do() {
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.5"]);
    let path = outcome.out.join("flight.mcap");
    let mut bytes = std::fs::read(&path).expect("a log");
    let (ours, theirs) = (contract::message::LAYOUT[0], "trefoil.State.v0");
    let at = bytes.windows(ours.len()).position(|word| word == ours.as_bytes()).expect("the log tells its layout");
    bytes[at..at + theirs.len()].copy_from_slice(theirs.as_bytes());
    std::fs::write(&path, bytes).expect("written");
    let run = outcome.out.display().to_string();
    for command in ["report", "replay", "explain", "compare"] {
        let more = if command == "compare" { vec![run.as_str()] } else { vec![] };
        let output = of_run(&[&[command], &more[..]].concat(), &outcome.out);
        let said = text(&output);
        assert_eq!(output.status.code(), Some(2), "{command}: {said}");
        for part in [ours, theirs, "version 0.1.0", "Read it with the program of that version"] {
            assert!(said.contains(part), "{command} should say {part}: {said}");
        }
    }
}
