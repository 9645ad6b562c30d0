//! What made a tick late: the part of its way that took longest against the same part's median in this flight.
//!
//! The parts of a chain add up to its response: each node's wait for an input that did not come, its wake-up (with the
//! slots it was silent before) and its execution. A node whose input came late is late through no part of its own, so the
//! part named is where the delay arose.
//!
//! What is known comes before what is inferred ([`crate::happenings`]): the first rule that applies is told.
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

use contract::Topic;

use super::node::Cycle;
use super::ticks::Tick;
use crate::happenings::Happenings;

/// Part of a node's cycle.
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
    /// As in run.json.
    pub fn name(self) -> &'static str {
        match self {
            Self::Input => "wait for its input",
            Self::Jitter => "jitter",
            Self::Hop => "hop",
            Self::Execution => "execution",
        }
    }
}

/// Likely cause, by the rules above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// A node was without a process.
    Down,
    /// A fault of the scenario, or given in flight.
    Fault,
    /// A process died, started or was replaced.
    Event,
    /// What it waits for did not come.
    NoInput,
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
            Self::Down => "a process died or hung",
            Self::Fault => "a fault acted",
            Self::Event => "a process died, started or was replaced",
            Self::NoInput => "its input did not come",
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
#[derive(Debug, Clone, PartialEq, Eq)]
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
    /// The faults, absences and events that the cause stands for, and what else is known of that time.
    pub known: Vec<String>,
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
        let cause = if self.known.is_empty() { cause.to_owned() } else { in_short(&self.known) };
        format!("{node}: {part} of {:.2} ms{cpu}: {cause}", ms(self.part_ns))
    }
}

/// Finds what made `tick` late; `usual` holds every node's median wake-up and execution \[ns\].
pub fn culprit(tick: &Tick, usual: &[[u64; 2]; Topic::COUNT], happened: &Happenings) -> Option<Culprit> {
    let parts = Topic::ALL.into_iter().filter_map(|topic| {
        let cycle = tick.cycles[topic as usize].as_ref()?;
        let wake = if topic == Topic::State { Part::Jitter } else { Part::Hop };
        let [usual_wake, usual_execution] = usual[topic as usize];
        let silent_ns = cycle.silent.saturating_mul(tick.period_ns);
        let before = Topic::ALL[..topic as usize].iter().rev().find_map(|before| tick.cycles[*before as usize]);
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
        let known = happened.causes(topic, from_s, to_s);
        let cause = if !known.absences.is_empty() {
            Cause::Down
        } else if part_ns <= 2 * usual_ns {
            Cause::Ordinary
        } else if !known.faults.is_empty() {
            Cause::Fault
        } else if !known.events.is_empty() {
            Cause::Event
        } else {
            judge(cycle, part, tick.solve_ns, topic)
        };
        let facts =
            if cause == Cause::Ordinary { vec![] } else { [known.faults, known.absences, known.events].concat() };
        let cpu_ns = cycle.cpu_ns.filter(|_| part == Part::Execution);
        Culprit { topic, part, part_ns, cpu_ns, cause, known: facts }
    })
}

fn judge(cycle: &Cycle, part: Part, solve_ns: u64, topic: Topic) -> Cause {
    let half_ns = cycle.execution_ns() / 2;
    match (part, cycle.cpu_ns) {
        (Part::Input, _) => Cause::NoInput,
        (Part::Jitter | Part::Hop, _) if cycle.withheld > 0 => Cause::Withheld,
        (Part::Jitter | Part::Hop, _) if cycle.free_ns > cycle.release_ns => Cause::CycleBefore,
        (Part::Jitter | Part::Hop, _) => Cause::NotScheduled,
        (Part::Execution, None) => Cause::Unknown,
        (Part::Execution, Some(cpu_ns)) if cpu_ns < half_ns => Cause::Preempted,
        (Part::Execution, Some(_)) if topic == Topic::Controls && solve_ns > half_ns => Cause::Solver,
        (Part::Execution, Some(_)) => Cause::OwnWork,
    }
}

/// The first three; how many more there are.
fn in_short(facts: &[String]) -> String {
    let told = facts.iter().take(3).cloned().collect::<Vec<_>>().join("; ");
    if facts.len() > 3 { format!("{told}; {} more", facts.len() - 3) } else { told }
}
