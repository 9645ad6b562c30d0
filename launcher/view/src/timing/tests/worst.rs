//! The worst ticks and their causes, the files, the terminal.

use serde_json::json;

use super::*;

/// Twenty ticks in time, then number 20 with `delay`, then one in time whose stamps tell the CPU time of that.
fn late_tick(delay: [(u64, u64); 4], cpu_us: u64, solve_us: u64) -> Ring {
    let mut ring = Ring::new();
    (0..20).for_each(|tick| ring.turn(tick, IN_TIME));
    ring.solve_us = solve_us;
    ring.turn(20, delay);
    ring.cpu_us = cpu_us;
    ring.turn(21, IN_TIME);
    ring
}

#[test]
fn the_worst_tick_names_the_part_and_its_cause() {
    const MPC_EXECUTION: [(u64, u64); 4] = [(0, 0), (0, 0), (0, 7_000), (0, 0)];
    let of = |delay, cpu_us, solve_us| {
        let worst = late_tick(delay, cpu_us, solve_us).worst();
        assert_eq!((&worst["tick"], &worst["position_error_m"]), (&20.into(), &0.25.into()));
        ["node", "part", "cause"].map(|key| worst[key].as_str().unwrap().to_owned())
    };
    let asleep = "not scheduled (preempted, stopped, or the host took the CPU)";
    assert_eq!(of([(4_000, 0), (0, 0), (0, 0), (0, 0)], 90, 0), ["plant", "jitter", asleep]);
    assert_eq!(of([(0, 0), (0, 0), (0, 0), (4_000, 0)], 90, 0), ["mixer", "hop", asleep]);
    assert_eq!(of(MPC_EXECUTION, 90, 80), ["attitude-mpc", "execution", "preempted while it ran"]);
    assert_eq!(of(MPC_EXECUTION, 7_050, 6_900), ["attitude-mpc", "execution", "the solver"]);
    assert_eq!(of(MPC_EXECUTION, 7_050, 80), ["attitude-mpc", "execution", "its own work"]);
    assert_eq!(of([(0, 0), (0, 7_000), (0, 0), (0, 0)], 7_050, 6_900), ["guidance", "execution", "its own work"]);
}

#[test]
fn a_node_still_at_work_is_late_for_its_next_input() {
    let mut ring = late_tick(IN_TIME, 90, 80);
    ring.turn(22, [(0, 0), (0, 0), (0, 0), (0, 14_000)]); // the mixer sends 14.48 ms after the sample
    ring.turn(23, [(0, 0), (0, 0), (0, 0), (4_100, 0)]); // and begins the next when it has
    let worst = ring.timing.worst_ticks(&ring.happened);
    let told = |i: usize| (worst[i].0.number, worst[i].1.node(), worst[i].1.cause);
    assert_eq!(told(0), (22, "mixer", "preempted while it ran"));
    assert_eq!(told(1), (23, "mixer", "the cycle before was not over"));
}

#[test]
fn the_cpu_time_of_the_last_cycle_is_not_known() {
    let mut ring = late_tick(IN_TIME, 90, 80);
    ring.turn(22, [(0, 0), (0, 0), (0, 0), (0, 14_000)]);
    assert_eq!(ring.worst()["cause"], "CPU time not known");
    assert_eq!(ring.worst()["nodes"]["mixer"]["cpu_us"], Value::Null);
    let mut lost = late_tick(IN_TIME, 90, 80);
    lost.turn(22, [(0, 0), (0, 0), (0, 0), (0, 14_000)]);
    lost.last[3].sequence += 1; // a message was not seen: the next one tells the CPU time of that
    lost.turn(23, IN_TIME);
    assert_eq!(lost.worst()["nodes"]["mixer"]["cpu_us"], Value::Null);
}

#[test]
fn the_ten_worst_outlive_a_long_flight_and_a_late_answer_finds_its_tick() {
    let mut ring = Ring::new();
    for tick in 0..9_000 {
        let delay = if tick % 500 == 7 { 1_000 + tick / 10 } else { 0 };
        ring.turn(tick, [(0, 0), (delay, 0), (0, 0), (0, 0)]);
    }
    ring.now_us = 9_000 * PERIOD_US;
    ring.cycle(Topic::Actuators, 7, 20, 100, 0); // the answer to tick 7, ninety seconds later
    let worst = ring.timing.to_json(&ring.happened)["worst_ticks"].clone();
    let ticks: Vec<_> = worst.as_array().unwrap().iter().map(|tick| tick["tick"].as_u64().unwrap()).collect();
    assert_eq!(ticks, [7, 8507, 8007, 7507, 7007, 6507, 6007, 5507, 5007, 4507]);
    near(&worst[1], "late_us", 480.0 + 1_850.0);
}

#[test]
fn outside_real_time_no_tick_is_late() {
    let mut scenario = Scenario::default();
    scenario.run.mode = Mode::Lockstep;
    let mut ring = Ring { timing: Timing::new(&scenario), ..Ring::new() };
    (0..10).for_each(|tick| ring.turn(tick, IN_TIME));
    assert_eq!(ring.timing.to_json(&ring.happened)["worst_ticks"], serde_json::json!([]));
}

#[test]
fn histograms_on_disk_are_whole() {
    use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
    let ring = late_tick([(0, 0), (0, 0), (0, 7_000), (0, 0)], 90, 80);
    let folder = tempfile::tempdir().unwrap();
    ring.timing.write_histograms(folder.path()).unwrap();
    assert_eq!(std::fs::read_dir(folder.path().join(HISTOGRAMS)).unwrap().count(), 4 * 5 + 3 + 2);
    let text = std::fs::read(folder.path().join("histograms/attitude-mpc-execution.hlog")).unwrap();
    let entries: Vec<_> = IntervalLogIterator::new(&text).map(Result::unwrap).collect();
    let [LogEntry::Interval(interval)] = &entries[..] else { panic!("one interval: {}", entries.len()) };
    assert!((interval.max() - 7_100.0).abs() < 8.0, "the largest, in us: {}", interval.max());
    assert!(interval.encoded_histogram().starts_with("HIST"), "version 2, compressed");
}

#[test]
fn the_terminal_shows_every_node_both_ages_and_the_worst_tick() {
    let text = late_tick([(0, 0), (0, 0), (0, 7_000), (0, 0)], 90, 80).timing.describe(&Happenings::default());
    for told in [
        "attitude-mpc       20     20      20      100   7102    7102      360   7361    7361       0    0",
        "age at the actuator   p50 0.48 ms, p99 7.48 ms, max 7.48 ms over 21 commands applied",
        "max 7.48 ms over 21 slots held",
        "worst tick            7.48 ms, tick 20 at 0.20 s; position error 0.250 m",
        "attitude-mpc: execution of 7.10 ms on 0.09 ms of CPU: preempted while it ran",
    ] {
        assert!(text.contains(told), "{told}\n{text}");
    }
}

/// Largest `response_per_slot` of all nodes \[us\].
fn longest_slot_us(ring: &Ring) -> f64 {
    let nodes = contract::topic::NODES.map(|node| ring.node(node)["response_per_slot"]["max_us"].as_f64().unwrap());
    nodes.into_iter().fold(0.0, f64::max)
}

#[test]
fn a_stall_of_the_host_that_all_nodes_sleep_through_is_one_stall() {
    let mut ring = late_tick(IN_TIME, 90, 80);
    // The host takes the processors for 25 ms: ticks 22 and 23 are slept through by all nodes, and 24 is late.
    ring.now_us = 24 * PERIOD_US + 5_000;
    for topic in Topic::ALL {
        ring.cycle(topic, 24, 20, 100, 2);
    }
    let worst = ring.worst();
    assert_eq!((&worst["tick"], &worst["late_us"]), (&24.into(), &25_480.0.into()), "two slots, not eight");
    near(&worst, "late_us", longest_slot_us(&ring));
    let text = ring.timing.describe(&ring.happened);
    assert!(text.contains("worst tick            25.48 ms, tick 24"), "{text}");
}

/// A mixer that dies after tick 20, and whose next process answers tick 25 first.
fn replaced(happened: Happenings) -> Ring {
    let mut ring = Ring { happened, ..late_tick(IN_TIME, 90, 80) };
    for tick in 22..25 {
        ring.now_us = tick * PERIOD_US;
        for topic in [Topic::State, Topic::Reference, Topic::Controls] {
            let wake_us = if (topic, tick) == (Topic::State, 23) { 220 } else { 20 };
            ring.cycle(topic, tick, wake_us, 100, 0);
        }
    }
    let (sample_ns, release_ns) = ((EPOCH_US + 25 * PERIOD_US) * US, (EPOCH_US + 25 * PERIOD_US) * US);
    let mut stamp = Stamp { tick: 25, epoch: 2, sequence: 1, sample_ns, release_ns, ..Stamp::default() };
    stamp.start_ns = sample_ns + 20 * US;
    stamp.publish_ns[Topic::Actuators as usize] = sample_ns + 120 * US;
    ring.send(Topic::Actuators, stamp);
    ring
}

#[test]
fn the_slots_of_a_dead_process_waited_for_the_next_one() {
    let ring = replaced(Happenings::default());
    let worst = ring.worst();
    assert_eq!((&worst["tick"], &worst["late_us"]), (&25.into(), &30_120.0.into()));
    assert_eq!((&worst["nodes"]["mixer"]["slips"], &worst["nodes"]["mixer"]["silent"]), (&0.into(), &3.into()));
    near(&worst, "late_us", longest_slot_us(&ring));
}

#[test]
fn faults_deaths_and_replacements_are_told_before_the_host() {
    let kill = json!([
        { "target": "wind", "kind": "gust", "injected_at_s": 0.0, "ended_at_s": null },
        { "target": "mixer", "kind": "kill", "injected_at_s": 0.215, "ended_at_s": null },
    ]);
    let died = json!([
        { "at_s": 0.22, "node": "mixer", "epoch": 1, "what": "died" },
        { "at_s": 0.25, "node": "mixer", "epoch": 2, "what": "took-over" },
    ]);
    let of = |faults: &Value, events: &Value| {
        let worst = replaced(Happenings::new(faults, events)).worst();
        ["cause", "in_words"].map(|key| worst[key].as_str().unwrap().to_owned())
    };
    let none = json!([]);
    assert_eq!(of(&none, &none)[0], "not scheduled (preempted, stopped, or the host took the CPU)");
    assert_eq!(of(&kill, &none), ["a fault acted", "mixer: hop of 30.02 ms: mixer kill, from 0.21 s"]);
    let [cause, words] = of(&kill, &died);
    assert_eq!(cause, "a process died or hung");
    assert_eq!(
        words,
        "mixer: hop of 30.02 ms: mixer kill, from 0.21 s; mixer was down, 0.22 to 0.25 s; mixer died at 0.22 s; 1 more"
    );
    let taken_over = json!([{ "at_s": 0.25, "node": "mixer", "epoch": 2, "what": "took-over" }]);
    assert_eq!(of(&none, &taken_over)[0], "a process died, started or was replaced");
}

#[test]
fn a_tick_without_an_answer_names_the_node_that_was_down() {
    let died = json!([{ "at_s": 0.22, "node": "mixer", "epoch": 1, "what": "died" }]);
    let ring = replaced(Happenings::new(&Value::Null, &died));
    let worst = ring.timing.worst_ticks(&ring.happened);
    let (_, culprit) = worst.iter().find(|(tick, _)| tick.number == 23).unwrap();
    assert_eq!(culprit.cause, "a process died or hung");
}

#[test]
fn an_input_that_does_not_come_is_waited_for() {
    let mut ring = late_tick(IN_TIME, 90, 80);
    ring.now_us = 22 * PERIOD_US;
    for topic in [Topic::State, Topic::Reference, Topic::Controls] {
        ring.cycle(topic, 22, 20, 100, 0);
    }
    ring.now_us = 22 * PERIOD_US + 8_000; // its patience: the demand was lost on the way
    ring.cycle(Topic::Actuators, 22, 20, 100, 0);
    let worst = ring.worst();
    assert_eq!((&worst["tick"], &worst["cause"]), (&22.into(), &"its input did not come".into()));
    assert_eq!(worst["in_words"], "mixer: wait for its input of 7.64 ms: its input did not come");
}
