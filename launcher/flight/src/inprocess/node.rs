//! What the three cores that answer to the plant have in common.

use attitude_mpc::AttitudeMpc;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State};
use contract::scenario::Scenario;
use contract::snapshot::Snapshot;
use guidance::Guidance;
use mixer::Mixer;

use super::speech::{Counts, Ear, Heard};

/// A node's core, and what it hears.
pub trait Node: Sized {
    /// Where it hears.
    type Ears;
    /// What it says.
    type Says: Message;

    /// As at the beginning of a run.
    fn new(scenario: &Scenario) -> Self;
    /// The ears of one that joins after the `last` words.
    fn ears(last: &Heard) -> Self::Ears;
    /// Its answer to sample `tick`, and where that comes from.
    fn answer(&mut self, ears: &mut Self::Ears, sample: Stamp) -> (Self::Says, Stamp);
    /// Its memory.
    fn memory(&self) -> Snapshot;
    /// Goes on from another's memory.
    fn inherit(&mut self, memory: &Snapshot);
    /// What its ears have refused, by cause.
    fn refused(ears: &Self::Ears) -> Counts;
}

impl Node for Guidance {
    type Ears = Ear<State>;
    type Says = Reference;

    fn new(scenario: &Scenario) -> Self {
        Self::new(scenario)
    }

    fn ears(last: &Heard) -> Self::Ears {
        Ear::after(&last.state)
    }

    fn answer(&mut self, ears: &mut Self::Ears, sample: Stamp) -> (Reference, Stamp) {
        let state = ears.newest(sample.tick + 1);
        (self.step(sample.tick, state), sample.with(state))
    }

    fn memory(&self) -> Snapshot {
        self.snapshot()
    }

    fn inherit(&mut self, memory: &Snapshot) {
        self.restore(memory);
    }

    fn refused(ears: &Self::Ears) -> Counts {
        ears.refused
    }
}

impl Node for AttitudeMpc {
    type Ears = (Ear<State>, Ear<Reference>);
    type Says = Controls;

    fn new(scenario: &Scenario) -> Self {
        Self::new(scenario)
    }

    fn ears(last: &Heard) -> Self::Ears {
        (Ear::after(&last.state), Ear::after(&last.reference))
    }

    fn answer(&mut self, (states, references): &mut Self::Ears, sample: Stamp) -> (Controls, Stamp) {
        let (state, reference) = (states.newest(sample.tick + 1), references.newest(sample.tick + 1));
        (self.step(sample.tick, state, reference), sample.with(reference).with(state))
    }

    fn memory(&self) -> Snapshot {
        self.snapshot()
    }

    fn inherit(&mut self, memory: &Snapshot) {
        self.restore(memory);
    }

    fn refused((states, references): &Self::Ears) -> Counts {
        sum(states.refused, references.refused)
    }
}

impl Node for Mixer {
    type Ears = (Ear<State>, Ear<Controls>);
    type Says = Actuators;

    fn new(scenario: &Scenario) -> Self {
        Self::new(scenario)
    }

    fn ears(last: &Heard) -> Self::Ears {
        (Ear::after(&last.state), Ear::after(&last.controls))
    }

    fn answer(&mut self, (states, demands): &mut Self::Ears, sample: Stamp) -> (Actuators, Stamp) {
        let (state, demand) = (states.newest(sample.tick + 1), demands.newest(sample.tick + 1));
        (self.step(sample.tick, demand, state), sample.with(demand).with(state))
    }

    fn memory(&self) -> Snapshot {
        self.snapshot()
    }

    fn inherit(&mut self, memory: &Snapshot) {
        self.restore(memory);
    }

    fn refused((states, demands): &Self::Ears) -> Counts {
        sum(states.refused, demands.refused)
    }
}

/// Counts by cause, of two ears.
pub fn sum(a: Counts, b: Counts) -> Counts {
    std::array::from_fn(|i| a[i] + b[i])
}
