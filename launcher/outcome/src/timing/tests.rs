//! Tests of every definition, with stamps made by hand. A period is 10 ms, and so is every deadline; times are in us
//! from the first sample.

use contract::Topic;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State};
use contract::stamp::delivery;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
use settings::{Late, TrajectoryKind};

use flight::event::{Event, TimedEvent, What};
use serde_json::{Value, json};
use settings::{Fault, FaultKind, FaultTarget};

use super::*;
use crate::faults::FaultRecord;
use flight::log::Count;

const US: u64 = 1_000;
const PERIOD_US: u64 = 10_000;
/// Monotonic clock at the first sample \[us\].
const EPOCH_US: u64 = 5_000_000;

/// Ring whose stamps are written by a fake clock: 100 us of execution per node, 20 us per wake-up.
struct Ring {
    timing: Timing,
    count: Count,
    now_us: u64,
    last: [Stamp; 4],
    /// Number and age \[ns\] of the command in force.
    applied: (u64, u64),
    /// CPU time of the cycles before \[us\].
    cpu_us: u64,
    solve_us: u64,
    happened: Happenings,
}

impl Ring {
    fn new(mode: Mode) -> Self {
        let mut scenario = Scenario::default();
        scenario.run.mode = mode;
        scenario.mission.trajectory = TrajectoryKind::Hover;
        scenario.run.duration_s = 100.0;
        scenario.deadline.late = Late::Skip;
        for topic in [Topic::State, Topic::Reference, Topic::Controls] {
            scenario.node.of_mut(topic).deadline_ms = Some(10.0);
        }
        let (timing, count, happened) = (Timing::new(&scenario), Count::default(), Happenings::default());
        let last = [Stamp::default(); 4];
        Self { timing, count, now_us: 0, last, applied: (0, 0), cpu_us: 90, solve_us: 80, happened }
    }

    /// Makes a ring that has flown `ticks` ticks in time.
    fn after(ticks: u64) -> Self {
        let mut ring = Self::new(Mode::Realtime);
        (0..ticks).for_each(|tick| ring.turn(tick, IN_TIME));
        ring
    }

    /// Flies a tick with nothing unusual, except that `delay` is added to each node's (wake-up, execution) \[us\].
    fn turn(&mut self, tick: u64, delay: [(u64, u64); 4]) {
        self.now_us = tick * PERIOD_US;
        for (topic, (wake, execution)) in Topic::ALL.into_iter().zip(delay) {
            self.cycle(topic, tick, 20 + wake, 100 + execution, 0);
        }
        self.applied = (self.last[3].sequence, (self.now_us - tick * PERIOD_US) * US);
    }

    /// Makes one cycle: due now, begun after `wake_us`, sent `execution_us` later, `slips` periods skipped before it.
    fn cycle(&mut self, topic: Topic, tick: u64, wake_us: u64, execution_us: u64, slips: u64) {
        let last = self.last[topic as usize];
        let release_us = self.now_us;
        let start_us = release_us + wake_us;
        self.now_us = start_us + execution_us;
        let late = u64::from(self.now_us - tick * PERIOD_US > PERIOD_US);
        let ns = |us: u64| (EPOCH_US + us) * US;
        let mut stamp = Stamp {
            tick,
            sample_ns: ns(tick * PERIOD_US),
            sequence: last.sequence + 1,
            epoch: 1,
            release_ns: ns(release_us),
            start_ns: ns(start_us),
            cpu_ns: if last.sequence == 0 { 0 } else { self.cpu_us * US },
            misses: last.misses + late + slips,
            slips: last.slips + slips,
            ..Stamp::default()
        };
        stamp.publish_ns[topic as usize] = ns(self.now_us);
        self.send(topic, stamp);
    }

    fn send(&mut self, topic: Topic, stamp: Stamp) {
        self.last[topic as usize] = stamp;
        let (applied_sequence, applied_age_ns) = self.applied;
        let record = match topic {
            Topic::State => {
                let mut truth = Truth { tick: stamp.tick, ..Truth::default() };
                truth.actual.position_m = [0.25, 0.0, 0.0];
                self.timing.truth(&truth);
                State { stamp, applied_sequence, applied_age_ns, ..State::default() }.with_checksum().into()
            }
            Topic::Reference => Reference { stamp, ..Reference::default() }.with_checksum().into(),
            Topic::Controls => {
                Controls { stamp, solve_ns: self.solve_us * US, ..Controls::default() }.with_checksum().into()
            }
            Topic::Actuators => Actuators { stamp, ..Actuators::default() }.with_checksum().into(),
        };
        if let Some(before) = self.count.before(&record) {
            self.timing.observe(&record, &before);
        }
    }

    /// Goes on at `tick`, `after_us` after its sample, with one cycle of each of these nodes.
    fn go_on(&mut self, tick: u64, after_us: u64, topics: &[Topic], slips: u64) {
        self.now_us = tick * PERIOD_US + after_us;
        for topic in topics {
            self.cycle(*topic, tick, 20, 100, slips);
        }
    }

    /// A value of the `timing` table.
    fn at(&self, path: &str) -> Value {
        let timing = json!(self.timing.record(&self.happened));
        timing.pointer(path).unwrap_or_else(|| panic!("no {path} in {timing}")).clone()
    }

    /// Counts of a node.
    fn counts<const N: usize>(&self, node: &str, paths: [&str; N]) -> [u64; N] {
        paths.map(|path| self.at(&format!("/nodes/{node}/{path}")).as_u64().unwrap())
    }

    /// Checks a time to three digits.
    fn near(&self, path: &str, us: f64) {
        let value = self.at(path).as_f64().unwrap();
        assert!((value - us).abs() <= 1e-3 * us, "{path}: {value}, not {us}");
    }

    /// Values of the fields `keys` of the worst tick.
    fn worst<const N: usize>(&self, keys: [&str; N]) -> [String; N] {
        keys.map(|key| {
            let value = self.at(&format!("/worst_ticks/0/{key}"));
            value.as_str().map_or_else(|| value.to_string(), str::to_owned)
        })
    }
}

const IN_TIME: [(u64, u64); 4] = [(0, 0); 4];
const NOT_SCHEDULED: &str = "not scheduled (preempted, stopped, or the host took the CPU)";

#[test]
fn a_ring_in_time_shows_its_parts_and_no_miss() {
    let ring = Ring::after(10);
    ring.near("/nodes/plant/jitter/max_us", 20.0);
    assert_eq!(ring.at("/nodes/plant/hop"), Value::Null, "the plant has no input");
    let parts = [("hop", 20.0), ("execution", 100.0), ("input_age", 380.0), ("response", 480.0), ("cpu", 90.0)];
    for (figure, us) in parts {
        ring.near(&format!("/nodes/mixer/{figure}/p50_us"), us);
    }
    assert_eq!(ring.counts("mixer", ["cpu/n", "response/n"]), [8, 10], "neither start-up nor the last cycle");
    assert_eq!((ring.timing.misses(), ring.counts("mixer", ["longest_run_of_misses"])), (0, [0]));
    assert_eq!(ring.worst(["cause"]), ["nothing stands out"]);
    let mut lockstep = Ring::new(Mode::Lockstep);
    lockstep.turn(0, IN_TIME);
    assert_eq!(lockstep.at("/worst_ticks"), json!([]), "only in real time is a tick late");
}

#[test]
fn a_clock_that_is_off_is_flagged_and_not_measured() {
    let mut ring = Ring::after(2);
    assert!(ring.timing.nodes.iter().all(|node| node.contradictions == 0));
    // CONTROLS says that it was sent 1 ms before the STATE that it was made from.
    ring.go_on(2, 0, &[Topic::State], 0);
    let state = ring.last[Topic::State as usize];
    let mut stamp = Stamp { sequence: ring.last[2].sequence + 1, ..state };
    stamp.publish_ns[Topic::Controls as usize] = state.publish_ns[Topic::State as usize] - 1_000 * US;
    ring.send(Topic::Controls, stamp);
    // The mixer says that its command of tick 2 was sent 2 ms later than the plant says it came.
    let mut stamp = Stamp { tick: 2, sequence: ring.last[3].sequence + 1, ..ring.last[3] };
    ring.applied = (stamp.sequence, 400 * US);
    stamp.sample_ns += PERIOD_US * US;
    stamp.publish_ns[Topic::Actuators as usize] = stamp.sample_ns + 2_400 * US;
    ring.send(Topic::Actuators, stamp);
    ring.go_on(3, 0, &[Topic::State], 0);
    let expected = json!({ "plant": 0, "guidance": 0, "attitude-mpc": 1, "mixer": 1 });
    assert_eq!(ring.at("/clock_contradictions"), expected);
    assert_eq!(ring.counts("attitude-mpc", ["response/n"]), [2], "the third is no figure");
}

#[test]
fn a_late_wake_is_jitter_and_an_early_one_is_none() {
    let mut ring = Ring::after(1);
    ring.turn(1, [(3_000, 0), (0, 0), (0, 0), (0, 0)]);
    let late = [("plant/jitter", 3_020.0), ("mixer/response", 3_480.0), ("mixer/hop", 20.0)];
    for (figure, us) in late {
        ring.near(&format!("/nodes/{figure}/max_us"), us);
    }
    let before = ring.last[0];
    ring.send(Topic::State, Stamp { sequence: before.sequence + 1, start_ns: before.release_ns - 5 * US, ..before });
    assert_eq!(ring.counts("plant", ["jitter/n"]), [3]);
    ring.near("/nodes/plant/jitter/max_us", 3_020.0);
}

#[test]
fn skipped_slots_are_misses_and_each_has_its_response() {
    let mut ring = Ring::after(1);
    ring.go_on(4, 0, &[Topic::State], 3); // the plant slept through three releases and is in time for the fourth
    assert_eq!(ring.counts("plant", ["slips", "misses", "late"]), [3, 3, 0]);
    assert_eq!(ring.counts("plant", ["response/n", "response_per_slot/n"]), [2, 5]);
    ring.near("/nodes/plant/response/max_us", 120.0);
    ring.near("/nodes/plant/response_per_slot/max_us", 30_120.0);
    let charged = ["4", "30120.0", "plant", "jitter"];
    assert_eq!(ring.worst(["tick", "late_us", "node", "part"]), charged, "to the tick that ended the stall");
}

#[test]
fn a_run_of_misses_goes_on_through_slips_and_ends_with_a_cycle_in_time() {
    let mut ring = Ring::after(0);
    let mut tick = 0;
    let mut longest_run = |execution_us, slips| {
        tick += 1 + slips;
        ring.now_us = tick * PERIOD_US;
        ring.cycle(Topic::Reference, tick, 20, execution_us, slips);
        ring.counts("guidance", ["longest_run_of_misses"])[0]
    };
    assert_eq!(longest_run(100, 0), 0);
    longest_run(12_000, 0); // late
    longest_run(12_000, 2); // two skipped, late again
    assert_eq!(longest_run(100, 1), 5, "one skipped, then in time");
    assert_eq!(longest_run(12_000, 0), 5, "a run of one after it");
    assert_eq!((ring.counts("guidance", ["late"]), ring.timing.misses()), ([3], 6));
}

#[test]
fn a_message_withheld_is_a_late_one_and_its_slot_stays_silent() {
    let mut ring = Ring::after(1);
    ring.last[3].misses += 2; // two cycles came too late, and their messages were not sent
    ring.go_on(3, 0, &[Topic::Actuators], 0);
    assert_eq!(ring.counts("mixer", ["late", "withheld", "misses", "slips"]), [2, 2, 2, 0]);
    assert_eq!((ring.counts("mixer", ["longest_run_of_misses"]), ring.at("/nodes/mixer/policy")), ([2], "skip".into()));
    assert_eq!(ring.counts("mixer", ["response/n", "response_per_slot/n"]), [2, 4]);
    ring.near("/nodes/mixer/response_per_slot/max_us", 20_120.0);
    assert_eq!(ring.counts("mixer", ["cpu/n"]), [0], "what the stamp tells is the CPU time of a cycle withheld");
    let withheld = ["3", "mixer", "late messages were withheld, as the deadline's policy says"];
    assert_eq!(ring.worst(["tick", "node", "cause"]), withheld);
}

#[test]
fn an_age_held_grows_by_a_period_per_slot() {
    let mut ring = Ring::after(3);
    // Samples 3, 4 and 5 see the command of tick 2; then a command comes that is 35 ms old.
    (3..6).for_each(|tick| ring.go_on(tick, 0, &[Topic::State], 0));
    ring.applied = (9, 35_000 * US);
    ring.go_on(6, 0, &[Topic::State], 0);
    let counts = ["", "_per_slot"].map(|over| ring.at(&format!("/age_at_actuator{over}/n")));
    assert_eq!(counts, [4, 6].map(Value::from));
    ring.near("/age_at_actuator/p50_us", 480.0);
    ring.near("/age_at_actuator_per_slot/p90_us", 35_000.0);
    assert_eq!(ring.timing.age.per_slot.count_between(20_400 * US, 20_600 * US), 1, "the second slot held");
}

#[test]
fn a_stalled_plant_held_its_command_in_every_slot() {
    let slots = |applied: (u64, u64), lost: u64| {
        let mut age = Age::new(PERIOD_US * US);
        let sampled = |tick, sequence, (applied_sequence, age_us): (u64, u64)| State {
            stamp: Stamp { tick, sequence, ..Stamp::default() },
            applied_sequence,
            applied_age_ns: age_us * US,
            ..State::default()
        };
        let states =
            [sampled(0, 1, (0, 0)), sampled(1, 2, (0, 0)), sampled(2, 3, (1, 500)), sampled(6, 4 + lost, applied)];
        states.iter().flat_map(|state| age.observe(state)).map(|age_ns| age_ns / US).collect::<Vec<_>>()
    };
    assert_eq!(slots((1, 500), 0), [500, 10_500, 20_500, 30_500, 40_500], "nothing came");
    assert_eq!(slots((2, 400), 0), [500, 400, 10_400, 20_400, 30_400], "came before the stall");
    assert_eq!(slots((2, 35_000), 0), [500, 10_500, 20_500, 30_500, 35_000], "came at its end");
    assert_eq!(slots((2, 95_000), 0), [500, 10_500, 20_500, 30_500, 95_000], "from a sample long before");
    assert_eq!(slots((2, 400), 3), [500, 400], "not a stall: three samples were not seen");
    assert_eq!(slots((1, 500), 3), [500, 40_500], "the same, and nothing came");
}

#[test]
fn misses_of_a_standby_are_no_misses_of_the_flight() {
    let mut ring = Ring::after(0);
    let mut say = |tick: u64, epoch, delivery, slips| {
        let sample_ns = (EPOCH_US + tick * PERIOD_US) * US;
        let (start_ns, release_ns) = (sample_ns, sample_ns);
        let stamp =
            Stamp { tick, sample_ns, epoch, delivery, release_ns, start_ns, slips, misses: slips, ..Stamp::default() };
        ring.send(Topic::Actuators, stamp.published(Topic::Actuators, tick + 1, sample_ns + 100 * US));
    };
    for tick in 0..4 {
        say(tick, 1, delivery::DELIVERED, 0);
        say(tick, 2, delivery::STANDBY, 3 * tick);
    }
    for tick in 4..8 {
        say(tick, 2, delivery::DELIVERED, 10); // one slip more than on standby
        say(tick, 1, delivery::STANDBY, tick);
    }
    say(8, 1, delivery::DELIVERED, 7); // active again
    assert_eq!(ring.counts("mixer", ["slips", "misses", "response/n", "response_per_slot/n"]), [1, 1, 9, 10]);
    assert_eq!(
        ring.counts("mixer", ["cpu/n"]),
        [2 + 3],
        "of cycles active, but for the first and the last of each time"
    );
    assert_eq!(ring.worst(["tick", "late_us"]), ["4", "10100.0"]);
    ring.send(Topic::Actuators, Stamp { tick: 9, epoch: 3, sequence: 1, misses: 1, slips: 1, ..Stamp::default() });
    assert_eq!(ring.counts("mixer", ["slips", "misses"]), [2, 2], "counters begin anew with another epoch");
}

/// Flies twenty ticks in time, tick 20 with `delay`, and one more in time, whose stamps tell the CPU time of tick 20.
fn late_tick(delay: [(u64, u64); 4], cpu_us: u64, solve_us: u64) -> Ring {
    let mut ring = Ring { solve_us, ..Ring::after(20) };
    ring.turn(20, delay);
    ring.cpu_us = cpu_us;
    ring.turn(21, IN_TIME);
    ring
}

const MPC_EXECUTION: [(u64, u64); 4] = [(0, 0), (0, 0), (0, 7_000), (0, 0)];
const MIXER_EXECUTION: [(u64, u64); 4] = [(0, 0), (0, 0), (0, 0), (0, 14_000)];

#[test]
fn the_worst_tick_names_the_part_and_its_cause() {
    let of = |delay, cpu_us, solve_us| {
        let ring = late_tick(delay, cpu_us, solve_us);
        assert_eq!(ring.worst(["tick", "position_error_m"]), ["20", "0.25"]);
        ring.worst(["node", "part", "cause"])
    };
    assert_eq!(of([(4_000, 0), (0, 0), (0, 0), (0, 0)], 90, 0), ["plant", "jitter", NOT_SCHEDULED]);
    assert_eq!(of([(0, 0), (0, 0), (0, 0), (4_000, 0)], 90, 0), ["mixer", "hop", NOT_SCHEDULED]);
    assert_eq!(of(MPC_EXECUTION, 90, 80), ["attitude-mpc", "execution", "preempted while it ran"]);
    assert_eq!(of(MPC_EXECUTION, 7_050, 6_900), ["attitude-mpc", "execution", "the solver"]);
    assert_eq!(of(MPC_EXECUTION, 7_050, 80), ["attitude-mpc", "execution", "its own work"]);
    assert_eq!(of([(0, 0), (0, 7_000), (0, 0), (0, 0)], 7_050, 6_900), ["guidance", "execution", "its own work"]);
}

#[test]
fn a_node_still_at_work_is_late_for_its_next_input() {
    let mut ring = Ring::after(22);
    ring.turn(22, MIXER_EXECUTION); // the mixer sends 14.48 ms after the sample
    assert_eq!(
        ring.worst(["cause", "nodes/mixer/cpu_us"]),
        ["CPU time not known", "null"],
        "the next message tells it"
    );
    ring.turn(23, [(0, 0), (0, 0), (0, 0), (4_100, 0)]); // the mixer begins this cycle when it has sent
    let worst = ring.timing.worst_ticks(&ring.happened);
    let told = |i: usize| (worst[i].tick, worst[i].node.as_str(), worst[i].cause.as_str());
    assert_eq!(told(0), (22, "mixer", "preempted while it ran"));
    assert_eq!(told(1), (23, "mixer", "the cycle before was not over"));
}

#[test]
fn the_cpu_time_of_a_cycle_is_unknown_if_the_next_message_was_not_seen() {
    let mut ring = Ring::after(22);
    ring.turn(22, MIXER_EXECUTION);
    ring.last[3].sequence += 1; // the next message seen tells the CPU time of the unseen cycle
    ring.turn(23, IN_TIME);
    assert_eq!(ring.worst(["nodes/mixer/cpu_us"]), ["null"]);
}

#[test]
fn the_ten_worst_ticks_are_kept_in_a_long_flight_and_a_late_answer_finds_its_tick() {
    let mut ring = Ring::after(0);
    for tick in 0..9_000 {
        let delay = if tick % 500 == 7 { 1_000 + tick / 10 } else { 0 };
        ring.turn(tick, [(0, 0), (delay, 0), (0, 0), (0, 0)]);
    }
    ring.now_us = 9_000 * PERIOD_US;
    ring.cycle(Topic::Actuators, 7, 20, 100, 0); // the answer to tick 7, ninety seconds later
    let ticks: Vec<_> = ring.timing.worst_ticks(&ring.happened).iter().map(|worst| worst.tick).collect();
    assert_eq!(ticks, [7, 8507, 8007, 7507, 7007, 6507, 6007, 5507, 5007, 4507]);
    ring.near("/worst_ticks/1/late_us", 480.0 + 1_850.0);
}

#[test]
fn histograms_on_disk_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    late_tick(MPC_EXECUTION, 90, 80).timing.write_histograms(folder.path()).unwrap();
    assert_eq!(std::fs::read_dir(folder.path().join(HISTOGRAMS)).unwrap().count(), 4 * 5 + 3 + 2);
    let text = std::fs::read(folder.path().join("histograms/attitude-mpc-execution.hlog")).unwrap();
    let entries: Vec<_> = IntervalLogIterator::new(&text).map(Result::unwrap).collect();
    let [LogEntry::Interval(interval)] = &entries[..] else { panic!("one interval: {}", entries.len()) };
    assert!((interval.max() - 7_100.0).abs() < 8.0, "the largest, in us: {}", interval.max());
    assert!(interval.encoded_histogram().starts_with("HIST"), "version 2, compressed");
}

#[test]
fn the_terminal_shows_every_node_both_ages_and_the_worst_tick() {
    let text = late_tick(MPC_EXECUTION, 90, 80).timing.record(&Happenings::default()).describe();
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

/// Checks that the worst tick is as late as the largest `response_per_slot` of all nodes.
fn check_longest_slot(ring: &Ring) {
    let longest = NODES.map(|node| ring.at(&format!("/nodes/{node}/response_per_slot/max_us")).as_f64().unwrap());
    ring.near("/worst_ticks/0/late_us", longest.into_iter().fold(0.0, f64::max));
}

#[test]
fn a_stall_of_the_host_that_all_nodes_sleep_through_is_one_stall() {
    let mut ring = Ring::after(22);
    // The host takes the processors for 25 ms: ticks 22 and 23 are slept through by all nodes, and 24 is late.
    ring.go_on(24, 5_000, &Topic::ALL, 2);
    assert_eq!(ring.worst(["tick", "late_us"]), ["24", "25480.0"], "two slots, not eight");
    check_longest_slot(&ring);
}

/// Ring whose mixer dies after tick 21; its next process answers tick 25 first.
fn replaced(faults: &[FaultRecord], events: &[Event]) -> Ring {
    let mut ring = Ring { happened: Happenings::new(faults, &TimedEvent::all(events, 100)), ..Ring::after(22) };
    for tick in 22..25 {
        ring.now_us = tick * PERIOD_US;
        for topic in [Topic::State, Topic::Reference, Topic::Controls] {
            let wake_us = if (topic, tick) == (Topic::State, 23) { 220 } else { 20 };
            ring.cycle(topic, tick, wake_us, 100, 0);
        }
    }
    let sample_ns = (EPOCH_US + 25 * PERIOD_US) * US;
    let start_ns = sample_ns + 20 * US;
    let stamp = Stamp { tick: 25, epoch: 2, sample_ns, release_ns: sample_ns, start_ns, ..Stamp::default() };
    ring.send(Topic::Actuators, stamp.published(Topic::Actuators, 1, sample_ns + 120 * US));
    ring
}

#[test]
fn faults_deaths_and_replacements_are_told_before_the_host() {
    let acted = |target, kind, at_s| FaultRecord {
        injected_at_s: Some(at_s),
        ..FaultRecord::of(&Fault::new(target, kind, at_s, None))
    };
    let kill = [acted(FaultTarget::Wind, FaultKind::Gust, 0.0), acted(FaultTarget::Mixer, FaultKind::Kill, 0.215)];
    let died = [Event::new(22, "mixer", 1, What::Died), Event::new(25, "mixer", 2, What::TookOver)];
    let of = |faults: &[FaultRecord], events: &[Event]| replaced(faults, events).worst(["cause", "in_words"]);
    assert_eq!(of(&[], &[])[0], NOT_SCHEDULED);
    assert_eq!(of(&kill, &[]), ["a fault acted", "mixer: hop of 30.02 ms: mixer kill at 0.21 s"]);
    let [cause, words] = of(&kill, &died);
    assert_eq!(cause, "a process died or hung");
    assert_eq!(
        words,
        "mixer: hop of 30.02 ms: mixer kill at 0.21 s; mixer was down, 0.22 to 0.25 s; mixer died at 0.22 s; 1 more"
    );
    assert_eq!(of(&[], &died[1..])[0], "a process died, started or was replaced");
}

#[test]
fn the_slots_of_a_dead_process_wait_for_its_replacement() {
    let ring = replaced(&[], &[Event::new(22, "mixer", 1, What::Died)]);
    assert_eq!(ring.worst(["tick", "late_us", "nodes/mixer/slips", "nodes/mixer/silent"]), ["25", "30120.0", "0", "3"]);
    check_longest_slot(&ring);
    let worst = ring.timing.worst_ticks(&ring.happened);
    let unanswered = worst.iter().find(|worst| worst.tick == 23).unwrap();
    assert_eq!(unanswered.cause, "a process died or hung");
}

#[test]
fn an_input_that_does_not_come_makes_its_tick_the_worst() {
    let mut ring = Ring::after(22);
    ring.go_on(22, 0, &[Topic::State, Topic::Reference, Topic::Controls], 0);
    ring.go_on(22, 8_000, &[Topic::Actuators], 0); // end of the mixer's wait: the demand was lost on the way
    let words = "mixer: wait for its input of 7.64 ms: its input did not come";
    assert_eq!(ring.worst(["tick", "cause", "in_words"]), ["22", "its input did not come", words]);
}
