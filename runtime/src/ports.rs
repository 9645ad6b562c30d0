//! The ports of one process: opened when it joins, and tested before the run begins.
//!
//! Before the run begins every sending port sends probes, and every receiving port waits for a probe of its active
//! publisher. A process is ready when all its ports work.

use std::rc::Rc;
use std::sync::Arc;

use crate::error::{PortError, SessionError};
use crate::limits::{PROBE_LIMIT_NS, PROBE_PERIOD_NS, RECONNECT_NS, RECONNECTS};
#[cfg(target_os = "linux")]
use crate::port::Bus;
use crate::port::{ReceivePort, SendPort, Wire};
use crate::queue::Queues;
use crate::realtime::{self, ControlPage, now_ns, phase};
use crate::shared_role::VACANT;
use contract::message::Stamp;
#[cfg(target_os = "linux")]
use {crate::domain::Domain, contract::scenario::Scenario};

/// Transport of the messages.
pub enum Transport {
    /// Shared memory, between processes.
    #[cfg(target_os = "linux")]
    SharedMemory(Bus),
    /// Queues, between nodes in process.
    Queues(Queues),
}

/// The ports of one process.
pub struct Ports {
    /// Control page of the run.
    pub page: Arc<ControlPage>,
    transport: Transport,
    probes: Vec<Probe>,
}

/// Test of one port, before the run begins.
struct Probe {
    /// Node at fault while the port does not work.
    node: &'static str,
    works: Box<dyn FnMut() -> Result<bool, PortError>>,
}

impl Ports {
    /// Joins the run of `namespace`, without ports, and reads the run's settings.
    #[cfg(target_os = "linux")]
    pub fn join(namespace: &str) -> Result<(Self, Scenario), SessionError> {
        let domain = Domain::find(namespace)?;
        let io = |what: &str| {
            let what = domain.file(what).display().to_string();
            move |why| SessionError::Io { what, why }
        };
        let scenario = domain.scenario()?;
        let page = ControlPage::open(&domain.file("page")).map_err(io("page"))?;
        Ok((Self::new(Arc::new(page), Transport::SharedMemory(Bus::attach(&domain)?)), scenario))
    }

    /// Makes an empty set of ports.
    pub fn new(page: Arc<ControlPage>, transport: Transport) -> Self {
        Self { page, transport, probes: vec![] }
    }

    /// Opens the sending side of `M`'s topic, and takes the place of `epoch` in the role of its node.
    ///
    /// # Errors
    /// The place was not offered, or another process has it.
    pub fn sender<M: Wire>(&mut self, epoch: u32) -> Result<Rc<dyn SendPort<M>>, SessionError> {
        let port = match &self.transport {
            #[cfg(target_os = "linux")]
            Transport::SharedMemory(bus) => bus.sender::<M>(),
            Transport::Queues(queues) => queues.sender(),
        }?;
        if !self.page.role(M::TOPIC).claim(epoch, port.number()) {
            return Err(SessionError::Taken { node: M::TOPIC.publisher(), epoch });
        }
        let (prober, mut probe) = (port.clone(), M::default());
        *probe.stamp_mut() = Stamp::probe(epoch);
        let probe = probe.with_checksum();
        let works = move || Ok(prober.send(&probe).is_ok());
        self.probes.push(Probe { node: M::TOPIC.publisher(), works: Box::new(works) });
        Ok(port)
    }

    /// Opens the receiving side of `M`'s topic with a queue of `depth`.
    pub fn receiver<M: Wire>(&mut self, depth: usize) -> Result<Rc<dyn ReceivePort<M>>, SessionError> {
        let port = match &self.transport {
            #[cfg(target_os = "linux")]
            Transport::SharedMemory(bus) => bus.receiver::<M>(depth),
            Transport::Queues(queues) => queues.receiver(depth),
        }?;
        let works = arrival(port.clone(), &self.page)?;
        self.probes.push(Probe { node: M::TOPIC.publisher(), works: Box::new(works) });
        Ok(port)
    }

    /// Waits until every port works, calls `ready`, and goes on sending probes until the run begins, so that other
    /// processes can test their ports. If the run has begun already the process is ready at once: no other waits for
    /// it, and the launcher replaces one that cannot receive or be received.
    pub fn probe(&mut self, ready: impl Fn()) -> Result<(), SessionError> {
        let limit_ns = now_ns() + PROBE_LIMIT_NS;
        let mut is_ready = false;
        while self.page.phase.count() == phase::JOIN {
            match self.probe_once()? {
                None if is_ready => {}
                None => {
                    ready();
                    is_ready = true;
                }
                Some(node) if now_ns() > limit_ns => return Err(SessionError::Silent { node }),
                Some(_) => {}
            }
            self.page.phase.wait(phase::JOIN, now_ns() + PROBE_PERIOD_NS);
        }
        if !is_ready {
            ready();
        }
        Ok(())
    }

    /// Sends a probe through every sending port and looks at every receiving one. Returns the node at fault for the
    /// first port that does not work yet; `None` if all work.
    pub fn probe_once(&mut self) -> Result<Option<&'static str>, SessionError> {
        let mut silent = None;
        for probe in &mut self.probes {
            let works = (probe.works)()?;
            silent = silent.or((!works).then_some(probe.node));
        }
        Ok(silent)
    }
}

/// Makes the test of a receiving port: whether a message of the active publisher has arrived; called again and again.
///
/// # Errors
/// The run has begun, and the publisher cannot be connected to.
fn arrival<M: Wire>(
    port: Rc<dyn ReceivePort<M>>,
    page: &Arc<ControlPage>,
) -> Result<impl FnMut() -> Result<bool, PortError> + use<M>, PortError> {
    let unreachable = || {
        let gone = || "its files in shared memory are gone or damaged; fly again".into();
        PortError::Unreachable { topic: M::TOPIC, reason: realtime::shortage().unwrap_or_else(gone) }
    };
    let publisher = {
        let page = page.clone();
        move || page.role(M::TOPIC).port(page.role(M::TOPIC).active())
    };
    if page.phase.count() != phase::JOIN && port.cannot_reach(publisher()) {
        return Err(unreachable());
    }
    let (mut arrived, mut tries, mut reconnect_ns) = (false, 0, u64::MAX);
    Ok(move || {
        if arrived {
            return Ok(true); // the next message may be the first of the run: leave it in the queue
        }
        while port.receive(&mut |_, from| arrived |= from == publisher()) == Ok(true) {}
        let now_ns = now_ns();
        if publisher() <= VACANT || arrived {
            reconnect_ns = now_ns + RECONNECT_NS;
        } else if port.cannot_reach(publisher()) || now_ns > reconnect_ns {
            // Two processes that connect to each other at the same instant may both fail.
            tries += 1;
            if tries > RECONNECTS {
                return Err(unreachable());
            }
            port.reconnect()?;
            reconnect_ns = now_ns + RECONNECT_NS;
        }
        Ok(arrived)
    })
}
