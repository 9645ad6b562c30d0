//! How nodes hear and speak when one thread runs them all: what inlet and outlet are to a process.

use contract::guard::{Guard, Refusal};
use contract::link::Link;
use contract::message::{Controls, Message, Reference, Stamp, State};
use contract::outlet::Slowness;
use contract::scenario::Scenario;
use contract::stamp::unheard;

/// Messages refused, by cause.
pub type Counts = [u32; Refusal::ALL.len()];

/// Where a node hears one topic.
#[derive(Default)]
pub struct Ear<M: Message> {
    guard: Guard<M>,
    fresh: bool,
    /// Messages refused, by cause.
    pub refused: Counts,
}

impl<M: Message> Ear<M> {
    /// One that has just joined: the `last` word on the topic is all that it has heard. There are `samples` by now.
    pub fn after(last: &M, holder: u32, samples: u64) -> Self {
        let mut ear = Self::default();
        if last.stamp().sequence > 0 {
            ear.hear(last, holder, samples);
        }
        ear
    }

    /// Judges what `holder`, or somebody else, has said, when there are `samples`.
    pub fn hear(&mut self, message: &M, holder: u32, samples: u64) {
        if message.stamp().unheard == unheard::HEARD {
            match self.guard.take(message, holder, samples) {
                Ok(()) => self.fresh = true,
                Err(refusal) => self.refused[refusal as usize] += 1,
            }
        }
    }

    /// The newest message that was taken.
    pub fn newest(&self) -> &M {
        self.guard.newest()
    }

    /// The same, if it came since the last call.
    pub fn fresh(&mut self) -> Option<&M> {
        std::mem::take(&mut self.fresh).then(|| self.guard.newest())
    }
}

/// The last word on each topic, which whoever joins hears first.
#[derive(Default)]
pub struct Heard {
    /// How many samples there are, with the one that whoever joins is to answer first.
    pub samples: u64,
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
    if message.stamp().unheard != unheard::SHADOW {
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
