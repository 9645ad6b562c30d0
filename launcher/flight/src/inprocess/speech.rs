//! How nodes hear and speak when one thread runs them all: what input and output are to a process.

use std::collections::VecDeque;

use contract::guard::{Guard, Refusal};
use contract::message::{Controls, Message, Reference, Stamp, State};
use contract::scenario::Scenario;
use contract::stamp::delivery;
use runtime::link::Link;
use runtime::output::Slowness;
use runtime::port::NODE_DEPTH;

/// Messages refused, by cause.
pub type Counts = [u32; Refusal::ALL.len()];

/// Where a node hears one topic.
#[derive(Default)]
pub struct Ear<M: Message> {
    /// What was said last before it listened: it comes from who said it, when that one speaks again.
    before: Option<M>,
    /// What has come since the last look, as much as a port holds, each with who was active.
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

    /// Keeps what `active`, or somebody else, has said; who works on standby speaks through a port of its own.
    pub fn hear(&mut self, message: &M, active: u32) {
        let before = self.before.take_if(|before| before.stamp().epoch == message.stamp().epoch);
        for message in before.iter().chain([message]).filter(|message| !message.stamp().is_standby()) {
            if self.queue.len() == NODE_DEPTH {
                self.queue.pop_front();
            }
            self.queue.push_back((*message, active));
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
        for (message, active) in self.queue.drain(..).filter(|(message, _)| message.stamp().is_delivered()) {
            match self.guard.take(&message, active, samples) {
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
    /// Keeps what was not said in a standby.
    pub fn keep_reference(&mut self, message: &Reference) {
        keep(&mut self.reference, message);
    }

    /// Likewise.
    pub fn keep_controls(&mut self, message: &Controls) {
        keep(&mut self.controls, message);
    }
}

fn keep<M: Message>(last: &mut M, message: &M) {
    if !message.stamp().is_standby() {
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

    /// Stamps `message` and sends it on its way; `to` gets what arrives. Only who is active is heard.
    pub fn speak(&mut self, active: bool, mut message: M, mut provenance: Stamp, to: impl FnMut(&M)) {
        self.sequence += 1;
        provenance.held_ns += self.slow.held_up_ns(provenance.tick);
        let delivery = if active { delivery::DELIVERED } else { delivery::STANDBY };
        let stamp = provenance.published(M::TOPIC, self.sequence, 0);
        *message.stamp_mut() = Stamp { epoch: u64::from(self.epoch), delivery, ..stamp };
        self.link.pass(provenance.tick, &message.with_checksum(), to);
    }
}
