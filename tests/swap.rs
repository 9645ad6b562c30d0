//! Hot swap: a good candidate is kept, a bad one rejected, and the flight is undisturbed.

use serde_json::{Value, json};

use crate::harness::{Outcome, fly};

const HOVER: &str = "scenarios/faults/hover-gusts.toml";
/// Each node with the topic of its output.
const NODES: [(&str, &str); 3] = [("guidance", "reference"), ("attitude-mpc", "controls"), ("mixer", "actuators")];
/// Time on standby, and watched, of the swaps in lockstep \[s\].
const STANDBY_S: f64 = 0.2;
const WATCH_S: f64 = 0.3;

/// Writes a swap that may fail as a setting, with `more` keys.
fn swap(at_s: f64, node: &str, more: &str) -> String {
    format!("{{at_s={at_s}, node=\"{node}\", standby_s={STANDBY_S}, watch_s={WATCH_S}, may_fail=true{more}}}")
}

/// Writes the fault that makes a candidate wrong in this `way` from `at_s` on.
fn wrong(way: &str, at_s: f64, node: &str, topic: &str) -> String {
    let fault = match way {
        "nan" => format!("target=\"{topic}\", kind=\"garbage\""),
        "silent" => format!("target=\"{topic}\", kind=\"drop\", probability=1.0"),
        "sign" => format!("target=\"{topic}\", kind=\"wrong\""),
        "slow" => format!("target=\"{node}\", kind=\"slow\", ms=30"),
        _ => format!("target=\"{node}\", kind=\"exit\""),
    };
    format!("fault=[{{at_s={at_s}, {fault}}}]")
}

/// Flies the hover with these swaps.
fn flown(swaps: &[String], mode: &str) -> Outcome {
    faulty("", swaps, mode)
}

/// Flies the hover with swaps and a fault.
fn faulty(fault: &str, swaps: &[String], mode: &str) -> Outcome {
    let (fault, swaps) = (format!("fault=[{fault}]"), format!("swap=[{}]", swaps.join(", ")));
    let settings = ["--set", "run.duration_s=7.0", "--set", &fault, "--set", &swaps];
    fly(&[&[HOVER, "--mode", mode, "--no-log"], &settings[..]].concat())
}

/// Flies swaps in process and in lockstep, which must be the same flight; returns run.json.
fn check_same(swaps: &[String]) -> Value {
    check_same_faulty("", swaps)
}

/// Flies swaps and a fault in process and in lockstep, which must be the same flight; returns run.json.
fn check_same_faulty(fault: &str, swaps: &[String]) -> Value {
    let [inprocess, lockstep] = ["inprocess", "lockstep"].map(|mode| faulty(fault, swaps, mode));
    for outcome in [&inprocess, &lockstep] {
        assert_eq!(outcome.code(), Some(0), "{swaps:?}: {}", outcome.stderr);
    }
    assert_eq!(inprocess.run()["events"], lockstep.run()["events"], "{swaps:?}");
    assert_eq!(inprocess.state_hash(), lockstep.state_hash(), "{swaps:?}");
    assert_eq!(inprocess.run()["refused"], lockstep.run()["refused"], "{swaps:?}");
    lockstep.run()
}

/// Returns the outcome of each candidate of `node`, in order.
pub fn endings(run: &Value, node: &str) -> Vec<String> {
    let of_node = run["events"].as_array().expect("events").iter().filter(|event| event["node"] == node);
    let what = of_node.map(|event| event["what"].as_str().expect("a word").to_owned());
    what.filter(|what| ["kept", "rejected", "returned", "given-up"].contains(&what.as_str())).collect()
}

#[test]
fn a_candidate_like_the_old_one_is_kept_and_the_flight_is_the_same() {
    let swaps = NODES.map(|(node, _)| swap(1.0, node, ""));
    let run = check_same(&swaps);
    for (node, _) in NODES {
        assert_eq!(endings(&run, node), ["kept"]);
    }
    assert_eq!(run["state_hash"], flown(&[], "lockstep").run()["state_hash"]);
}

/// Swaps the laws in an order in which each law follows every other law once: by steps of 1, then of 2...
#[test]
fn every_law_takes_over_from_every_other_in_flight() {
    let laws = ["mpc", "lqr", "pid", "geometric", "indi"];
    let steps = (1..laws.len()).flat_map(|step| vec![step; laws.len()]);
    let order: Vec<usize> = steps
        .scan(0, |law, step| {
            *law = (*law + step) % laws.len();
            Some(*law)
        })
        .collect();
    let swaps = order.iter().zip(1_u32..).map(|(law, number)| {
        let (at_s, law) = (0.32 * f64::from(number), laws[*law]);
        let times = format!("at_s={at_s}, standby_s=0.1, watch_s=0.2, may_fail=true");
        format!("{{node=\"attitude-mpc\", {times}, set=['attitude.law=\"{law}\"']}}")
    });
    let run = check_same(&swaps.collect::<Vec<_>>());
    assert_eq!(endings(&run, "attitude-mpc"), vec!["kept"; order.len()], "{order:?}");
    assert_ne!(run["state_hash"], flown(&[], "inprocess").run()["state_hash"]);
}

/// Lists a swap of every node for every way to be wrong. A candidate is wrong from `after_s` after its swap begins.
fn wrong_candidates(after_s: f64, difference: f64) -> Vec<String> {
    let ways = ["nan", "silent", "sign", "slow", "exit"];
    let at = |way: usize, node: usize| 1.0 + way as f64 + 0.3 * node as f64;
    let one = |(i, way)| {
        let of_node = move |(j, (node, topic)): (usize, (&str, &str))| {
            let at_s = at(i, j);
            let wrong = wrong(way, at_s + after_s, node, topic);
            swap(at_s, node, &format!(", set=['{wrong}'], bounds={{difference={difference}}}"))
        };
        NODES.into_iter().enumerate().map(of_node).collect::<Vec<_>>()
    };
    ways.into_iter().enumerate().flat_map(one).collect()
}

#[test]
fn a_candidate_that_is_wrong_on_standby_is_rejected_and_the_flight_is_the_same() {
    let run = check_same(&wrong_candidates(0.05, 0.01));
    for (node, _) in NODES {
        assert_eq!(endings(&run, node), ["rejected"; 5], "{}", run["events"]);
    }
    assert_eq!(run["state_hash"], flown(&[], "inprocess").run()["state_hash"]);
}

#[test]
fn a_candidate_that_is_wrong_when_active_is_returned() {
    let run = check_same(&wrong_candidates(STANDBY_S + 0.05, 0.25));
    for (node, _) in NODES {
        assert_eq!(endings(&run, node), ["returned"; 5], "{}", run["events"]);
    }
}

/// Reduces run.json to what follows from the messages, without the wall clock.
fn accounts(run: &Value) -> Value {
    let mut solver = run["solver"].clone();
    solver["solve_us"] = Value::Null;
    json!([run["state_hash"], run["metrics"], solver, run["refused"], run["faults"]])
}

#[test]
fn a_fault_of_a_topic_is_counted_once_while_a_candidate_is_on_standby() {
    for kind in ["drop", "garbage", "duplicate"] {
        let fault = format!("{{at_s=0.9, for_s=1.0, target=\"controls\", kind=\"{kind}\", probability=0.3}}");
        let run = check_same_faulty(&fault, &[swap(1.0, "attitude-mpc", ", bounds={ticks=50}")]);
        assert_eq!(endings(&run, "attitude-mpc"), ["kept"], "{kind}");
        assert_eq!(accounts(&run), accounts(&faulty(&fault, &[], "inprocess").run()), "{kind}");
        let cycles = |node: &str| run["timing"]["nodes"][node]["response"]["n"].clone();
        assert!(NODES.into_iter().all(|(node, _)| cycles(node) == cycles("plant")), "{kind}: {}", run["timing"]);
    }
}

#[test]
fn a_candidate_takes_the_last_message_of_a_process_that_is_gone() {
    let killed = "{at_s=1.0, for_s=0.2, target=\"attitude-mpc\", kind=\"kill\"}";
    let run = check_same_faulty(killed, &[swap(1.1, "mixer", "")]);
    assert_eq!(run["refused"]["mixer"]["epoch"], 0, "no message was sent when it came");
}

#[test]
fn what_is_refused_is_the_same_in_every_mode_when_queues_overflow_and_to_the_last_tick() {
    let garbage = |at_s, topic| format!("{{at_s={at_s}, for_s=0.2, target=\"{topic}\", kind=\"garbage\"}}");
    let faults = [garbage(1.0, "controls"), garbage(6.9, "actuators")].join(", ");
    let run = check_same_faulty(&faults, &[swap(1.1, "mixer", ", bounds={ticks=50}")]);
    assert_eq!(run["refused"]["mixer"]["range"], 20 + 10, "by the active process and by the candidate");
    assert_eq!(run["refused"]["plant"]["range"], 11);
}

#[test]
fn a_candidate_leaves_when_its_own_settings_say_so_and_not_before_it_has_come() {
    let exit = |at_s: f64, more: &str| format!("{{at_s={at_s}, target=\"mixer\", kind=\"exit\"{more}}}");
    let exits = [exit(0.5, ""), exit(2.0, ", for_s=0.0"), exit(3.0, "")].join(", ");
    let run = check_same(&[swap(1.0, "mixer", &format!(", set=['fault=[{exits}]']"))]);
    let died: Vec<_> = run["events"].as_array().expect("events").iter().filter(|e| e["what"] == "died").collect();
    assert_eq!(died.iter().map(|event| event["at_s"].as_f64()).collect::<Vec<_>>(), [Some(3.0)]);
}

#[test]
fn a_swap_whose_program_cannot_be_started_is_rejected_with_the_reason_and_spoils_the_exit_code() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = folder.path().join("program"); // it exists and is executable, but its interpreter does not exist
    crate::harness::write_script(&program, "#!/no/such/interpreter\n");
    let swap =
        swap(1.0, "mixer", &format!(", exec='{}'", program.display())).replace("may_fail=true", "may_fail=false");
    let outcome = flown(&[swap], "lockstep");
    let run = outcome.run();
    let events = run["events"].as_array().expect("events").iter().filter(|event| event["node"] == "mixer");
    let told: Vec<_> = events.map(|event| (event["what"].as_str().expect("a word"), event["why"].as_str())).collect();
    for what in ["not-started", "rejected"] {
        let why = told.iter().find(|event| event.0 == what).and_then(|event| event.1).unwrap_or_default();
        assert!(why.contains("cannot start /") && why.contains("No such file"), "{told:?}");
    }
    assert!(told.iter().all(|event| event.0 != "died"), "{told:?}");
    assert!(but(&run).contains("the swap of mixer at 1.00 s was rejected: cannot start"), "{run}");
    assert_eq!(outcome.code(), Some(1), "{}", outcome.stderr);
    assert_eq!(run["state_hash"], self::flown(&[], "lockstep").run()["state_hash"], "the old process flies on");
}

/// Returns the reservations of run.json.
fn but(run: &Value) -> String {
    let told = run["reservations"].as_array().expect("a list").iter();
    told.map(|told| told.as_str().expect("text").to_owned()).collect::<Vec<_>>().join("; ")
}

/// A flight is no success if its candidate never became active, or did not stay active.
#[test]
fn a_swap_that_did_not_stay_is_told_and_spoils_the_exit_code_unless_it_may_fail() {
    let standby = |way| format!(", set=['{}']", wrong(way, 1.05, "attitude-mpc", "controls"));
    let active = format!(", set=['{}']", wrong("nan", 1.25, "attitude-mpc", "controls"));
    let undecided = swap(6.8, "attitude-mpc", "");
    let cases = [
        (swap(1.0, "attitude-mpc", &standby("nan")), "at 1.00 s was rejected: an answer at 1.07 s that cannot be used"),
        (swap(1.0, "attitude-mpc", &standby("silent")), "at 1.00 s was rejected: no answer at 1.07 s"),
        (swap(1.0, "attitude-mpc", &standby("slow")), "at 1.00 s was rejected: "),
        (swap(1.0, "attitude-mpc", &standby("exit")), "at 1.00 s was rejected: it died"),
        (swap(1.0, "attitude-mpc", &active), "at 1.00 s was returned: an answer at 1.27 s that cannot be used"),
        (undecided, "at 6.80 s was not decided before the flight ended"),
    ];
    for (swap, expected) in cases {
        for (swap, code) in [(swap.clone(), 0), (swap.replace("may_fail=true", "may_fail=false"), 1)] {
            let outcome = flown(&[swap], "inprocess");
            assert_eq!(outcome.code(), Some(code), "{expected}: {}", outcome.stderr);
            let but = but(&outcome.run());
            assert!(but.contains(&format!("the swap of attitude-mpc {expected}")), "{but}");
            assert!(!but.contains("failed in flight"), "it was the candidate: {but}");
        }
    }
}

#[test]
fn a_program_that_ends_at_once_is_named_as_the_candidate() {
    let outcome = crate::harness::launcher()
        .args(["fly", HOVER, "--mode", "lockstep", "--no-log", "--set", "run.duration_s=2.0", "--set"])
        .arg("swap=[{at_s=1, node='attitude-mpc', exec='/bin/true'}]")
        .args(["--namespace", &crate::harness::namespace(), "--out"])
        .arg(tempfile::tempdir().expect("a temporary folder").path().join("run"))
        .output()
        .expect("the launcher runs");
    let said = String::from_utf8_lossy(&outcome.stdout).into_owned();
    assert_eq!(outcome.status.code(), Some(1), "{said}");
    assert!(
        said.starts_with("hover-gusts: flown to the end, 2.00 s, but the swap of attitude-mpc at 1.00 s was rejected"),
        "{said}"
    );
    assert!(
        said.contains("candidate of attitude-mpc, 1.00 s: started, ") && !said.contains("attitude-mpc failed"),
        "{said}"
    );
}
