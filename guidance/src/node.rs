//! Guidance with its ports, woken by STATE; it answers with REFERENCE.

use std::any::Any;

use contract::message::{Reference, Stamp, State};
use contract::scenario::Scenario;
use contract::snapshot::Snapshot;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::member::Member;
use runtime::node::{self, Wired};
use runtime::output::Output;
use runtime::ports::Ports;

use crate::Guidance;

/// Position controller with its ports.
pub struct Node {
    core: Guidance,
    states: Input<State>,
    references: Output<Reference>,
}

impl Wired for Node {
    type Upstream = State;

    fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self {
            core: Guidance::new(scenario),
            states: Input::open(ports, member)?,
            references: Output::open(ports, member, scenario)?,
        })
    }

    fn upstream(&mut self) -> &mut Input<State> {
        &mut self.states
    }
}

impl node::Node for Node {
    fn answer(&mut self, sample: Stamp, known: Option<&dyn Any>) {
        let Self { core, states, references } = self;
        let state = states.newest();
        let answer = references.known(known).unwrap_or_else(|| core.step(sample.tick, state));
        references.send(answer, sample.with(state));
    }

    fn memory(&self) -> Snapshot {
        self.core.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) {
        self.core.restore(memory);
    }
}
