//! Mixer as the core of a node, woken by CONTROLS; it answers with ACTUATORS.

use contract::message::{Actuators, Controls, State};
use contract::snapshot::{self, Snapshot};
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::Core;
use settings::Scenario;

use crate::Mixer;

impl Core for Mixer {
    type Inputs = (Input<Controls>, Input<State>);
    type Answer = Actuators;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self::new(scenario))
    }

    fn step(&mut self, tick: u64, (demands, states): &Self::Inputs) -> Result<Actuators, SessionError> {
        Ok(self.step(tick, demands.known(), states.known()))
    }

    fn snapshot(&self) -> Snapshot {
        snapshot::pack(&self.memory)
    }

    /// Continues from a snapshot. Returns `false`, and changes nothing, if it is foreign, torn or not finite.
    fn restore(&mut self, snapshot: &Snapshot) -> bool {
        snapshot::unpack(snapshot).map(|memory| self.memory = memory).is_some()
    }
}
