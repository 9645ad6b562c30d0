//! Receiving ports of recorder and launcher, which get every message.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use contract::message::{Actuators, Controls, Message, Payload, Reference, State, Truth};
use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::port::{ReceivePort, observer_depth};
use runtime::ports::Ports;
use runtime::realtime::ControlPage;
use settings::Scenario;

use crate::record::Record;

/// Receiving ports of the four topics and of TRUTH, read as one stream of records.
pub struct Observers {
    page: Arc<ControlPage>,
    states: Rc<dyn ReceivePort<State>>,
    references: Rc<dyn ReceivePort<Reference>>,
    controls: Rc<dyn ReceivePort<Controls>>,
    actuators: Rc<dyn ReceivePort<Actuators>>,
    truths: Rc<dyn ReceivePort<Truth>>,
    received: [Cell<u32>; Topic::COUNT],
    drained: [Cell<u64>; Record::KINDS],
    failures: Cell<u32>,
}

impl Observers {
    /// Opens the ports of an observer, with queues deep enough to receive every message.
    pub fn open(ports: &mut Ports, scenario: &Scenario) -> Result<Self, SessionError> {
        let depth = observer_depth(scenario.run.rate_hz);
        Ok(Self {
            page: ports.page.clone(),
            states: ports.receiver(depth)?,
            references: ports.receiver(depth)?,
            controls: ports.receiver(depth)?,
            actuators: ports.receiver(depth)?,
            truths: ports.truth_receiver(depth)?,
            received: Default::default(),
            drained: Default::default(),
            failures: Cell::default(),
        })
    }

    /// Passes the messages in the queues to `each`, TRUTH first and then topic by topic, and returns their number.
    /// Probes and messages of processes that do not belong to the run are left out.
    pub fn drain(&self, mut each: impl FnMut(&Record)) -> usize {
        self.truths(&mut each)
            + self.one(&*self.states, &mut each)
            + self.one(&*self.references, &mut each)
            + self.one(&*self.controls, &mut each)
            + self.one(&*self.actuators, &mut each)
    }

    /// Returns how many messages of a [kind](Record::kind) were sent so far, and how many [`Self::drain`] passed on.
    pub fn sent_and_drained(&self, kind: usize) -> (u32, u64) {
        let of_topic = Topic::ALL.get(kind).map(|topic| &self.page.role(*topic).sent_by_all);
        (of_topic.unwrap_or(&self.page.truths_sent).get(), self.drained[kind].get())
    }

    /// Returns the number of messages received on `topic` so far that came from the process active at that time.
    pub fn received(&self, topic: Topic) -> u32 {
        self.received[topic as usize].get()
    }

    /// Returns how often a queue could not be read so far.
    pub fn failures(&self) -> u32 {
        self.failures.get()
    }

    /// Connects to the publishers of a [kind](Record::kind) anew, with an empty queue; no effect if that fails.
    pub fn reconnect(&self, kind: usize) {
        // The next attempt of the caller may succeed.
        let _ = match Topic::ALL.get(kind) {
            Some(Topic::State) => self.states.reconnect(),
            Some(Topic::Reference) => self.references.reconnect(),
            Some(Topic::Controls) => self.controls.reconnect(),
            Some(Topic::Actuators) => self.actuators.reconnect(),
            None => self.truths.reconnect(),
        };
    }

    fn one<M: Message + Into<Record>>(&self, port: &dyn ReceivePort<M>, each: &mut impl FnMut(&Record)) -> usize {
        let role = self.page.role(M::TOPIC);
        let (received, drained) = (&self.received[M::TOPIC as usize], &self.drained[M::TOPIC as usize]);
        let before = drained.get();
        let mut take = |message: &M, from| {
            received.set(received.get() + u32::from(from == role.port(role.active())));
            // A fault that flips bits can make any message look like a probe, but then the checksum does not fit.
            let is_probe = message.stamp().is_probe() && message.is_intact();
            if role.knows(from) && !is_probe {
                each(&(*message).into());
                drained.set(drained.get() + 1);
            }
        };
        self.receive_all(port, &mut take);
        (drained.get() - before) as usize
    }

    fn truths(&self, each: &mut impl FnMut(&Record)) -> usize {
        let drained = &self.drained[Topic::COUNT];
        let before = drained.get();
        self.receive_all(&*self.truths, &mut |truth, from| {
            if from == self.page.truth_port.get() && !(truth.is_probe() && truth.is_intact()) {
                each(&(*truth).into());
                drained.set(drained.get() + 1);
            }
        });
        (drained.get() - before) as usize
    }

    /// Passes the messages in the queue of `port` to `take`.
    fn receive_all<M: Payload>(&self, port: &dyn ReceivePort<M>, take: &mut dyn FnMut(&M, u64)) {
        let failed = loop {
            match port.receive(take) {
                Ok(true) => {}
                Ok(false) => break 0,
                Err(_) => break 1,
            }
        };
        self.failures.set(self.failures.get() + failed);
    }
}
