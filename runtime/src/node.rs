//! A node that answers: a core behind its ports. A process, the ring in process and a replay use the same wiring.

use std::any::Any;

use contract::message::{Message, Stamp, State};
use contract::snapshot::{NO_MEMORY, Snapshot};
use settings::{Fault, Scenario};

use crate::error::SessionError;
use crate::input::{Input, Upstream};
use crate::limits::IMPLAUSIBLE_ANSWERS;
use crate::member::Member;
use crate::output::Output;
use crate::ports::Ports;
#[cfg(target_os = "linux")]
use crate::session::NodeSession;

/// Core of a node that answers: its control law, without ports.
pub trait Core: Sized + 'static {
    /// Inputs of the node.
    type Inputs: Inputs;
    /// Message that the node sends.
    type Answer: Message;

    /// Builds the core for a run of `scenario`.
    fn build(scenario: &Scenario) -> Result<Self, SessionError>;
    /// Answers to sample `tick` from the newest messages of the inputs. An error ends the process.
    fn step(&mut self, tick: u64, inputs: &Self::Inputs) -> Result<Self::Answer, SessionError>;
    /// Packs the memory; [`NO_MEMORY`] if the core cannot be continued by another.
    fn snapshot(&self) -> Snapshot;
    /// Continues from the memory of another process. Returns `false` if the memory does not fit, and is ignored.
    fn restore(&mut self, memory: &Snapshot) -> bool;
    /// Adds fault `number`, or changes it to `fault`; a core without faults of its own ignores it.
    fn apply_fault(&mut self, _number: usize, _fault: &Fault) {}
    /// Sets whether the next steps shall do less, because a deadline was missed.
    fn hurry(&mut self, _do_less: bool) {}
}

/// Inputs of a node that answers.
pub trait Inputs: Sized {
    /// Opens the inputs of `member`.
    fn open(ports: &mut Ports, member: &Member) -> Result<Self, SessionError>;
    /// Returns the input from the node before this one, which wakes this node.
    fn upstream(&mut self) -> &mut dyn Upstream;
    /// Takes the messages that have come from the queues.
    fn look(&mut self);
    /// Returns the provenance of an answer to `sample` that is computed from the newest messages.
    fn provenance(&self, sample: Stamp) -> Stamp;
}

impl Inputs for Input<State> {
    fn open(ports: &mut Ports, member: &Member) -> Result<Self, SessionError> {
        Input::open(ports, member)
    }

    fn upstream(&mut self) -> &mut dyn Upstream {
        self
    }

    fn look(&mut self) {
        self.newest();
    }

    fn provenance(&self, sample: Stamp) -> Stamp {
        sample.with(self.known())
    }
}

impl<M: Message> Inputs for (Input<M>, Input<State>) {
    fn open(ports: &mut Ports, member: &Member) -> Result<Self, SessionError> {
        Ok((Input::open(ports, member)?, Input::open(ports, member)?))
    }

    fn upstream(&mut self) -> &mut dyn Upstream {
        &mut self.0
    }

    fn look(&mut self) {
        self.0.newest();
        self.1.newest();
    }

    fn provenance(&self, sample: Stamp) -> Stamp {
        sample.with(self.0.known()).with(self.1.known())
    }
}

/// Node that answers to the plant.
pub trait Node {
    /// Returns the input from the node before this one, which wakes this node.
    fn upstream(&mut self) -> &mut dyn Upstream;
    /// Answers to a sample; `sample` is the provenance of a new chain. A `known` message, which a replay gives, is sent
    /// in place of an answer of the core.
    ///
    /// # Errors
    /// The core has failed, and nothing was sent: the process shall end.
    fn answer(&mut self, sample: Stamp, known: Option<&dyn Any>) -> Result<(), SessionError>;
    /// Returns the memory of the core.
    fn memory(&self) -> Snapshot;
    /// Continues from the memory of another process. Returns `false` if the memory does not fit, and is ignored.
    fn restore(&mut self, memory: &Snapshot) -> bool;
    /// Adds fault `number` of the core, or changes it to `fault`.
    fn apply_fault(&mut self, number: usize, fault: &Fault);
    /// Returns the node as [`Asked`] if its caller computes its answers; `None` otherwise.
    fn asked(&mut self) -> Option<&mut dyn Asked> {
        None
    }
}

/// Node whose answers its caller computes, as bytes of the types in `trefoil.h`. [`Node::answer`] sends the answer that
/// was given.
pub trait Asked: Node {
    /// Takes the messages that have come, and returns the input for the answer to `sample`.
    fn ask(&mut self, sample: Stamp) -> &[u8];
    /// Takes the answer to send next, of as many bytes as the node's answers have.
    fn give(&mut self, answer: &[u8]);
    /// Takes the memory for the process that continues after this one.
    fn remember(&mut self, memory: &[u8]);
    /// Returns the memory of the process before this one, if it left one.
    fn remembered(&self) -> Option<&[u8]>;
}

/// Count of a node's newest answers in a row that receivers refuse, because a number is not finite or out of range.
///
/// Such numbers may be in the memory too, as in the warm start of a solver, and would persist. So after such an answer
/// the process leaves no memory, and after too many such answers in a row it ends, to be replaced.
#[derive(Debug, Clone, Copy, Default)]
pub struct Implausible {
    in_a_row: u32,
}

impl Implausible {
    /// Counts the `answer` to sample `tick`.
    ///
    /// # Errors
    /// The answer is the last of too many in a row: the process shall end.
    pub fn count<M: Message>(&mut self, tick: u64, answer: &M) -> Result<(), SessionError> {
        self.in_a_row = if answer.plausible() { 0 } else { self.in_a_row + 1 };
        if self.in_a_row < IMPLAUSIBLE_ANSWERS { Ok(()) } else { Err(SessionError::Implausible { tick }) }
    }

    /// Returns the memory for the next process: `memory`, or none if the newest answer is implausible.
    pub fn without(self, memory: Snapshot) -> Snapshot {
        if self.in_a_row == 0 { memory } else { NO_MEMORY }
    }
}

/// Function that opens a node: [`open`] for one core.
pub type Open = fn(&mut Ports, &Member, &Scenario) -> Result<Box<dyn Node>, SessionError>;

/// Opens the ports of `member`, with a new core for a run of `scenario`.
pub fn open<C: Core>(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    let core = C::build(scenario)?;
    let inputs = C::Inputs::open(ports, member)?;
    let output = Output::open(ports, member, scenario)?;
    Ok(Box::new(Wired { core, inputs, output, implausible: Implausible::default() }))
}

/// Core with its ports.
struct Wired<C: Core> {
    core: C,
    inputs: C::Inputs,
    output: Output<C::Answer>,
    implausible: Implausible,
}

impl<C: Core> Node for Wired<C> {
    fn upstream(&mut self) -> &mut dyn Upstream {
        self.inputs.upstream()
    }

    fn answer(&mut self, sample: Stamp, known: Option<&dyn Any>) -> Result<(), SessionError> {
        let Self { core, inputs, output, implausible } = self;
        inputs.look();
        let answer = match output.known(known) {
            Some(known) => known,
            None => core.step(sample.tick, inputs)?,
        };
        implausible.count(sample.tick, &answer)?;
        let do_less = output.send(answer, inputs.provenance(sample));
        core.hurry(do_less);
        Ok(())
    }

    fn memory(&self) -> Snapshot {
        self.implausible.without(self.core.snapshot())
    }

    fn restore(&mut self, memory: &Snapshot) -> bool {
        self.core.restore(memory)
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.core.apply_fault(number, fault);
    }
}

/// Runs the node that `open` opens as a process: it answers to every sample until the run is over.
///
/// ```text
/// open the ports, continue from the memory of the process before, be ready
/// for each sample: sleep until the input comes or is late         CycleLoop::next
///                  apply the faults that are new                  CycleLoop::new_faults
///                  take in the newest messages, step, send        Node::answer
///                  leave the memory for the next process          CycleLoop::done
/// ```
#[cfg(target_os = "linux")]
pub fn run(mut session: NodeSession, open: Open) -> Result<(), SessionError> {
    let mut node = session.open(open)?;
    session.take_over_memory(|memory| node.restore(memory));
    let mut cycles = session.ready()?;
    while let Some(tick) = cycles.next(node.upstream())? {
        cycles.new_faults(|number, fault| node.apply_fault(number, fault));
        node.answer(cycles.provenance(tick), None)?;
        cycles.done(tick, &node.memory());
    }
    Ok(())
}
