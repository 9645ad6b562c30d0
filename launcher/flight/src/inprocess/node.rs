//! The nodes in process: each core with the ports that a process of it has, over queues.

use attitude_mpc::AttitudeMpc;
use contract::message::{Actuators, Controls, Reference, Stamp, State};
use contract::scenario::Scenario;
use contract::snapshot::Snapshot;
use contract::topic::Topic;
use guidance::Guidance;
use mixer::Mixer;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::member::Member;
use runtime::output::Output;
use runtime::ports::Ports;

/// A node that answers to the plant.
pub trait Node: Sized {
    /// The topic that it answers on.
    const TOPIC: Topic;

    /// Opens its ports, with a core as at the beginning of a run of `scenario`.
    fn join(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError>;
    /// Answers to a sample; `sample` is the provenance of a new chain.
    fn answer(&mut self, sample: Stamp);
    /// What it remembers.
    fn memory(&self) -> Snapshot;
    /// Goes on from the memory of another.
    fn restore(&mut self, memory: &Snapshot);
}

/// Guidance with its ports.
pub struct GuidanceNode {
    core: Guidance,
    states: Input<State>,
    references: Output<Reference>,
}

impl Node for GuidanceNode {
    const TOPIC: Topic = Topic::Reference;

    fn join(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError> {
        let (states, references) = (Input::open(ports, member)?, Output::open(ports, member, scenario)?);
        Ok(Self { core: Guidance::new(scenario), states, references })
    }

    fn answer(&mut self, sample: Stamp) {
        let state = self.states.newest();
        self.references.send(self.core.step(sample.tick, state), sample.with(state));
    }

    fn memory(&self) -> Snapshot {
        self.core.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) {
        self.core.restore(memory);
    }
}

/// The attitude controller with its ports.
pub struct MpcNode {
    core: AttitudeMpc,
    states: Input<State>,
    references: Input<Reference>,
    controls: Output<Controls>,
}

impl Node for MpcNode {
    const TOPIC: Topic = Topic::Controls;

    fn join(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError> {
        let (states, references) = (Input::open(ports, member)?, Input::open(ports, member)?);
        let controls = Output::open(ports, member, scenario)?;
        Ok(Self { core: AttitudeMpc::try_new(scenario)?, states, references, controls })
    }

    fn answer(&mut self, sample: Stamp) {
        let (reference, state) = (self.references.newest(), self.states.newest());
        let provenance = sample.with(reference).with(state);
        self.controls.send(self.core.step(sample.tick, state, reference), provenance);
    }

    fn memory(&self) -> Snapshot {
        self.core.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) {
        self.core.restore(memory);
    }
}

/// The mixer with its ports.
pub struct MixerNode {
    core: Mixer,
    states: Input<State>,
    demands: Input<Controls>,
    actuators: Output<Actuators>,
}

impl Node for MixerNode {
    const TOPIC: Topic = Topic::Actuators;

    fn join(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError> {
        let (states, demands) = (Input::open(ports, member)?, Input::open(ports, member)?);
        let actuators = Output::open(ports, member, scenario)?;
        Ok(Self { core: Mixer::new(scenario), states, demands, actuators })
    }

    fn answer(&mut self, sample: Stamp) {
        let (demand, state) = (self.demands.newest(), self.states.newest());
        let provenance = sample.with(demand).with(state);
        self.actuators.send(self.core.step(sample.tick, demand, state), provenance);
    }

    fn memory(&self) -> Snapshot {
        self.core.snapshot()
    }

    fn restore(&mut self, memory: &Snapshot) {
        self.core.restore(memory);
    }
}
