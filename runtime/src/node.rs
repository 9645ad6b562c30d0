//! A node that answers: a core with its ports. A process, the ring in process and a replay use the same wiring.

use std::any::Any;

use contract::message::Stamp;
use contract::scenario::{Fault, Scenario};
use contract::snapshot::Snapshot;

use crate::error::SessionError;
use crate::input::Input;
use crate::member::Member;
use crate::port::Wire;
use crate::ports::Ports;
use crate::session::NodeSession;

/// Node that answers to the plant.
pub trait Node {
    /// Answers to a sample; `sample` is the provenance of a new chain. A `known` message of the node's topic is sent in
    /// place of an answer of the core.
    fn answer(&mut self, sample: Stamp, known: Option<&dyn Any>);
    /// Returns the memory of the core.
    fn memory(&self) -> Snapshot;
    /// Continues from the memory of another process; one that does not fit counts as none.
    fn restore(&mut self, memory: &Snapshot);
    /// Adds fault `number`, or changes it to `fault`; a core without faults of its own ignores it.
    fn apply_fault(&mut self, _number: usize, _fault: &Fault) {}
}

/// Node that opens its ports itself.
pub trait Wired: Node + Sized {
    /// Message of the node before this one, which wakes it.
    type Upstream: Wire;
    /// Opens the ports of `member`, with a new core for a run of `scenario`.
    fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError>;
    /// Returns the input from the node before this one.
    fn upstream(&mut self) -> &mut Input<Self::Upstream>;
}

/// Runs a node as a process: answers to every sample until the run is over.
pub fn run<N: Wired>(mut session: NodeSession) -> Result<(), SessionError> {
    let mut node = session.open(N::open)?;
    if let Some(memory) = session.take_over_memory() {
        node.restore(&memory);
    }
    let mut cycles = session.ready()?;
    while let Some(tick) = cycles.next(node.upstream())? {
        cycles.new_faults(|number, fault| node.apply_fault(number, fault));
        node.answer(cycles.provenance(tick), None);
        cycles.done(tick, &node.memory());
    }
    Ok(())
}
