//! The worst ticks of a flight: how late each was, as [`super`] defines it.
//!
//! A stall is charged to the tick that ended it; the ticks it swallowed are no entries of their own.

use std::collections::BTreeMap;

use contract::Topic;
use contract::topic::NODES;
use serde_json::{Map, Value, json};

use super::cause::Culprit;
use super::node::Cycle;
use flight::log::Record;

/// How many are told.
const WORST: usize = 10;
/// A tick is judged when it is so many ticks old, or at the end.
const OPEN_TICKS: usize = 2048;

/// What is known of one tick.
#[derive(Debug, Clone, Copy)]
pub struct Tick {
    /// Its number.
    pub number: u64,
    /// Period of the ring \[ns\].
    pub period_ns: u64,
    /// The instant the sample stands for \[ns\].
    pub sample_ns: u64,
    /// Position error at the sample \[m\].
    pub position_error_m: Option<f64>,
    /// One cycle per node, by topic.
    pub cycles: [Option<Cycle>; Topic::COUNT],
    /// Time inside the constrained solver \[ns\].
    pub solve_ns: u64,
}

impl Tick {
    /// See the definition \[ns\].
    pub fn late_ns(&self) -> u64 {
        let waits = self.cycles.iter().flatten().map(|cycle| cycle.wait_ns(self.sample_ns, self.period_ns));
        waits.max().unwrap_or(0)
    }

    /// From the last slot before the longest stall to the last answer, in simulated time \[s\].
    pub fn stretch_s(&self) -> [f64; 2] {
        let cycles = || self.cycles.iter().flatten();
        let silent = cycles().map(|cycle| cycle.silent).max().unwrap_or(0);
        let answered_ns = cycles().map(|cycle| cycle.publish_ns.saturating_sub(self.sample_ns)).max().unwrap_or(0);
        let period_s = self.period_ns as f64 / 1e9;
        let before = if silent == 0 { 0 } else { silent + 1 };
        [self.number.saturating_sub(before) as f64 * period_s, self.time_s() + answered_ns as f64 / 1e9]
    }

    /// Simulated time of the sample \[s\].
    pub fn time_s(&self) -> f64 {
        self.number as f64 * self.period_ns as f64 / 1e9
    }

    /// Its entry in run.json; times of the nodes count from the sample.
    pub fn to_json(self, culprit: &Culprit) -> Value {
        let from_sample = |ns: u64| ns.saturating_sub(self.sample_ns) as f64 / 1e3;
        let node = |cycle: &Cycle| {
            json!({
                "release_us": from_sample(cycle.release_ns),
                "start_us": from_sample(cycle.start_ns),
                "publish_us": from_sample(cycle.publish_ns),
                "cpu_us": cycle.cpu_ns.map(|ns| ns as f64 / 1e3),
                "slips": cycle.slips,
                "withheld": cycle.withheld,
                "silent": cycle.silent,
            })
        };
        let named = NODES.iter().zip(&self.cycles);
        let nodes: Map<_, _> =
            named.filter_map(|(name, cycle)| Some(((*name).into(), node(cycle.as_ref()?)))).collect();
        json!({
            "tick": self.number,
            "time_s": self.time_s(),
            "late_us": self.late_ns() as f64 / 1e3,
            "node": culprit.node(),
            "part": culprit.part.name(),
            "part_us": culprit.part_ns as f64 / 1e3,
            "cause": culprit.cause.name(),
            "in_words": culprit.describe(),
            "known": culprit.known,
            "position_error_m": self.position_error_m,
            "nodes": nodes,
        })
    }
}

/// Gathers ticks and keeps the worst.
pub struct Ticks {
    period_ns: u64,
    open: BTreeMap<u64, Tick>,
    worst: Vec<Tick>,
    /// The newest tick of each node.
    newest: [u64; Topic::COUNT],
}

impl Ticks {
    /// None yet.
    pub fn new(period_ns: u64) -> Self {
        Self { period_ns, open: BTreeMap::new(), worst: vec![], newest: [0; Topic::COUNT] }
    }

    /// Takes one message in, with what its stamp says of the cycle.
    pub fn observe(&mut self, record: &Record, cycle: Cycle, position_error_m: f64) {
        let (stamp, own) = (record.stamp(), record.topic() as usize);
        let before = self.newest[own];
        if let Some(cpu_ns) = cycle.cpu_before_ns
            && let Some(cycle) = self.known(before).and_then(|tick| tick.cycles[own].as_mut())
        {
            cycle.cpu_ns = Some(cpu_ns);
        }
        self.newest[own] = stamp.tick;
        if self.known(stamp.tick).is_none() {
            self.open.insert(stamp.tick, self.unanswered(stamp.tick, stamp.sample_ns));
        }
        if let Some(tick) = self.known(stamp.tick) {
            tick.cycles[own] = Some(cycle);
            match record {
                Record::State(_) => tick.position_error_m = Some(position_error_m),
                Record::Controls(controls) => tick.solve_ns = controls.solve_ns,
                Record::Reference(_) | Record::Actuators(_) => {}
            }
        }
        while self.open.len() > OPEN_TICKS
            && let Some((_, oldest)) = self.open.pop_first()
        {
            self.worst = worst_of(self.worst.iter().copied().chain([oldest]));
        }
    }

    /// The worst so far, the worst first.
    pub fn worst(&self) -> Vec<Tick> {
        worst_of(self.worst.iter().chain(self.open.values()).copied())
    }

    fn known(&mut self, tick: u64) -> Option<&mut Tick> {
        let judged = self.worst.iter_mut().find(|known| known.number == tick);
        judged.or_else(|| self.open.get_mut(&tick))
    }

    fn unanswered(&self, tick: u64, sample_ns: u64) -> Tick {
        let cycles = [None; Topic::COUNT];
        Tick { number: tick, period_ns: self.period_ns, sample_ns, position_error_m: None, cycles, solve_ns: 0 }
    }
}

fn worst_of(ticks: impl Iterator<Item = Tick>) -> Vec<Tick> {
    let mut ticks: Vec<Tick> = ticks.collect();
    ticks.sort_by_key(|tick| std::cmp::Reverse(tick.late_ns()));
    ticks.truncate(WORST);
    ticks
}
