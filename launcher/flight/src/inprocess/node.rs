//! Nodes in process: each core with the ports that a process of it would have, over queues.

use attitude_mpc::AttitudeMpc;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State};
use contract::scenario::{Fault, Scenario};
use contract::snapshot::Snapshot;
use contract::topic::Topic;
use guidance::Guidance;
use mixer::Mixer;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::member::Member;
use runtime::output::Output;
use runtime::ports::Ports;

use crate::log::Record;

/// Node that answers to the plant.
pub trait Node {
    /// Answers to a sample; `sample` is the provenance of a new chain. A `known` answer is sent without the core.
    fn answer(&mut self, sample: Stamp, known: Option<&Record>);
    /// Returns the memory of the core.
    fn memory(&self) -> Snapshot;
    /// Continues from the memory of another process; one that does not fit counts as none.
    fn restore(&mut self, memory: &Snapshot);
    /// Adds fault `number`, or changes it to `fault`, if it is one of the core.
    fn apply_fault(&mut self, number: usize, fault: &Fault);
}

/// Opens the ports of `member`, with a new core for a run of `scenario`.
pub fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    Ok(match member.topic {
        Topic::State => return Err(SessionError::UnknownNode("plant".into())), // it samples, and answers to nothing
        Topic::Reference => {
            let mut states = Input::<State>::open(ports, member)?;
            let mut references = Output::<Reference>::open(ports, member, scenario)?;
            boxed(Guidance::new(scenario), move |core, sample, known| {
                let state = states.newest();
                let known = known_to(&mut references, known);
                references.send(known.unwrap_or_else(|| core.step(sample.tick, state)), sample.with(state));
            })
        }
        Topic::Controls => {
            let mut states = Input::<State>::open(ports, member)?;
            let mut references = Input::<Reference>::open(ports, member)?;
            let mut controls = Output::<Controls>::open(ports, member, scenario)?;
            boxed(AttitudeMpc::try_new(scenario)?, move |core, sample, known| {
                let (reference, state) = (references.newest(), states.newest());
                let known = known_to(&mut controls, known);
                let answer = known.unwrap_or_else(|| core.step(sample.tick, state, reference));
                core.hurry(controls.send(answer, sample.with(reference).with(state)));
            })
        }
        Topic::Actuators => {
            let mut states = Input::<State>::open(ports, member)?;
            let mut demands = Input::<Controls>::open(ports, member)?;
            let mut actuators = Output::<Actuators>::open(ports, member, scenario)?;
            boxed(Mixer::new(scenario), move |core, sample, known| {
                let (demand, state) = (demands.newest(), states.newest());
                let known = known_to(&mut actuators, known);
                let answer = known.unwrap_or_else(|| core.step(sample.tick, demand, state));
                actuators.send(answer, sample.with(demand).with(state));
            })
        }
    })
}

/// Returns the `known` message, if there is one; `output` goes on with its number.
pub fn known_to<M: Message>(output: &mut Output<M>, known: Option<&Record>) -> Option<M> {
    let known: &M = known?.message()?;
    output.continue_after(known.stamp().sequence.saturating_sub(1));
    Some(*known)
}

/// Core with the function that answers through its ports.
struct WithPorts<C, F> {
    core: C,
    answer: F,
}

fn boxed<C: 'static, F: FnMut(&mut C, Stamp, Option<&Record>) + 'static>(core: C, answer: F) -> Box<dyn Node>
where
    WithPorts<C, F>: Node,
{
    Box::new(WithPorts { core, answer })
}

macro_rules! node {
    ($($core:ty: $apply_fault:expr),*) => {$(
        impl<F: FnMut(&mut $core, Stamp, Option<&Record>)> Node for WithPorts<$core, F> {
            fn answer(&mut self, sample: Stamp, known: Option<&Record>) {
                (self.answer)(&mut self.core, sample, known);
            }
            fn memory(&self) -> Snapshot {
                self.core.snapshot()
            }
            fn restore(&mut self, memory: &Snapshot) {
                self.core.restore(memory);
            }
            fn apply_fault(&mut self, number: usize, fault: &Fault) {
                $apply_fault(&mut self.core, number, fault);
            }
        }
    )*};
}
node!(Guidance: |_, _, _| {}, AttitudeMpc: AttitudeMpc::apply_fault, Mixer: |_, _, _| {});
