//! The worst ticks of a flight: how late each was, as [`super`] defines it, and why.
//!
//! A stall is charged to the tick that ended it; the ticks it covered have no entries.
//!
//! The part of a tick that made it late is the part that exceeded its own median in this flight by the most. The parts
//! of a chain add up to its response: each node's wait for an input that did not come, its wake-up (including the slots
//! that the node was silent before) and its execution. A node whose input came late has no late part of its own, so the
//! part named is where the delay arose.
//!
//! Known causes ([`crate::happenings`]) come before inferred ones. The first rule that applies gives the cause:
//!
//! | part | condition, between the stall before the tick and its last answer | likely cause |
//! |---|---|---|
//! | any | a node was without a process | it died or hung |
//! | any | the part took at most twice its median | nothing stands out |
//! | any | a fault acted that can delay the node | the fault |
//! | any | a process died, started or was swapped | the event |
//! | input | | its input did not come |
//! | wake-up | the deadline's policy kept messages back before it | withheld for being late |
//! | wake-up | the node was still at the cycle before when this one was due | the cycle before |
//! | wake-up | none of these: the node slept, using no CPU | not scheduled: preempted, stopped, or the host took the CPU |
//! | execution | the thread used the CPU for less than half of the execution | preempted while it ran, or waiting |
//! | execution | the thread used the CPU, more than half of it inside the solver | the solver |
//! | execution | the thread used the CPU | its own work |
//! | execution | no message followed that tells the CPU time | not known |

use std::collections::BTreeMap;

use contract::Topic;
use contract::message::Truth;
use contract::topic::NODES;
use flight::log::Record;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::Scenario;

use super::node::{TimedCycle, wake_name};
use crate::happenings::Happenings;
use crate::ticks::{Tick, Ticks};

const WORST: usize = 10;
/// Number of the newest ticks that are kept, because messages of them may still come.
const OPEN_TICKS: usize = 2048;

/// Gathers ticks and keeps the worst.
pub struct WorstTicks {
    ticks: Ticks<[Option<TimedCycle>; Topic::COUNT]>,
    newest: [u64; Topic::COUNT],
}

impl WorstTicks {
    pub fn new(scenario: &Scenario) -> Self {
        Self { ticks: Ticks::new(scenario), newest: [0; Topic::COUNT] }
    }

    /// Takes in a TRUTH.
    pub fn truth(&mut self, truth: &Truth) {
        self.ticks.observe(&(*truth).into(), |_| {});
    }

    /// Takes in a message, with the cycle that its stamp tells.
    pub fn observe(&mut self, record: &Record, cycle: TimedCycle) {
        let Some((topic, stamp)) = record.stamped() else { return };
        let own = topic as usize;
        let before = std::mem::replace(&mut self.newest[own], stamp.tick);
        if let Some(cpu_ns) = cycle.cpu_before_ns
            && let Some(cycle) = self.ticks.by_number.get_mut(&before).and_then(|tick| tick.of[own].as_mut())
        {
            cycle.cpu_ns = Some(cpu_ns);
        }
        self.ticks.observe(record, |of| of[own] = Some(cycle));
        let ticks = &mut self.ticks.by_number;
        if ticks.len() > 2 * OPEN_TICKS {
            let oldest = ticks.values().rev().nth(OPEN_TICKS).map_or(0, |tick| tick.number);
            let worst = worst_of(ticks.values().filter(|tick| tick.number <= oldest));
            ticks.retain(|number, _| *number > oldest || worst.iter().any(|worst| worst.number == *number));
        }
    }

    /// Returns the worst ticks, the worst first, each with its cause; `usual` holds every node's median wake-up and
    /// execution \[ns\].
    pub fn explained(&self, usual: &[[u64; 2]; Topic::COUNT], happened: &Happenings) -> Vec<WorstTick> {
        worst_of(self.ticks.by_number.values()).iter().filter_map(|tick| tick.explained(usual, happened)).collect()
    }
}

fn worst_of<'a>(ticks: impl Iterator<Item = &'a TimedTick>) -> Vec<TimedTick> {
    let mut ticks: Vec<TimedTick> = ticks.copied().collect();
    ticks.sort_by_key(|tick| std::cmp::Reverse(tick.late_ns()));
    ticks.truncate(WORST);
    ticks
}

/// Parts of a tick besides the wake-up, whose name depends on the node.
pub const INPUT: &str = "wait for its input";
pub const EXECUTION: &str = "execution";

/// One of the worst ticks, as run.json has it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstTick {
    /// Number of the tick.
    pub tick: u64,
    /// Time of its sample \[s\].
    pub time_s: f64,
    /// Lateness of the tick \[us\].
    pub late_us: f64,
    /// Node where the delay arose.
    pub node: String,
    /// Part of that node's cycle.
    pub part: String,
    /// Duration of that part, silent slots included \[us\].
    pub part_us: f64,
    /// Likely cause.
    pub cause: String,
    /// Cause in words.
    pub in_words: String,
    /// Faults, absences and events of that time, if the cause is one of them; else empty.
    pub known: Vec<String>,
    /// Euclidean position error at that sample \[m\]; null if it was not seen.
    pub position_error_m: Option<f64>,
    /// Cycle of each node that had one.
    pub nodes: BTreeMap<String, CycleRecord>,
}

/// One node's cycle in one of the worst ticks. Times count from the sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CycleRecord {
    /// Time at which the cycle was due \[us\].
    pub release_us: f64,
    /// Start of the cycle \[us\].
    pub start_us: f64,
    /// Send \[us\].
    pub publish_us: f64,
    /// CPU time of the cycle \[us\]; null if it is not known.
    pub cpu_us: Option<f64>,
    /// Periods without a cycle before this one.
    pub slips: u64,
    /// Messages before this one that were late and not sent.
    pub withheld: u64,
    /// Slots before this one without a message.
    pub silent: u64,
}

/// A tick with one cycle per node, by topic.
type TimedTick = Tick<[Option<TimedCycle>; Topic::COUNT]>;

impl TimedTick {
    /// Returns the lateness of the tick: the longest [`TimedCycle::wait_ns`] of its cycles \[ns\]; 0 without cycles.
    fn late_ns(&self) -> u64 {
        let waits = self.of.iter().flatten().map(|cycle| cycle.wait_ns(self.sample_ns, self.period_ns));
        waits.max().unwrap_or(0)
    }

    /// Returns the span in which causes are searched, in time of the flight \[s\]: from the slot before the longest
    /// stall to the last answer.
    fn stretch_s(&self) -> [f64; 2] {
        let cycles = || self.of.iter().flatten();
        let silent = cycles().map(|cycle| cycle.silent).max().unwrap_or(0);
        let answered_ns = cycles().map(|cycle| cycle.publish_ns.saturating_sub(self.sample_ns)).max().unwrap_or(0);
        let period_s = self.period_ns as f64 / 1e9;
        let before = if silent == 0 { 0 } else { silent + 1 };
        [self.number.saturating_sub(before) as f64 * period_s, self.time_s() + answered_ns as f64 / 1e9]
    }

    /// Finds the part that made the tick late, and its cause; `None` for a tick without cycles.
    fn explained(&self, usual: &[[u64; 2]; Topic::COUNT], happened: &Happenings) -> Option<WorstTick> {
        let parts = Topic::ALL.into_iter().filter_map(|topic| {
            let cycle = self.of[topic as usize].as_ref()?;
            let [usual_wake, usual_execution] = usual[topic as usize];
            let silent_ns = cycle.silent.saturating_mul(self.period_ns);
            let before = self.of[..topic as usize].iter().flatten().next_back();
            let sent_ns = before.map_or(self.sample_ns, |before| before.publish_ns);
            Some([
                (topic, cycle, INPUT, cycle.release_ns.saturating_sub(sent_ns), 0),
                (topic, cycle, wake_name(topic), cycle.wake_ns().saturating_add(silent_ns), usual_wake),
                (topic, cycle, EXECUTION, cycle.execution_ns(), usual_execution),
            ])
        });
        let longest = parts.flatten().max_by_key(|(.., part_ns, usual_ns)| part_ns.saturating_sub(*usual_ns));
        let (topic, cycle, part, part_ns, usual_ns) = longest?;
        let [from_s, to_s] = self.stretch_s();
        let causes = happened.causes(topic, from_s, to_s);
        let [fault, absence, event] = causes.each_ref().map(|known| !known.is_empty());
        let (cause, known) = if absence {
            ("a process died or hung", causes.concat())
        } else if part_ns <= 2 * usual_ns {
            ("nothing stands out", vec![])
        } else if fault {
            ("a fault acted", causes.concat())
        } else if event {
            ("a process died, started or was replaced", causes.concat())
        } else {
            (infer(cycle, part, topic), vec![])
        };
        let ms = |ns: u64| ns as f64 / 1e6;
        let cpu_ns = cycle.cpu_ns.filter(|_| part == EXECUTION);
        let cpu = cpu_ns.map_or(String::new(), |ns| format!(" on {:.2} ms of CPU", ms(ns)));
        let first = known.iter().take(3).cloned().collect::<Vec<_>>().join("; ");
        let why = match known.len() {
            0 => cause.to_owned(),
            1..=3 => first,
            count => format!("{first}; {} more", count - 3),
        };
        let node = topic.publisher();
        let named = NODES.iter().zip(&self.of);
        Some(WorstTick {
            tick: self.number,
            time_s: self.time_s(),
            late_us: self.late_ns() as f64 / 1e3,
            node: node.into(),
            part: part.into(),
            part_us: part_ns as f64 / 1e3,
            cause: cause.into(),
            in_words: format!("{node}: {part} of {:.2} ms{cpu}: {why}", ms(part_ns)),
            known,
            position_error_m: self.distance_m(),
            nodes: named.filter_map(|(name, cycle)| Some(((*name).into(), self.cycle(cycle.as_ref()?)))).collect(),
        })
    }

    /// Converts a cycle of the tick to its entry in run.json.
    fn cycle(&self, cycle: &TimedCycle) -> CycleRecord {
        let from_sample = |ns: u64| ns.saturating_sub(self.sample_ns) as f64 / 1e3;
        CycleRecord {
            release_us: from_sample(cycle.release_ns),
            start_us: from_sample(cycle.start_ns),
            publish_us: from_sample(cycle.publish_ns),
            cpu_us: cycle.cpu_ns.map(|ns| ns as f64 / 1e3),
            slips: cycle.slips,
            withheld: cycle.withheld,
            silent: cycle.silent,
        }
    }
}

/// Infers the cause by the rules for the part.
fn infer(cycle: &TimedCycle, part: &str, topic: Topic) -> &'static str {
    let half_ns = cycle.execution_ns() / 2;
    match (part, cycle.cpu_ns) {
        (INPUT, _) => "its input did not come",
        (EXECUTION, None) => "CPU time not known",
        (EXECUTION, Some(cpu_ns)) if cpu_ns < half_ns => "preempted while it ran",
        (EXECUTION, Some(_)) if topic == Topic::Controls && cycle.solve_ns > half_ns => "the solver",
        (EXECUTION, Some(_)) => "its own work",
        _ if cycle.withheld > 0 => "late messages were withheld, as the deadline's policy says",
        _ if cycle.free_ns > cycle.release_ns => "the cycle before was not over",
        _ => "not scheduled (preempted, stopped, or the host took the CPU)",
    }
}
