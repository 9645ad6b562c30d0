//! Guidance as the core of a node, woken by STATE; it answers with REFERENCE.

use contract::message::{Reference, State};
use contract::snapshot::Snapshot;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::Core;
use settings::Scenario;

use crate::Guidance;

impl Core for Guidance {
    type Inputs = Input<State>;
    type Answer = Reference;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self::new(scenario))
    }

    fn step(&mut self, tick: u64, states: &Self::Inputs) -> Result<Reference, SessionError> {
        Ok(self.step(tick, states.known()))
    }

    fn snapshot(&self) -> Snapshot {
        self.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) -> bool {
        self.restore(memory)
    }
}
