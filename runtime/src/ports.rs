//! The ports of one process: opened when it joins, and shown to work before the run begins.
//!
//! Before the run begins every sending port sends probes, and every receiving port waits for one of its active
//! publisher. A process is ready when all its ports work.

use std::rc::Rc;
use std::sync::Arc;

use crate::domain::Domain;
use crate::error::{PortError, SessionError};
use crate::limits::{PROBE_LIMIT_NS, PROBE_PERIOD_NS, RECONNECT_NS, RECONNECTS};
use crate::port::{Bus, Receive, Send, Wire};
use crate::queue::Queues;
use crate::realtime::{self, ControlPage, now_ns, phase};
use crate::shared_role::VACANT;
use contract::message::Stamp;
use contract::scenario::file::{self, MAX_TEXT_BYTES};
use contract::scenario::{self, Scenario};

/// What carries the messages.
pub enum Transport {
    /// Shared memory, between processes.
    SharedMemory(Bus),
    /// Queues, between nodes in process.
    Queues(Queues),
}

/// The ports of one process.
pub struct Ports {
    /// The page of its run.
    pub page: Arc<ControlPage>,
    transport: Transport,
    probes: Vec<Probe>,
}

/// Shows, before the run begins, whether a port works.
struct Probe {
    /// The node at fault while it does not.
    node: &'static str,
    works: Box<dyn FnMut() -> Result<bool, PortError>>,
}

impl Ports {
    /// Joins the run of `namespace`, with no port yet; the run's settings with it.
    pub fn join(namespace: &str) -> Result<(Self, Scenario), SessionError> {
        let domain = Domain::find(namespace)?;
        let io = |what: &str| {
            let what = domain.file(what).display().to_string();
            move |why| SessionError::Io { what, why }
        };
        let text = file::read_text(&domain.file("scenario.toml"), MAX_TEXT_BYTES).map_err(io("scenario.toml"))?;
        let scenario = scenario::from_merged(&text, "the run's merged scenario")?;
        let page = ControlPage::open(&domain.file("page")).map_err(io("page"))?;
        Ok((Self::new(Arc::new(page), Transport::SharedMemory(Bus::attach(&domain)?)), scenario))
    }

    /// None yet.
    pub fn new(page: Arc<ControlPage>, transport: Transport) -> Self {
        Self { page, transport, probes: vec![] }
    }

    /// Opens the sending side of `M`'s topic, and takes the place of `epoch` in the role of its node.
    ///
    /// # Errors
    /// The place is not offered, or another process has it.
    pub fn sender<M: Wire>(&mut self, epoch: u32) -> Result<Rc<dyn Send<M>>, SessionError> {
        let port = match &self.transport {
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
    pub fn receiver<M: Wire>(&mut self, depth: usize) -> Result<Rc<dyn Receive<M>>, SessionError> {
        let port = match &self.transport {
            Transport::SharedMemory(bus) => bus.receiver::<M>(depth),
            Transport::Queues(queues) => queues.receiver(depth),
        }?;
        let works = arrival(port.clone(), &self.page)?;
        self.probes.push(Probe { node: M::TOPIC.publisher(), works: Box::new(works) });
        Ok(port)
    }

    /// Before the run begins, waits until every port works, calls `ready`, and goes on sending probes until the run
    /// begins, so that others see the same. In a run that is under way the process is ready at once: no other waits for
    /// it there, and one that cannot receive or be received is replaced.
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

    /// Sends a probe through every sending port and looks at every receiving one: the node at fault for one that does not
    /// work yet.
    pub fn probe_once(&mut self) -> Result<Option<&'static str>, SessionError> {
        let mut silent = None;
        for probe in &mut self.probes {
            let works = (probe.works)()?;
            silent = silent.or((!works).then_some(probe.node));
        }
        Ok(silent)
    }
}

/// Whether a message of the active publisher has arrived at `port`, asked again and again before the run begins.
///
/// # Errors
/// The run has begun, and the publisher cannot be connected to.
fn arrival<M: Wire>(
    port: Rc<dyn Receive<M>>,
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
            return Ok(true); // what comes from now on may be the first message of the run
        }
        while port.receive(&mut |_, from| arrived |= from == publisher()) == Ok(true) {}
        let now_ns = now_ns();
        if publisher() <= VACANT || arrived {
            reconnect_ns = now_ns + RECONNECT_NS;
        } else if port.cannot_reach(publisher()) || now_ns > reconnect_ns {
            // Two that connect to each other at the same instant may both fail.
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
