//! Attitude controller with its ports, woken by REFERENCE; it answers with CONTROLS.

use std::any::Any;

use contract::message::{Controls, Reference, Stamp, State};
use contract::scenario::{Fault, Scenario};
use contract::snapshot::Snapshot;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::member::Member;
use runtime::node::{self, Wired};
use runtime::output::Output;
use runtime::ports::Ports;

use crate::AttitudeMpc;

/// Attitude controller with its ports.
pub struct Node {
    core: AttitudeMpc,
    states: Input<State>,
    references: Input<Reference>,
    controls: Output<Controls>,
}

impl Wired for Node {
    type Upstream = Reference;

    fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self {
            core: AttitudeMpc::try_new(scenario)?,
            states: Input::open(ports, member)?,
            references: Input::open(ports, member)?,
            controls: Output::open(ports, member, scenario)?,
        })
    }

    fn upstream(&mut self) -> &mut Input<Reference> {
        &mut self.references
    }
}

impl node::Node for Node {
    fn answer(&mut self, sample: Stamp, known: Option<&dyn Any>) {
        let Self { core, states, references, controls } = self;
        let (reference, state) = (references.newest(), states.newest());
        let answer = controls.known(known).unwrap_or_else(|| core.step(sample.tick, state, reference));
        let do_less = controls.send(answer, sample.with(reference).with(state));
        core.hurry(do_less);
    }

    fn memory(&self) -> Snapshot {
        self.core.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) {
        self.core.restore(memory);
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.core.apply_fault(number, fault);
    }
}
