//! The ports of one process: opened when the process joins, and tested before the run begins.
//!
//! Before the run begins every sending port sends probes, and every receiving port waits for a probe of its active
//! publisher. A process is ready when all its ports work.

use std::rc::Rc;
use std::sync::Arc;

#[cfg(target_os = "linux")]
use crate::domain::Domain;
use crate::error::{PortError, SessionError};
use crate::limits::{PROBE_LIMIT_NS, PROBE_PERIOD_NS, RECONNECT_NS, RECONNECTS};
#[cfg(target_os = "linux")]
use crate::port::Bus;
use crate::port::{ReceivePort, SendPort};
use crate::queue::Queues;
use crate::realtime::{self, ControlPage, now_ns, phase};
use crate::shared_role::VACANT;
use contract::message::{Message, Payload, Stamp, State, Truth};
#[cfg(target_os = "linux")]
use settings::Scenario;

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
    pub fn sender<M: Message>(&mut self, epoch: u32) -> Result<Rc<dyn SendPort<M>>, SessionError> {
        let port = self.open_sender::<M>()?;
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

    /// Opens the sending side of TRUTH, for the plant that has the place in its role. A receiver is not needed.
    pub fn truth_sender(&mut self) -> Result<Rc<dyn SendPort<Truth>>, SessionError> {
        let port = self.open_sender()?;
        self.page.truth_port.set(port.number());
        let (prober, probe) = (port.clone(), Truth::default().with_checksum());
        let works = move || {
            let _ = prober.send(&probe);
            Ok(true)
        };
        self.probes.push(Probe { node: State::TOPIC.publisher(), works: Box::new(works) });
        Ok(port)
    }

    fn open_sender<M: Payload>(&self) -> Result<Rc<dyn SendPort<M>>, PortError> {
        match &self.transport {
            #[cfg(target_os = "linux")]
            Transport::SharedMemory(bus) => bus.sender(),
            Transport::Queues(queues) => queues.sender(),
        }
    }

    /// Opens the receiving side of `M`'s topic with a queue of `depth`.
    pub fn receiver<M: Message>(&mut self, depth: usize) -> Result<Rc<dyn ReceivePort<M>>, SessionError> {
        let active = |page: &ControlPage| page.role(M::TOPIC).port(page.role(M::TOPIC).active());
        self.receive_from(M::TOPIC.publisher(), active, depth)
    }

    /// Opens the receiving side of TRUTH with a queue of `depth`.
    pub fn truth_receiver(&mut self, depth: usize) -> Result<Rc<dyn ReceivePort<Truth>>, SessionError> {
        self.receive_from(State::TOPIC.publisher(), |page| page.truth_port.get(), depth)
    }

    /// Opens the receiving side of `M`, which `node` sends through the port that `publisher` returns.
    fn receive_from<M: Payload>(
        &mut self,
        node: &'static str,
        publisher: fn(&ControlPage) -> u64,
        depth: usize,
    ) -> Result<Rc<dyn ReceivePort<M>>, SessionError> {
        let port = match &self.transport {
            #[cfg(target_os = "linux")]
            Transport::SharedMemory(bus) => bus.receiver::<M>(depth),
            Transport::Queues(queues) => queues.receiver(depth),
        }?;
        let page = self.page.clone();
        let works = arrival(node, port.clone(), &self.page, move || publisher(&page))?;
        self.probes.push(Probe { node, works: Box::new(works) });
        Ok(port)
    }

    /// Waits until every port works, calls `ready`, and goes on sending probes until the run begins, so that other
    /// processes can test their ports. If the run has begun already, the process is ready at once: no other process
    /// waits for it, and the launcher replaces a process that cannot receive or be received.
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

/// Makes the test of a receiving port, which is called repeatedly: it returns whether a message of `node` has arrived
/// through the port that `publisher` returns.
///
/// # Errors
/// The run has begun, and the publisher cannot be connected to.
fn arrival<M: Payload, F: Fn() -> u64>(
    node: &'static str,
    port: Rc<dyn ReceivePort<M>>,
    page: &ControlPage,
    publisher: F,
) -> Result<impl FnMut() -> Result<bool, PortError> + use<M, F>, PortError> {
    let unreachable = move || {
        let gone = || "its files in shared memory are gone or damaged; fly again".into();
        PortError::Unreachable { name: M::NAME, node, reason: realtime::shortage().unwrap_or_else(gone) }
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
