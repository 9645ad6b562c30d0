//! Receiving ports of recorder and launcher, which get every message.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use contract::message::{Actuators, Controls, Reference, State};
use contract::scenario::Scenario;
use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::port::{ReceivePort, Wire, observer_depth};
use runtime::ports::Ports;
use runtime::realtime::ControlPage;

use crate::record::Record;

/// Receiving ports of the four topics, read as one stream of records.
pub struct Observers {
    page: Arc<ControlPage>,
    states: Rc<dyn ReceivePort<State>>,
    references: Rc<dyn ReceivePort<Reference>>,
    controls: Rc<dyn ReceivePort<Controls>>,
    actuators: Rc<dyn ReceivePort<Actuators>>,
    received: [Cell<u32>; Topic::COUNT],
    drained: [Cell<u64>; Topic::COUNT],
    failures: Cell<u32>,
}

impl Observers {
    /// Opens all four topics, with queues deep enough to receive every message.
    pub fn open(ports: &mut Ports, scenario: &Scenario) -> Result<Self, SessionError> {
        let depth = observer_depth(scenario.run.rate_hz);
        Ok(Self {
            page: ports.page.clone(),
            states: ports.receiver(depth)?,
            references: ports.receiver(depth)?,
            controls: ports.receiver(depth)?,
            actuators: ports.receiver(depth)?,
            received: Default::default(),
            drained: Default::default(),
            failures: Cell::default(),
        })
    }

    /// Passes the messages in the queues to `each`, topic by topic, and returns their number. Probes and messages of
    /// processes that do not belong to the run are left out.
    pub fn drain(&self, mut each: impl FnMut(&Record)) -> usize {
        self.one(&*self.states, &mut each)
            + self.one(&*self.references, &mut each)
            + self.one(&*self.controls, &mut each)
            + self.one(&*self.actuators, &mut each)
    }

    /// Returns the number of messages on `topic` that were passed on so far.
    pub fn drained(&self, topic: Topic) -> u64 {
        self.drained[topic as usize].get()
    }

    /// Returns the number of messages received on `topic` so far that came from the process active at that time.
    pub fn received(&self, topic: Topic) -> u32 {
        self.received[topic as usize].get()
    }

    /// Returns how often a queue could not be read so far.
    pub fn failures(&self) -> u32 {
        self.failures.get()
    }

    /// Connects to the publishers of `topic` anew, with an empty queue; without effect if that fails.
    pub fn reconnect(&self, topic: Topic) {
        // The next attempt of the caller may succeed.
        let _ = match topic {
            Topic::State => self.states.reconnect(),
            Topic::Reference => self.references.reconnect(),
            Topic::Controls => self.controls.reconnect(),
            Topic::Actuators => self.actuators.reconnect(),
        };
    }

    fn one<M: Wire + Into<Record>>(&self, port: &dyn ReceivePort<M>, each: &mut impl FnMut(&Record)) -> usize {
        let role = self.page.role(M::TOPIC);
        let (received, drained) = (&self.received[M::TOPIC as usize], &self.drained[M::TOPIC as usize]);
        let before = drained.get();
        let mut take = |message: &M, from| {
            received.set(received.get() + u32::from(from == role.port(role.active())));
            // A fault that flips bits can make any message look like a probe, but not an intact one.
            let is_probe = message.stamp().is_probe() && message.is_intact();
            if role.knows(from) && !is_probe {
                each(&(*message).into());
                drained.set(drained.get() + 1);
            }
        };
        let failed = loop {
            match port.receive(&mut take) {
                Ok(true) => {}
                Ok(false) => break 0,
                Err(_) => break 1,
            }
        };
        self.failures.set(self.failures.get() + failed);
        (drained.get() - before) as usize
    }
}
