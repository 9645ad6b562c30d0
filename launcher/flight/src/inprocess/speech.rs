//! How nodes hear and speak when one thread runs them all: what inlet and outlet are to a process.

use std::collections::VecDeque;

use contract::guard::{Guard, Refusal};
use contract::message::{Controls, Message, Reference, Stamp, State};
use contract::scenario::Scenario;
use contract::stamp::unheard;
use runtime::link::Link;
use runtime::outlet::Slowness;
use runtime::port::NODE_DEPTH;

/// Messages refused, by cause.
pub type Counts = [u32; Refusal::ALL.len()];

/// Where a node hears one topic.
#[derive(Default)]
pub struct Ear<M: Message> {
    /// What was said last before it listened: it comes from who said it, when that one speaks again.
    before: Option<M>,
    /// What has come since the last look, as much as a port holds, each with who was in office.
    queue: VecDeque<(M, u32)>,
    guard: Guard<M>,
    fresh: bool,
    /// Messages refused, by cause.
    pub refused: Counts,
}

impl<M: Message> Ear<M> {
    /// One that has just joined, after the `last` word on the topic.
    pub fn after(last: &M) -> Self {
        Self { before: Some(*last), ..Self::default() }
    }

    /// Keeps what `holder`, or somebody else, has said; who works in the shadow speaks through a port of its own.
    pub fn hear(&mut self, message: &M, holder: u32) {
        let before = self.before.take_if(|before| before.stamp().epoch == message.stamp().epoch);
        for message in before.iter().chain([message]).filter(|message| !message.stamp().in_shadow()) {
            if self.queue.len() == NODE_DEPTH {
                self.queue.pop_front();
            }
            self.queue.push_back((*message, holder));
        }
    }

    /// The newest message that was taken, when there are `samples`.
    pub fn newest(&mut self, samples: u64) -> &M {
        self.look(samples);
        self.guard.newest()
    }

    /// The same, if it came since the last call.
    pub fn fresh(&mut self, samples: u64) -> Option<&M> {
        self.look(samples);
        std::mem::take(&mut self.fresh).then(|| self.guard.newest())
    }

    /// Judges what has come since the last look.
    fn look(&mut self, samples: u64) {
        for (message, holder) in self.queue.drain(..).filter(|(message, _)| message.stamp().is_heard()) {
            match self.guard.take(&message, holder, samples) {
                Ok(()) => self.fresh = true,
                Err(refusal) => self.refused[refusal as usize] += 1,
            }
        }
    }
}

/// The last word on each topic, which whoever joins hears first.
#[derive(Default)]
pub struct Heard {
    /// From the plant.
    pub state: State,
    /// From guidance.
    pub reference: Reference,
    /// From attitude-mpc.
    pub controls: Controls,
}

impl Heard {
    /// Keeps what was not said in a shadow.
    pub fn keep_reference(&mut self, message: &Reference) {
        keep(&mut self.reference, message);
    }

    /// Likewise.
    pub fn keep_controls(&mut self, message: &Controls) {
        keep(&mut self.controls, message);
    }
}

fn keep<M: Message>(last: &mut M, message: &M) {
    if !message.stamp().in_shadow() {
        *last = *message;
    }
}

/// Where a node speaks on one topic.
pub struct Voice<M> {
    link: Link<M>,
    slow: Slowness,
    epoch: u32,
    sequence: u64,
}

impl<M: Message> Voice<M> {
    /// The voice of the process `epoch`, which has not spoken yet.
    pub fn new(scenario: &Scenario, epoch: u32) -> Self {
        Self { link: Link::new(scenario), slow: Slowness::new(scenario, M::TOPIC), epoch, sequence: 0 }
    }

    /// Stamps `message` and sends it on its way; `to` gets what arrives. Only who is in office is heard.
    pub fn speak(&mut self, in_office: bool, mut message: M, mut lineage: Stamp, to: impl FnMut(&M)) {
        self.sequence += 1;
        lineage.held_ns += self.slow.held_up_ns(lineage.tick);
        let unheard = if in_office { unheard::HEARD } else { unheard::SHADOW };
        let stamp = lineage.published(M::TOPIC, self.sequence, 0);
        *message.stamp_mut() = Stamp { epoch: u64::from(self.epoch), unheard, ..stamp };
        self.link.pass(lineage.tick, &message.sealed(), to);
    }
}
