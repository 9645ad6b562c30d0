//! The worst ticks of a flight: how late each was, as [`super`] defines it, and what made it late.
//!
//! A stall is charged to the tick that ended it; the ticks it swallowed are no entries of their own.
//!
//! The part of a tick that made it late is the one that took longest against the same part's median in this flight. The
//! parts of a chain add up to its response: each node's wait for an input that did not come, its wake-up (with the slots it
//! was silent before) and its execution. A node whose input came late is late through no part of its own, so the part named
//! is where the delay arose.
//!
//! What is known ([`crate::happenings`]) comes before what is inferred. The first rule that applies is told:
//!
//! | the part | and, from the stall before the tick to its last answer | likely cause |
//! |---|---|---|
//! | any | a node was without a process | it died or hung |
//! | any | within twice its median | nothing stands out |
//! | any | a fault acted that can delay the node | the fault |
//! | any | something happened to a process: death, start, swap | that |
//! | input | | its input did not come |
//! | wake-up | the deadline's policy kept messages back before it | withheld for being late |
//! | wake-up | the node was still at the cycle before when this one was due | the cycle before |
//! | wake-up | the node was asleep, using no CPU | not scheduled: preempted, stopped, or the host took the CPU |
//! | execution | the thread worked less than half of it | preempted while it ran, or waiting |
//! | execution | the thread worked, more than half of it inside the solver | the solver |
//! | execution | the thread worked | its own work |
//! | execution | no message followed that tells the CPU time | not known |

use contract::topic::NODES;
use contract::{Scenario, Topic};
use flight::log::Record;
use serde_json::{Map, Value, json};

use super::node::Cycle;
use crate::happenings::Happenings;
use crate::ticks::{Tick, Ticks};

const WORST: usize = 10;
/// So many of the newest ticks are kept, because messages of them may still come.
const OPEN_TICKS: usize = 2048;

/// A tick with one cycle per node, by topic.
pub type TimedTick = Tick<[Option<Cycle>; Topic::COUNT]>;

impl TimedTick {
    /// The longest wait of a slot for one of its messages \[ns\].
    pub fn late_ns(&self) -> u64 {
        let waits = self.of.iter().flatten().map(|cycle| cycle.wait_ns(self.sample_ns, self.period_ns));
        waits.max().unwrap_or(0)
    }

    /// From the last slot before the longest stall to the last answer, in simulated time \[s\].
    fn stretch_s(&self) -> [f64; 2] {
        let cycles = || self.of.iter().flatten();
        let silent = cycles().map(|cycle| cycle.silent).max().unwrap_or(0);
        let answered_ns = cycles().map(|cycle| cycle.publish_ns.saturating_sub(self.sample_ns)).max().unwrap_or(0);
        let period_s = self.period_ns as f64 / 1e9;
        let before = if silent == 0 { 0 } else { silent + 1 };
        [self.number.saturating_sub(before) as f64 * period_s, self.time_s() + answered_ns as f64 / 1e9]
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
        let named = NODES.iter().zip(&self.of);
        let nodes: Map<_, _> =
            named.filter_map(|(name, cycle)| Some(((*name).into(), node(cycle.as_ref()?)))).collect();
        json!({
            "tick": self.number,
            "time_s": self.time_s(),
            "late_us": self.late_ns() as f64 / 1e3,
            "node": culprit.node(),
            "part": culprit.part.name(),
            "part_us": culprit.part_ns as f64 / 1e3,
            "cause": culprit.cause,
            "in_words": culprit.describe(),
            "known": culprit.known,
            "position_error_m": self.distance_m(),
            "nodes": nodes,
        })
    }
}

/// Gathers ticks and keeps the worst.
pub struct WorstTicks {
    ticks: Ticks<[Option<Cycle>; Topic::COUNT]>,
    newest: [u64; Topic::COUNT],
}

impl WorstTicks {
    pub fn new(scenario: &Scenario) -> Self {
        Self { ticks: Ticks::new(scenario), newest: [0; Topic::COUNT] }
    }

    /// Takes one message in, with what its stamp says of the cycle.
    pub fn observe(&mut self, record: &Record, cycle: Cycle) {
        let own = record.topic() as usize;
        let before = std::mem::replace(&mut self.newest[own], record.stamp().tick);
        if let Some(cpu_ns) = cycle.cpu_before_ns
            && let Some(cycle) = self.ticks.get_mut(before).and_then(|tick| tick.of[own].as_mut())
        {
            cycle.cpu_ns = Some(cpu_ns);
        }
        self.ticks.observe(record, |of| of[own] = Some(cycle));
        if self.ticks.count() > 2 * OPEN_TICKS {
            let oldest = self.ticks.iter().rev().nth(OPEN_TICKS).map_or(0, |tick| tick.number);
            let worst = worst_of(self.ticks.iter().filter(|tick| tick.number <= oldest));
            self.ticks.retain(|tick| tick.number > oldest || worst.iter().any(|worst| worst.number == tick.number));
        }
    }

    pub fn worst(&self) -> Vec<TimedTick> {
        worst_of(self.ticks.iter())
    }
}

fn worst_of<'a>(ticks: impl Iterator<Item = &'a TimedTick>) -> Vec<TimedTick> {
    let mut ticks: Vec<TimedTick> = ticks.copied().collect();
    ticks.sort_by_key(|tick| std::cmp::Reverse(tick.late_ns()));
    ticks.truncate(WORST);
    ticks
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// From the publication of the node before to its own release, which is its patience when nothing came.
    Input,
    /// From the plant's release to its start.
    Jitter,
    /// From the input's publication to the start.
    Hop,
    /// From start to publication.
    Execution,
}

impl Part {
    pub fn name(self) -> &'static str {
        match self {
            Self::Input => "wait for its input",
            Self::Jitter => "jitter",
            Self::Hop => "hop",
            Self::Execution => "execution",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Culprit {
    pub topic: Topic,
    pub part: Part,
    /// How long that took, silent slots included \[ns\].
    pub part_ns: u64,
    /// Its CPU time, where it is known and counts \[ns\].
    pub cpu_ns: Option<u64>,
    /// Likely cause, by the rules above.
    pub cause: &'static str,
    /// The faults, absences and events that the cause stands for, and what else is known of that time.
    pub known: Vec<String>,
}

impl Culprit {
    pub fn node(&self) -> &'static str {
        self.topic.publisher()
    }

    pub fn describe(&self) -> String {
        let ms = |ns: u64| ns as f64 / 1e6;
        let cpu = self.cpu_ns.map_or(String::new(), |ns| format!(" on {:.2} ms of CPU", ms(ns)));
        let (node, part) = (self.node(), self.part.name());
        let known = self.known.iter().take(3).cloned().collect::<Vec<_>>().join("; ");
        let cause = match self.known.len() {
            0 => self.cause.to_owned(),
            1..=3 => known,
            count => format!("{known}; {} more", count - 3),
        };
        format!("{node}: {part} of {:.2} ms{cpu}: {cause}", ms(self.part_ns))
    }
}

/// Finds what made `tick` late; `usual` holds every node's median wake-up and execution \[ns\].
pub fn culprit(tick: &TimedTick, usual: &[[u64; 2]; Topic::COUNT], happened: &Happenings) -> Option<Culprit> {
    let parts = Topic::ALL.into_iter().filter_map(|topic| {
        let cycle = tick.of[topic as usize].as_ref()?;
        let wake = if topic == Topic::State { Part::Jitter } else { Part::Hop };
        let [usual_wake, usual_execution] = usual[topic as usize];
        let silent_ns = cycle.silent.saturating_mul(tick.period_ns);
        let before = Topic::ALL[..topic as usize].iter().rev().find_map(|before| tick.of[*before as usize]);
        let sent_ns = before.map_or(tick.sample_ns, |before| before.publish_ns);
        Some([
            (topic, cycle, Part::Input, cycle.release_ns.saturating_sub(sent_ns), 0),
            (topic, cycle, wake, cycle.wake_ns().saturating_add(silent_ns), usual_wake),
            (topic, cycle, Part::Execution, cycle.execution_ns(), usual_execution),
        ])
    });
    let longest = parts.flatten().max_by_key(|(.., part_ns, usual_ns)| part_ns.saturating_sub(*usual_ns));
    longest.map(|(topic, cycle, part, part_ns, usual_ns)| {
        let [from_s, to_s] = tick.stretch_s();
        let causes = happened.causes(topic, from_s, to_s);
        let [fault, absence, event] = causes.each_ref().map(|known| !known.is_empty());
        let cpu_ns = cycle.cpu_ns.filter(|_| part == Part::Execution);
        let of = |cause| Culprit { topic, part, part_ns, cpu_ns, cause, known: causes.concat() };
        if absence {
            of("a process died or hung")
        } else if part_ns <= 2 * usual_ns {
            Culprit { known: vec![], ..of("nothing stands out") }
        } else if fault {
            of("a fault acted")
        } else if event {
            of("a process died, started or was replaced")
        } else {
            of(infer(cycle, part, topic))
        }
    })
}

/// The cause by the rules for the part.
fn infer(cycle: &Cycle, part: Part, topic: Topic) -> &'static str {
    let half_ns = cycle.execution_ns() / 2;
    match (part, cycle.cpu_ns) {
        (Part::Input, _) => "its input did not come",
        (Part::Jitter | Part::Hop, _) if cycle.withheld > 0 => {
            "late messages were withheld, as the deadline's policy says"
        }
        (Part::Jitter | Part::Hop, _) if cycle.free_ns > cycle.release_ns => "the cycle before was not over",
        (Part::Jitter | Part::Hop, _) => "not scheduled (preempted, stopped, or the host took the CPU)",
        (Part::Execution, None) => "CPU time not known",
        (Part::Execution, Some(cpu_ns)) if cpu_ns < half_ns => "preempted while it ran",
        (Part::Execution, Some(_)) if topic == Topic::Controls && cycle.solve_ns > half_ns => "the solver",
        (Part::Execution, Some(_)) => "its own work",
    }
}
