//! The observer: a process that watches a run and answers nothing: launcher, recorder, measure. It has no rank, no epoch
//! and no place in a role.

use std::rc::Rc;
use std::sync::Arc;

use crate::error::SessionError;
use crate::port::{Receive, Wire, observer_depth};
use crate::ports::{Ports, Transport};
use crate::queue::Queues;
use crate::realtime::ControlPage;
use contract::scenario::Scenario;

/// A process that watches a run.
pub struct Observer {
    /// The run's settings.
    pub scenario: Scenario,
    /// What it receives through.
    pub ports: Ports,
}

impl Observer {
    /// Joins the run of `namespace`.
    pub fn join(namespace: &str) -> Result<Self, SessionError> {
        let (ports, scenario) = Ports::join(namespace)?;
        Ok(Self { scenario, ports })
    }

    /// Watches a ring that this thread turns.
    pub fn in_process(scenario: &Scenario, page: Arc<ControlPage>, queues: Queues) -> Self {
        Self { scenario: scenario.clone(), ports: Ports::new(page, Transport::Queues(queues)) }
    }

    /// Opens a queue deep enough to see every message.
    pub fn receiver<M: Wire>(&mut self) -> Result<Rc<dyn Receive<M>>, SessionError> {
        self.ports.receiver(observer_depth(self.scenario.run.rate_hz))
    }
}
