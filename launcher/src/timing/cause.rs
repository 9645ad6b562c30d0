//! What made a tick late: the part of its way that took longest against the same part's median in this flight.
//!
//! The parts of a chain add up to its response: each node's wake-up (with the slots it was silent before) and execution.
//! A node whose input came late is late through no part of its own, so the part named is where the delay arose.
//!
//! | the part | and | likely cause |
//! |---|---|---|
//! | any | within twice its median | nothing stands out |
//! | wake-up | the deadline's policy kept messages back before it | withheld for being late |
//! | wake-up | the node was still at the cycle before when this one was due | the cycle before |
//! | wake-up | the node was asleep, using no CPU | not scheduled: preempted, stopped, or the host took the CPU |
//! | execution | the thread worked less than half of it | preempted while it ran, or waiting |
//! | execution | the thread worked, more than half of it inside the solver | the solver |
//! | execution | the thread worked | its own work |
//! | execution | no message followed that tells the CPU time | not known |

use contract::Topic;

use super::node::Cycle;
use super::ticks::Tick;

/// Part of a node's cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// From the plant's release to its start.
    Jitter,
    /// From the input's publication to the start.
    Hop,
    /// From start to publication.
    Execution,
}

impl Part {
    /// As in run.json.
    pub fn name(self) -> &'static str {
        match self {
            Self::Jitter => "jitter",
            Self::Hop => "hop",
            Self::Execution => "execution",
        }
    }
}

/// Likely cause, by the rules above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// Nothing stands out.
    Ordinary,
    /// Late messages were not sent.
    Withheld,
    /// The cycle before was not over.
    CycleBefore,
    /// The process was due and did not run.
    NotScheduled,
    /// The process had begun and was not let go on.
    Preempted,
    /// The constrained solver.
    Solver,
    /// The node's own work.
    OwnWork,
    /// The CPU time is not known.
    Unknown,
}

impl Cause {
    /// For people and programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ordinary => "nothing stands out",
            Self::Withheld => "late messages were withheld, as the deadline's policy says",
            Self::CycleBefore => "the cycle before was not over",
            Self::NotScheduled => "not scheduled (preempted, stopped, or the host took the CPU)",
            Self::Preempted => "preempted while it ran",
            Self::Solver => "the solver",
            Self::OwnWork => "its own work",
            Self::Unknown => "CPU time not known",
        }
    }
}

/// What made a tick late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Culprit {
    /// Which node, by its topic.
    pub topic: Topic,
    /// Which part of its cycle.
    pub part: Part,
    /// How long that took, silent slots included \[ns\].
    pub part_ns: u64,
    /// Its CPU time, where it is known and counts \[ns\].
    pub cpu_ns: Option<u64>,
    /// Likely cause.
    pub cause: Cause,
}

impl Culprit {
    /// Name of the node.
    pub fn node(&self) -> &'static str {
        self.topic.publisher()
    }

    /// One line for people.
    pub fn describe(&self) -> String {
        let ms = |ns: u64| ns as f64 / 1e6;
        let cpu = self.cpu_ns.map_or(String::new(), |ns| format!(" on {:.2} ms of CPU", ms(ns)));
        let (node, part, cause) = (self.node(), self.part.name(), self.cause.name());
        format!("{node}: {part} of {:.2} ms{cpu}: {cause}", ms(self.part_ns))
    }
}

/// Finds what made `tick` late; `usual` holds every node's median wake-up and execution \[ns\].
pub fn culprit(tick: &Tick, usual: &[[u64; 2]; Topic::COUNT]) -> Option<Culprit> {
    let parts = Topic::ALL.into_iter().filter_map(|topic| {
        let cycle = tick.cycles[topic as usize].as_ref()?;
        let wake = if topic == Topic::State { Part::Jitter } else { Part::Hop };
        let [usual_wake, usual_execution] = usual[topic as usize];
        let silent_ns = cycle.silent().saturating_mul(tick.period_ns);
        Some([
            (topic, cycle, wake, cycle.wake_ns().saturating_add(silent_ns), usual_wake),
            (topic, cycle, Part::Execution, cycle.execution_ns(), usual_execution),
        ])
    });
    let longest = parts.flatten().max_by_key(|(.., part_ns, usual_ns)| part_ns.saturating_sub(*usual_ns));
    longest.map(|(topic, cycle, part, part_ns, usual_ns)| {
        let cause = if part_ns <= 2 * usual_ns { Cause::Ordinary } else { judge(cycle, part, tick.solve_ns, topic) };
        let cpu_ns = cycle.cpu_ns.filter(|_| part == Part::Execution);
        Culprit { topic, part, part_ns, cpu_ns, cause }
    })
}

fn judge(cycle: &Cycle, part: Part, solve_ns: u64, topic: Topic) -> Cause {
    let half_ns = cycle.execution_ns() / 2;
    match (part, cycle.cpu_ns) {
        (Part::Jitter | Part::Hop, _) if cycle.withheld > 0 => Cause::Withheld,
        (Part::Jitter | Part::Hop, _) if cycle.free_ns > cycle.release_ns => Cause::CycleBefore,
        (Part::Jitter | Part::Hop, _) => Cause::NotScheduled,
        (Part::Execution, None) => Cause::Unknown,
        (Part::Execution, Some(cpu_ns)) if cpu_ns < half_ns => Cause::Preempted,
        (Part::Execution, Some(_)) if topic == Topic::Controls && solve_ns > half_ns => Cause::Solver,
        (Part::Execution, Some(_)) => Cause::OwnWork,
    }
}
