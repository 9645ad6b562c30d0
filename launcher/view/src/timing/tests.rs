//! Every definition, with stamps made by hand. A period is 10 ms, and so is every deadline; times are in us from the
//! first sample.

use contract::Topic;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State};
use contract::scenario::{Late, TrajectoryKind};
use contract::stamp::delivery;
use serde_json::Value;

use super::*;
use flight::log::Count;

mod worst;

const US: u64 = 1_000;
const PERIOD_US: u64 = 10_000;
/// Where the monotonic clock stands at the first sample \[us\].
const EPOCH_US: u64 = 5_000_000;

/// A ring whose stamps are written by a fake clock: 100 us of execution per node, 20 us per wake-up.
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
    fn new() -> Self {
        let mut scenario = Scenario::default();
        scenario.mission.trajectory = TrajectoryKind::Hover;
        scenario.run.duration_s = 100.0;
        scenario.deadline.policy = Late::Skip;
        let d = &mut scenario.deadline;
        (d.plant_ms, d.guidance_ms, d.attitude_mpc_ms) = (Some(10.0), Some(10.0), Some(10.0));
        let timing = Timing::new(&scenario);
        let (count, happened) = (Count::default(), Happenings::default());
        Self {
            timing,
            count,
            now_us: 0,
            last: [Stamp::default(); 4],
            applied: (0, 0),
            cpu_us: 90,
            solve_us: 80,
            happened,
        }
    }

    /// A tick with nothing unusual, but for what `delay` adds to each node's (wake-up, execution) \[us\].
    fn turn(&mut self, tick: u64, delay: [(u64, u64); 4]) {
        self.now_us = tick * PERIOD_US;
        for (topic, (wake, execution)) in Topic::ALL.into_iter().zip(delay) {
            self.cycle(topic, tick, 20 + wake, 100 + execution, 0);
        }
        self.applied = (self.last[3].sequence, (self.now_us - tick * PERIOD_US) * US);
    }

    /// One cycle: due now, begun after `wake_us`, sent `execution_us` later, `slips` periods skipped before it.
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
                let mut state = State { stamp, applied_sequence, applied_age_ns, ..State::default() };
                state.actual.position_m = [0.25, 0.0, 0.0];
                state.with_checksum().into()
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

    fn node(&self, name: &str) -> Value {
        self.timing.to_json(&self.happened)["nodes"][name].clone()
    }

    fn worst(&self) -> Value {
        self.timing.to_json(&self.happened)["worst_ticks"][0].clone()
    }
}

const IN_TIME: [(u64, u64); 4] = [(0, 0); 4];

/// A figure is known to three digits.
fn near(figure: &Value, key: &str, us: f64) {
    let value = figure[key].as_f64().unwrap();
    assert!((value - us).abs() <= 1e-3 * us, "{key} of {figure}: {us}");
}

#[test]
fn a_ring_in_time_shows_its_parts_and_no_miss() {
    let mut ring = Ring::new();
    (0..10).for_each(|tick| ring.turn(tick, IN_TIME));
    near(&ring.node("plant")["jitter"], "max_us", 20.0);
    assert_eq!(ring.node("plant")["hop"], Value::Null, "the plant has no input");
    let mixer = ring.node("mixer");
    near(&mixer["hop"], "p50_us", 20.0);
    near(&mixer["execution"], "p50_us", 100.0);
    near(&mixer["input_age"], "p50_us", 380.0);
    near(&mixer["response"], "p50_us", 480.0);
    near(&mixer["cpu"], "p50_us", 90.0);
    assert_eq!(
        (&mixer["cpu"]["n"], &mixer["response"]["n"]),
        (&8.into(), &10.into()),
        "neither start-up nor the last cycle"
    );
    assert_eq!((ring.timing.misses(), &mixer["longest_run_of_misses"]), (0, &0.into()));
    assert_eq!(ring.worst()["cause"], "nothing stands out");
}

#[test]
fn a_clock_that_is_off_is_flagged_and_not_measured() {
    let mut ring = Ring::new();
    ring.turn(0, IN_TIME);
    assert_eq!(ring.timing.clocks.describe(), Vec::<String>::new());
    ring.turn(1, IN_TIME);
    // Controls says that it was sent 1 ms before the state that it was made from.
    ring.now_us = 2 * PERIOD_US;
    ring.cycle(Topic::State, 2, 20, 100, 0);
    let state = ring.last[Topic::State as usize];
    let mut stamp = Stamp { sequence: ring.last[2].sequence + 1, ..state };
    stamp.publish_ns[Topic::Controls as usize] = state.publish_ns[Topic::State as usize] - 1_000 * US;
    ring.send(Topic::Controls, stamp);
    // And the mixer that its command of tick 1 was sent 2 ms later than the plant says it came.
    ring.now_us = 3 * PERIOD_US;
    let mut stamp = Stamp { tick: 2, sequence: ring.last[3].sequence + 1, ..ring.last[3] };
    ring.applied = (stamp.sequence, 400 * US);
    stamp.sample_ns += PERIOD_US * US;
    stamp.publish_ns[Topic::Actuators as usize] = stamp.sample_ns + 2_400 * US;
    ring.send(Topic::Actuators, stamp);
    ring.cycle(Topic::State, 3, 20, 100, 0);
    let json = ring.timing.to_json(&ring.happened);
    assert_eq!(json["clock_contradictions"]["attitude-mpc"], 1);
    assert_eq!(json["clock_contradictions"]["mixer"], 1);
    assert_eq!(json["nodes"]["attitude-mpc"]["response"]["n"], 2, "the third is no figure");
}

#[test]
fn a_late_wake_is_jitter_and_an_early_one_is_none() {
    let mut ring = Ring::new();
    ring.turn(0, IN_TIME);
    ring.turn(1, [(3_000, 0), (0, 0), (0, 0), (0, 0)]);
    near(&ring.node("plant")["jitter"], "max_us", 3_020.0);
    near(&ring.node("mixer")["response"], "max_us", 3_480.0);
    near(&ring.node("mixer")["hop"], "max_us", 20.0);
    let mut early = ring.last[0];
    early.sequence += 1;
    early.start_ns = early.release_ns - 5 * US;
    ring.send(Topic::State, early);
    assert_eq!(ring.node("plant")["jitter"]["n"], 3);
    near(&ring.node("plant")["jitter"], "max_us", 3_020.0);
}

#[test]
fn skipped_slots_are_misses_and_each_has_its_response() {
    let mut ring = Ring::new();
    ring.turn(0, IN_TIME);
    ring.now_us = 4 * PERIOD_US; // the plant slept through three releases and is in time for the fourth
    ring.cycle(Topic::State, 4, 20, 100, 3);
    let plant = ring.node("plant");
    assert_eq!([&plant["slips"], &plant["misses"], &plant["late"]], [&3.into(), &3.into(), &Value::from(0)]);
    assert_eq!([&plant["response"]["n"], &plant["response_per_slot"]["n"]], [&2.into(), &Value::from(5)]);
    near(&plant["response"], "max_us", 120.0);
    near(&plant["response_per_slot"], "max_us", 30_120.0);
    assert_eq!(ring.worst()["tick"], 4, "charged to the tick that ended the stall");
    assert_eq!(ring.worst()["late_us"], 30_120.0);
    assert_eq!((&ring.worst()["node"], &ring.worst()["part"]), (&"plant".into(), &"jitter".into()));
}

#[test]
fn a_run_of_misses_goes_on_through_slips_and_ends_with_a_cycle_in_time() {
    let mut ring = Ring::new();
    let run = |ring: &Ring| ring.node("guidance")["longest_run_of_misses"].as_u64().unwrap();
    let mut tick = 0;
    let mut guidance = |ring: &mut Ring, execution_us, slips| {
        tick += 1 + slips;
        ring.now_us = tick * PERIOD_US;
        ring.cycle(Topic::Reference, tick, 20, execution_us, slips);
    };
    guidance(&mut ring, 100, 0);
    assert_eq!(run(&ring), 0);
    guidance(&mut ring, 12_000, 0); // late
    guidance(&mut ring, 12_000, 2); // two skipped, late again
    guidance(&mut ring, 100, 1); // one skipped, then in time
    assert_eq!(run(&ring), 5);
    guidance(&mut ring, 12_000, 0);
    assert_eq!(run(&ring), 5, "a run of one after it");
    assert_eq!(ring.node("guidance")["late"], 3);
    assert_eq!(ring.timing.misses(), 6);
}

#[test]
fn a_message_withheld_is_a_late_one_and_its_slot_stays_silent() {
    let mut ring = Ring::new();
    ring.turn(0, IN_TIME);
    ring.last[3].misses += 2; // two cycles came too late, and their messages were not sent
    ring.now_us = 3 * PERIOD_US;
    ring.cycle(Topic::Actuators, 3, 20, 100, 0);
    let mixer = ring.node("mixer");
    assert_eq!(["late", "withheld", "misses", "slips"].map(|key| mixer[key].as_u64().unwrap()), [2, 2, 2, 0]);
    assert_eq!((&mixer["longest_run_of_misses"], &mixer["policy"]), (&2.into(), &"skip".into()));
    assert_eq!((&mixer["response"]["n"], &mixer["response_per_slot"]["n"]), (&2.into(), &4.into()));
    near(&mixer["response_per_slot"], "max_us", 20_120.0);
    assert_eq!(mixer["cpu"]["n"], 0, "what the stamp tells is the CPU time of a cycle withheld");
    assert_eq!((&ring.worst()["tick"], &ring.worst()["node"]), (&3.into(), &"mixer".into()));
    assert_eq!(ring.worst()["cause"], "late messages were withheld, as the deadline's policy says");
}

#[test]
fn an_age_held_grows_by_a_period_per_slot() {
    let mut ring = Ring::new();
    (0..3).for_each(|tick| ring.turn(tick, IN_TIME));
    // Samples 3, 4 and 5 see the command of tick 2; then one comes that is 35 ms old.
    for tick in 3..6 {
        ring.now_us = tick * PERIOD_US;
        ring.cycle(Topic::State, tick, 20, 100, 0);
    }
    ring.applied = (9, 35_000 * US);
    ring.now_us = 6 * PERIOD_US;
    ring.cycle(Topic::State, 6, 20, 100, 0);
    let timing = ring.timing.to_json(&ring.happened);
    let [commands, slots] = [&timing["age_at_actuator"], &timing["age_at_actuator_per_slot"]];
    assert_eq!((&commands["n"], &slots["n"]), (&4.into(), &6.into()));
    near(commands, "p50_us", 480.0);
    near(slots, "p90_us", 35_000.0);
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
fn counters_begin_anew_with_another_epoch() {
    let mut ring = Ring::new();
    ring.now_us = 3 * PERIOD_US;
    ring.cycle(Topic::Actuators, 3, 20, 100, 3);
    ring.send(Topic::Actuators, Stamp { tick: 4, epoch: 2, sequence: 1, misses: 1, slips: 1, ..Stamp::default() });
    assert_eq!((ring.node("mixer")["slips"].as_u64(), ring.timing.misses()), (Some(4), 4));
}

#[test]
fn misses_of_a_standby_are_no_misses_of_the_flight() {
    let mut ring = Ring::new();
    let mut say = |tick: u64, epoch, delivery, slips| {
        let sample_ns = (EPOCH_US + tick * PERIOD_US) * US;
        let (start_ns, release_ns) = (sample_ns, sample_ns);
        let mut stamp = Stamp { tick, sample_ns, epoch, delivery, release_ns, start_ns, slips, ..Stamp::default() };
        (stamp.sequence, stamp.misses) = (tick + 1, slips);
        stamp.publish_ns[Topic::Actuators as usize] = sample_ns + 100 * US;
        ring.send(Topic::Actuators, stamp);
    };
    for tick in 0..4 {
        say(tick, 1, delivery::DELIVERED, 0);
        say(tick, 2, delivery::STANDBY, 3 * tick);
    }
    for tick in 4..8 {
        say(tick, 2, delivery::DELIVERED, 10); // one more than on standby
        say(tick, 1, delivery::STANDBY, tick);
    }
    say(8, 1, delivery::DELIVERED, 7); // active again
    let mixer = ring.node("mixer");
    assert_eq!(["slips", "misses"].map(|key| mixer[key].as_u64().unwrap()), [1, 1]);
    assert_eq!((&mixer["response"]["n"], &mixer["response_per_slot"]["n"]), (&9.into(), &10.into()));
    assert_eq!(mixer["cpu"]["n"], 2 + 3, "of cycles active, but for the first and the last of each time");
    assert_eq!((&ring.worst()["tick"], &ring.worst()["late_us"]), (&4.into(), &10_100.0.into()));
}
