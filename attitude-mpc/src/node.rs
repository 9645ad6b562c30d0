//! Attitude controller as the core of a node, woken by REFERENCE; it answers with CONTROLS.

use contract::message::{Controls, Reference, State};
use contract::snapshot::{self, Snapshot};
use nalgebra::Vector4;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::Core;
use settings::{Fault, Scenario};

use crate::AttitudeMpc;
use crate::memory::Whole;

impl Core for AttitudeMpc {
    type Inputs = (Input<Reference>, Input<State>);
    type Answer = Controls;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self::try_new(scenario)?)
    }

    fn step(&mut self, tick: u64, (references, states): &Self::Inputs) -> Result<Controls, SessionError> {
        Ok(self.step(tick, states.known(), references.known()))
    }

    /// Packs the whole memory, except [`hurry`](Core::hurry), which belongs to the process.
    fn snapshot(&self) -> Snapshot {
        snapshot::pack(&Whole { memory: self.memory, warm_start: self.law.warm_start() })
    }

    /// Continues from a snapshot. Returns `false`, and changes nothing, if the snapshot is foreign, torn or not finite,
    /// or does not fit this model and solver.
    fn restore(&mut self, snapshot: &Snapshot) -> bool {
        let states = self.model.states() as u64;
        let Some(whole) = snapshot::unpack::<Whole>(snapshot).filter(|whole| whole.memory.states == states) else {
            return false;
        };
        let fits = self.law.start_from(&whole.warm_start);
        if fits {
            self.memory = whole.memory;
            if self.disturbance_law.is_none() && !self.law.has_own_estimate() {
                self.memory.disturbance = Vector4::zeros(); // of another law: nothing here would renew it
            }
        }
        fits
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.law.apply_fault(number, fault);
    }

    fn hurry(&mut self, do_less: bool) {
        self.law.hurry(do_less);
    }
}
