//! Flights with many swaps: twenty good candidates of each node, or wrong ones.
//!
//! The good candidates come in the survey; every other good candidate has different settings. The wrong candidates come
//! in the gusts. Each wrong candidate fails either on standby or, if it gets that far, while active, in one of these
//! ways:
//!
//! | way | its answers |
//! |---|---|
//! | garbage | numbers that are not finite, with a correct checksum |
//! | drop | none |
//! | wrong | finite and plausible, times -1 |
//! | slow | 30 ms late |
//! | exit | none, because the process has ended |
//!
//! Both are flown in lockstep, where a flight by one thread must be equal, and in real time, where `slow` takes real
//! time and `exit` is a crash.

use std::sync::atomic::AtomicU32;

use contract::Scenario;
use contract::scenario::{Mode, Swap, SwapNode};
use contract::topic::Topic;
use serde::Serialize;

use super::case::hover_in_gusts;
use super::one_flight::lean_deg;
use crate::flights::{in_process, through_processes};
use crate::timing::canary::{Canary, LONGEST};
use flight::event::{Event, What};
use flight::log::Record;
use outcome::faults::reacts;
use outcome::ticks::{Tick, Ticks};

/// Nodes in the order of their swaps, with their topics and the settings of every other good candidate.
const NODES: [(SwapNode, Topic, &str); 3] = [
    (SwapNode::Guidance, Topic::Reference, "guidance.disturbance_observer_radps=4.0"),
    (SwapNode::AttitudeMpc, Topic::Controls, "attitude.law=\"lqr\""),
    (SwapNode::Mixer, Topic::Actuators, "mixer.projection=true"),
];
/// Faults of the wrong candidates: of the topic or of the process.
const WAYS: [(FaultTargetOf, &str); 5] = [
    (Topic::name, "kind=\"garbage\""),
    (Topic::name, "kind=\"drop\", probability=1.0"),
    (Topic::name, "kind=\"wrong\", how=\"sign\""),
    (Topic::publisher, "kind=\"slow\", ms=30.0"),
    (Topic::publisher, "kind=\"exit\""),
];
/// Returns the target of a fault, for the publisher of a topic.
type FaultTargetOf = fn(Topic) -> &'static str;
/// Number of good candidates of each node in a full run.
pub const ROUNDS: usize = 20;
/// Time at which the first swap begins \[s\].
const FIRST_S: f64 = 1.0;
/// Duration of standby of a good candidate, and interval between two swaps \[s\].
const GOOD_S: (f64, f64) = (0.1, 0.4);
/// Duration and interval for wrong candidates, long enough for the error to show \[s\].
const WRONG_S: (f64, f64) = (0.2, 1.0);
/// Pause between the end of a swap and the next one \[s\].
const REST_S: f64 = 0.1;
/// Delay from the beginning of a swap until its candidate fails: on standby, or active. Leaves time to start \[s\].
const WRONG_AFTER_S: [f64; 2] = [0.15, 0.4];
/// Interval between two gusts \[s\].
const GUST_S: f64 = 2.0;

/// One flight in which the nodes are swapped in turn.
#[derive(Debug, Clone, Serialize)]
pub struct Relay {
    pub good: bool,
    pub mode: Mode,
    pub swaps: usize,
    pub kept: usize,
    /// Candidates rejected on standby, with reasons.
    pub rejected: Vec<String>,
    /// Candidates removed while active, with reasons.
    pub returned: Vec<String>,
    /// Number of ticks on which a node did not send exactly one message from fresh inputs.
    pub lost_ticks: usize,
    /// Number of lost ticks during which a canary was delayed.
    pub explained: usize,
    /// Largest true roll or pitch \[deg\].
    pub tilt_deg: f64,
    /// Largest distance from the trajectory \[m\].
    pub position_error_m: f64,
    pub diverged: bool,
    /// Reason why a candidate that was late cannot be judged, if so; `None` in lockstep.
    pub doubt: Option<String>,
    /// `true` if the flight by one thread was equal; `None` in real time.
    pub same: Option<bool>,
}

/// Answers to one sample.
#[derive(Clone, Copy, Default)]
struct Answers {
    delivered: [u32; Topic::COUNT],
    /// `true` if a node worked without an input that it should have.
    reacted: bool,
}

impl Relay {
    /// Flies `rounds` good candidates of each node and every wrong one, in lockstep and in real time.
    pub fn fly_all(rounds: usize, interrupts: &AtomicU32) -> anyhow::Result<Vec<Self>> {
        let flights = [(true, good_candidates(rounds)), (false, wrong_candidates(hover_in_gusts()?))];
        let modes = [Mode::Lockstep, Mode::Realtime].into_iter();
        let each = modes.flat_map(|mode| flights.clone().map(|(good, scenario)| (good, scenario, mode)));
        each.map(|(good, scenario, mode)| Self::fly(good, scenario, mode, interrupts)).collect()
    }

    fn fly(good: bool, mut scenario: Scenario, mode: Mode, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        scenario.run.mode = Mode::Inprocess;
        let alone = (mode == Mode::Lockstep).then(|| in_process(&scenario, |_| {}).0.state_hash());
        scenario.run.mode = mode;
        let canary = if mode == Mode::Realtime { Some(Canary::start(LONGEST)?) } else { None };
        let mut tilt_deg = 0.0_f64;
        let mut ticks = Ticks::<Answers>::new(&scenario);
        let (summary, flown) = through_processes(&scenario, interrupts, |record| {
            if let Record::Truth(truth) = record {
                tilt_deg = tilt_deg.max(lean_deg(truth));
            } else {
                ticks.observe(record, |answers| answers.observe(record));
            }
        })?;
        let host = canary.map(Canary::stop).transpose()?;
        let doubt = host.as_ref().and_then(|host| host.summary().doubt);
        let host = host.unwrap_or_default();
        let tick = |time_s: f64| (time_s / scenario.sample_s()) as u64;
        let counted = tick(FIRST_S)..tick(scenario.run.duration_s - REST_S);
        let lost = || ticks.by_number.values().filter(|tick| counted.contains(&tick.number) && tick.of.is_lost());
        let is_explained = |tick: &&Tick<_>| host.explains(tick.sample_ns, tick.sample_ns + 2 * scenario.sample_ns());
        let ended = |what| flown.how.events.iter().filter(move |event| event.what == what);
        let reason = |event: &Event| format!("{}: {}", event.node, event.why.as_deref().unwrap_or_default());
        Ok(Self {
            good,
            mode,
            swaps: scenario.swap.len(),
            kept: ended(What::Kept).count(),
            rejected: ended(What::Rejected).map(reason).collect(),
            returned: ended(What::Returned).map(reason).collect(),
            lost_ticks: lost().count(),
            explained: lost().filter(is_explained).count(),
            tilt_deg,
            position_error_m: summary.metrics().max_position_error_m,
            diverged: summary.status().diverged(),
            doubt,
            same: alone.map(|alone| alone.is_some() && alone == summary.state_hash()),
        })
    }
}

/// Returns the survey with `rounds` good candidates of each node.
fn good_candidates(rounds: usize) -> Scenario {
    let mut swaps = vec![];
    for round in 0..rounds {
        for (node, _, other) in NODES {
            let set = if round % 2 == 1 { vec![other.to_owned()] } else { vec![] };
            swaps.push(swap(swaps.len(), GOOD_S, node, set));
        }
    }
    with_swaps(Scenario::default(), swaps)
}

/// Returns the gusts, repeated, with a candidate of every node that fails in every way, on standby and active.
fn wrong_candidates(mut gusts: Scenario) -> Scenario {
    let mut swaps = vec![];
    for ((target, fault), after_s) in WAYS.into_iter().flat_map(|way| WRONG_AFTER_S.map(|after_s| (way, after_s))) {
        for (node, topic, _) in NODES {
            let at_s = begins_s(swaps.len(), WRONG_S) + after_s;
            let set = format!("fault=[{{at_s={at_s:?}, target=\"{}\", {fault}}}]", target(topic));
            swaps.push(swap(swaps.len(), WRONG_S, node, vec![set]));
        }
    }
    let gust = gusts.plant.wind_ned_mps.split_off(1); // the first entry is the steady wind
    for i in 1..(begins_s(swaps.len(), WRONG_S) / GUST_S) as usize {
        let later_s = FIRST_S + GUST_S * i as f64 - gust[0].0;
        gusts.plant.wind_ned_mps.extend(gust.iter().map(|(at_s, wind_mps)| (at_s + later_s, *wind_mps)));
    }
    with_swaps(gusts, swaps)
}

fn begins_s(i: usize, (_, apart_s): (f64, f64)) -> f64 {
    FIRST_S + apart_s * i as f64
}

/// Returns swap number `i`, with standby and interval in `times_s`.
fn swap(i: usize, times_s: (f64, f64), node: SwapNode, set: Vec<String>) -> Swap {
    let (standby_s, apart_s) = times_s;
    Swap { set, standby_s, watch_s: apart_s - standby_s - REST_S, ..Swap::new(node, begins_s(i, times_s)) }
}

fn with_swaps(mut scenario: Scenario, swaps: Vec<Swap>) -> Scenario {
    let end_s = swaps.last().map_or(0.0, |last| last.at_s + last.standby_s + last.watch_s);
    scenario.run.duration_s = (end_s + 1.0).ceil();
    scenario.swap = swaps;
    scenario
}

impl Answers {
    fn observe(&mut self, record: &Record) {
        if let Some((topic, stamp)) = record.stamped()
            && stamp.is_delivered()
        {
            self.delivered[topic as usize] += 1;
            self.reacted |= reacts(record);
        }
    }

    fn is_lost(&self) -> bool {
        self.reacted || self.delivered != [1; Topic::COUNT]
    }
}
