//! Attitude controller as the core of a node, woken by REFERENCE; it answers with CONTROLS.

use contract::message::{Controls, Reference, State};
use contract::snapshot::Snapshot;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::Core;
use settings::{Fault, Scenario};

use crate::AttitudeMpc;

impl Core for AttitudeMpc {
    type Inputs = (Input<Reference>, Input<State>);
    type Answer = Controls;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self::try_new(scenario)?)
    }

    fn step(&mut self, tick: u64, (references, states): &Self::Inputs) -> Result<Controls, SessionError> {
        Ok(self.step(tick, states.known(), references.known()))
    }

    fn snapshot(&self) -> Snapshot {
        self.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) -> bool {
        self.restore(memory)
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.apply_fault(number, fault);
    }

    fn hurry(&mut self, do_less: bool) {
        self.hurry(do_less);
    }
}
