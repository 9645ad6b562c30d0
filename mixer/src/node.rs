//! Mixer with its ports, woken by CONTROLS; it answers with ACTUATORS.

use std::any::Any;

use contract::message::{Actuators, Controls, Stamp, State};
use contract::scenario::Scenario;
use contract::snapshot::Snapshot;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::member::Member;
use runtime::node::{self, Wired};
use runtime::output::Output;
use runtime::ports::Ports;

use crate::Mixer;

/// Control allocation with its ports.
pub struct Node {
    core: Mixer,
    states: Input<State>,
    demands: Input<Controls>,
    actuators: Output<Actuators>,
}

impl Wired for Node {
    type Upstream = Controls;

    fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self {
            core: Mixer::new(scenario),
            states: Input::open(ports, member)?,
            demands: Input::open(ports, member)?,
            actuators: Output::open(ports, member, scenario)?,
        })
    }

    fn upstream(&mut self) -> &mut Input<Controls> {
        &mut self.demands
    }
}

impl node::Node for Node {
    fn answer(&mut self, sample: Stamp, known: Option<&dyn Any>) {
        let Self { core, states, demands, actuators } = self;
        let (demand, state) = (demands.newest(), states.newest());
        let answer = actuators.known(known).unwrap_or_else(|| core.step(sample.tick, demand, state));
        actuators.send(answer, sample.with(demand).with(state));
    }

    fn memory(&self) -> Snapshot {
        self.core.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) {
        self.core.restore(memory);
    }
}
