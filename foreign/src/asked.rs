//! A node whose answers its caller computes: a program with a `main` of its own, or the owner of a stepped flight.

use std::any::Any;

use bytemuck::{Zeroable, bytes_of, bytes_of_mut};
use contract::message::Stamp;
use contract::snapshot::{NO_MEMORY, Snapshot, pack_bytes, unpack_bytes};
use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::input::Upstream;
use runtime::member::Member;
use runtime::node::{Asked, Implausible, Inputs, Node};
use runtime::output::Output;
use runtime::ports::Ports;
use settings::{Fault, Scenario};

use crate::abi::TREFOIL_MEMORY_BYTES;
use crate::library::layout_of;
use crate::protocol::{AttitudeMpcProtocol, GuidanceProtocol, MixerProtocol, PortLayout, Protocol};

/// Number of bytes before the memory of a program; they hold the memory's length.
const LENGTH_BYTES: usize = size_of::<u64>();

/// Node of a protocol, with its ports.
struct AskedNode<P: Protocol> {
    inputs: P::Inputs,
    output: Output<P::Message>,
    sample_s: f64,
    input: P::Input,
    answer: P::Answer,
    /// First word of the node's snapshots, which no other program has.
    layout: u64,
    memory: Snapshot,
    implausible: Implausible,
}

impl<P: Protocol> AskedNode<P> {
    fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Asked>, SessionError> {
        Ok(Box::new(Self {
            inputs: P::Inputs::open(ports, member)?,
            output: Output::open(ports, member, scenario)?,
            sample_s: scenario.sample_s(),
            input: P::Input::zeroed(),
            answer: P::Answer::zeroed(),
            layout: layout_of(scenario, P::TOPIC),
            memory: NO_MEMORY,
            implausible: Implausible::default(),
        }))
    }
}

impl<P: Protocol> Node for AskedNode<P> {
    fn upstream(&mut self) -> &mut dyn Upstream {
        self.inputs.upstream()
    }

    fn answer(&mut self, sample: Stamp, known: Option<&dyn Any>) -> Result<(), SessionError> {
        let known = self.output.known(known);
        let message = known.unwrap_or_else(|| P::message(&self.input, &self.answer));
        self.implausible.count(sample.tick, &message)?;
        self.output.send(message, self.inputs.provenance(sample));
        Ok(())
    }

    fn memory(&self) -> Snapshot {
        self.implausible.without(self.memory)
    }

    fn restore(&mut self, memory: &Snapshot) -> bool {
        let fits = unpack_bytes(self.layout, memory).is_some();
        if fits {
            self.memory = *memory;
        }
        fits
    }

    fn apply_fault(&mut self, _number: usize, _fault: &Fault) {}

    fn asked(&mut self) -> Option<&mut dyn Asked> {
        Some(self)
    }
}

impl<P: Protocol> Asked for AskedNode<P> {
    fn ask(&mut self, sample: Stamp) -> &[u8] {
        self.inputs.look();
        self.input = P::input(sample.tick, sample.tick as f64 * self.sample_s, &self.inputs);
        bytes_of(&self.input)
    }

    fn give(&mut self, answer: &[u8]) {
        bytes_of_mut(&mut self.answer).copy_from_slice(answer);
    }

    fn remember(&mut self, memory: &[u8]) {
        let mut contents = [0; LENGTH_BYTES + TREFOIL_MEMORY_BYTES as usize];
        contents[..LENGTH_BYTES].copy_from_slice(&(memory.len() as u64).to_le_bytes());
        contents[LENGTH_BYTES..][..memory.len()].copy_from_slice(memory);
        self.memory = pack_bytes(self.layout, &contents);
    }

    fn remembered(&self) -> Option<&[u8]> {
        let (length, memory) = unpack_bytes(self.layout, &self.memory)?.split_at(LENGTH_BYTES);
        let length: [u8; LENGTH_BYTES] = length.try_into().ok()?;
        memory.get(..usize::try_from(u64::from_le_bytes(length)).ok()?)
    }
}

/// Opens the ports of `member` for a node whose answers its caller computes.
///
/// # Errors
/// A port cannot be opened, or the node is the plant, which answers to nothing.
pub fn open_asked(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Asked>, SessionError> {
    match member.topic {
        Topic::State => Err(SessionError::UnknownNode(Topic::State.publisher().into())),
        Topic::Reference => AskedNode::<GuidanceProtocol>::open(ports, member, scenario),
        Topic::Controls => AskedNode::<AttitudeMpcProtocol>::open(ports, member, scenario),
        Topic::Actuators => AskedNode::<MixerProtocol>::open(ports, member, scenario),
    }
}

/// Returns the sizes of input and answer of the node that publishes `topic` \[byte\]; `None` for the plant.
pub fn sizes(topic: Topic) -> Option<[usize; 2]> {
    let layout: &PortLayout = match topic {
        Topic::State => return None,
        Topic::Reference => &GuidanceProtocol::LAYOUT,
        Topic::Controls => &AttitudeMpcProtocol::LAYOUT,
        Topic::Actuators => &MixerProtocol::LAYOUT,
    };
    Some(layout.bytes)
}
