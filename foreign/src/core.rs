//! A library as the core of a node that answers.

use std::marker::PhantomData;

use bytemuck::{Zeroable, bytes_of, bytes_of_mut};
use contract::snapshot::{MEMORY_BYTES, NO_MEMORY, Snapshot, pack_bytes, unpack_bytes};
use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::node::{self, Core, Node};
use runtime::ports::Ports;
use settings::Scenario;

use crate::library::{Library, layout_of};
use crate::protocol::{AttitudeMpcProtocol, GuidanceProtocol, MixerProtocol, Protocol};
use crate::vehicle;

/// Library as the core of the node of a protocol.
pub struct Foreign<P: Protocol> {
    library: Library,
    sample_s: f64,
    /// First word of the library's snapshots, which no other library has.
    layout: u64,
    protocol: PhantomData<P>,
}

impl<P: Protocol> Core for Foreign<P> {
    type Inputs = P::Inputs;
    type Answer = P::Message;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        let library = Library::load(scenario, P::TOPIC, &P::LAYOUT)?;
        let layout = layout_of(scenario, P::TOPIC);
        Ok(Self { library, sample_s: scenario.sample_s(), layout, protocol: PhantomData })
    }

    fn step(&mut self, tick: u64, inputs: &Self::Inputs) -> Result<P::Message, SessionError> {
        let input = P::input(tick, tick as f64 * self.sample_s, inputs);
        let mut answer = P::Answer::zeroed();
        self.library.step(bytes_of(&input), bytes_of_mut(&mut answer))?;
        Ok(P::message(&input, &answer))
    }

    fn snapshot(&self) -> Snapshot {
        let mut memory = [0; MEMORY_BYTES];
        match self.library.memory_bytes() {
            0 => NO_MEMORY,
            bytes => {
                self.library.snapshot(&mut memory[..bytes]);
                pack_bytes(self.layout, &memory[..bytes])
            }
        }
    }

    fn restore(&mut self, memory: &Snapshot) -> bool {
        let bytes = self.library.memory_bytes();
        let memory = unpack_bytes(self.layout, memory).filter(|_| bytes > 0);
        memory.is_some_and(|memory| self.library.restore(&memory[..bytes]))
    }
}

/// Opens the ports of `member` with the library that `scenario` names for its node.
///
/// # Errors
/// The library cannot be loaded, or the node is the plant, which answers to nothing.
pub fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    match member.topic {
        Topic::State => Err(SessionError::UnknownNode(Topic::State.publisher().into())),
        Topic::Reference => node::open::<Foreign<GuidanceProtocol>>(ports, member, scenario),
        Topic::Controls => node::open::<Foreign<AttitudeMpcProtocol>>(ports, member, scenario),
        Topic::Actuators => node::open::<Foreign<MixerProtocol>>(ports, member, scenario),
    }
}

/// Loads the library that `scenario` names for the node that publishes `topic`, and has it answer to a few samples at
/// rest. To be called in a process of its own, which code that crashes, exits or never returns may take down.
///
/// # Errors
/// The library cannot be loaded, or a step fails.
pub fn try_out(topic: Topic, scenario: &Scenario) -> Result<(), SessionError> {
    match topic {
        Topic::State => vehicle::try_out(scenario),
        Topic::Reference => Foreign::<GuidanceProtocol>::build(scenario)?.try_out(),
        Topic::Controls => Foreign::<AttitudeMpcProtocol>::build(scenario)?.try_out(),
        Topic::Actuators => Foreign::<MixerProtocol>::build(scenario)?.try_out(),
    }
}

/// Number of samples that a library is tried with.
const TRIED: usize = 3;

impl<P: Protocol> Foreign<P> {
    fn try_out(mut self) -> Result<(), SessionError> {
        let mut answer = P::Answer::zeroed();
        for _ in 0..TRIED {
            self.library.step(bytes_of(&P::Input::zeroed()), bytes_of_mut(&mut answer))?;
        }
        let memory = self.snapshot();
        self.restore(&memory);
        self.library.destroy()
    }
}
