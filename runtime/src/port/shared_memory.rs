//! Ports in shared memory. Only this file and `storage` name iceoryx2.
//!
//! Publish-subscribe with safe overflow: a publisher never waits, and a slow subscriber loses the oldest messages. A
//! process that dies while it creates a service makes that service unusable for all. So the launcher creates every
//! service before it starts any process, and keeps the services; the nodes only open them.

use std::any::Any;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::{DegradationAction, DegradationInfo};
use iceoryx2::prelude::*;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::descriptors::Descriptors;
use super::storage::{FileService, allocate_own, config, reason};
use super::{ReceivePort, SendPort, WarmUp};
use crate::domain::Domain;
use crate::error::{PortError, PortFailure};
use crate::limits::{MAX_NODES, MAX_PUBLISHERS, MAX_SUBSCRIBERS};
use crate::realtime::shortage;
use contract::integrity::checksum;
use contract::message::{Actuators, Controls, LAYOUT, Payload, Reference, State, Truth};

/// Attachment of a process to the iceoryx2 services of a domain.
pub struct Bus {
    descriptors: Rc<Descriptors>,
    node: Node<FileService>,
    domain: Domain,
}

/// Handles that keep the services of a run alive: one for each topic, and one for TRUTH.
pub struct Services(#[expect(dead_code, reason = "they are kept, not used")] [Box<dyn Any>; LAYOUT.len()]);

impl Bus {
    /// Attaches this process to `domain`.
    pub fn attach(domain: &Domain) -> Result<Self, PortError> {
        set_log_level(LogLevel::Fatal); // errors come back as values; the loop must not print
        let node = NodeBuilder::new()
            .config(&config(domain)?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<FileService>()
            .map_err(|e| PortError::Domain(reason(e)))?;
        let descriptors = Rc::new(Descriptors::of(&domain.folder, &node.id().value().to_string()));
        Ok(Self { descriptors, node, domain: domain.clone() })
    }

    /// Removes the ports of dead processes from the services of `domain`. May take tens of milliseconds.
    pub fn remove_dead_ports(domain: &Domain) -> Result<(), PortError> {
        // Only one thread at a time: the search for dead nodes opens the files of all nodes for a moment, and another
        // thread that attaches meanwhile would take these descriptors for its own (`Descriptors::of`).
        static ONE: Mutex<()> = Mutex::new(());
        let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        // Ports that cannot be removed now are wiped at the end of the run.
        let _ = Self::attach(domain)?.node.try_cleanup_dead_nodes();
        Ok(())
    }

    /// Creates the services, with queues of up to `depth`; called by the launcher.
    pub fn create_services(&self, depth: usize) -> Result<Services, PortError> {
        let node = &self.node;
        Ok(Services([
            Box::new(create::<State>(node, depth)?),
            Box::new(create::<Reference>(node, depth)?),
            Box::new(create::<Controls>(node, depth)?),
            Box::new(create::<Actuators>(node, depth)?),
            Box::new(create::<Truth>(node, depth)?),
        ]))
    }

    /// Opens the sending side of `M`.
    pub fn sender<M: Payload>(&self) -> Result<Rc<dyn SendPort<M>>, PortError> {
        let service = open::<M>(&self.node, &layout::<M>())?;
        let port = service.publisher_builder().create().map_err(refused::<M>)?;
        allocate_own(&self.domain)?;
        Ok(Rc::new(Publication { _descriptors: self.descriptors.clone(), port }))
    }

    /// Opens the receiving side of `M` with a queue of `depth`.
    pub fn receiver<M: Payload>(&self, depth: usize) -> Result<Rc<dyn ReceivePort<M>>, PortError> {
        let service = open::<M>(&self.node, &layout::<M>())?;
        let unreachable = Arc::new(Unreachable::default());
        let port = RefCell::new(subscriber(&service, depth, &unreachable)?);
        allocate_own(&self.domain)?;
        Ok(Rc::new(Subscription { _descriptors: self.descriptors.clone(), port, service, depth, unreachable }))
    }

    /// Tries to open the service of `M` as a process with another layout of the messages, which must be refused.
    pub fn open_as_another_version<M: Payload>(&self) -> Result<(), PortError> {
        open::<M>(&self.node, &"0".repeat(16)).map(drop)
    }
}

struct Publication<M: Payload> {
    _descriptors: Rc<Descriptors>,
    port: Publisher<FileService, M, ()>,
}

impl<M: Payload> SendPort<M> for Publication<M> {
    fn send(&self, message: &M) -> Result<(), PortFailure> {
        match self.port.send_copy(*message) {
            Ok(1..) => Ok(()),
            Ok(0) | Err(_) => Err(PortFailure::Send),
        }
    }

    fn number(&self) -> u64 {
        numbered(self.port.id().value())
    }
}

impl<M: Payload> WarmUp for Publication<M> {
    fn warm_up(&self) {
        drop(self.port.loan_uninit()); // a loan touches most of the memory that a send touches
    }
}

/// Subscriber, and the publishers that it could not connect to.
struct Subscription<M: Payload> {
    _descriptors: Rc<Descriptors>,
    port: RefCell<Subscriber<FileService, M, ()>>,
    service: PortFactory<FileService, M, ()>,
    depth: usize,
    unreachable: Arc<Unreachable>,
}

/// Ports of the newest publishers that could not be connected to.
#[derive(Default)]
struct Unreachable {
    ports: [AtomicU64; MAX_PUBLISHERS],
    count: AtomicUsize,
}

impl Unreachable {
    fn note(&self, port: u64) {
        let place = self.count.fetch_add(1, Ordering::Relaxed) % MAX_PUBLISHERS;
        self.ports[place].store(port, Ordering::Relaxed);
    }
}

impl<M: Payload> ReceivePort<M> for Subscription<M> {
    fn receive(&self, take: &mut dyn FnMut(&M, u64)) -> Result<bool, PortFailure> {
        let sample = self.port.borrow().receive().map_err(|_| PortFailure::Receive)?;
        let Some(sample) = sample else { return Ok(false) };
        let message = *sample; // a copy, because the publisher may change its memory between check and use
        take(&message, numbered(sample.header().publisher_id().value()));
        Ok(true)
    }

    fn cannot_reach(&self, port: u64) -> bool {
        port != 0 && self.unreachable.ports.iter().any(|noted| noted.load(Ordering::Relaxed) == port)
    }

    fn reconnect(&self) -> Result<(), PortError> {
        self.unreachable.ports.iter().for_each(|noted| noted.store(0, Ordering::Relaxed));
        let port = subscriber(&self.service, self.depth, &self.unreachable)?;
        drop(self.port.replace(port));
        Ok(())
    }
}

fn subscriber<M: Payload>(
    service: &PortFactory<FileService, M, ()>,
    depth: usize,
    unreachable: &Arc<Unreachable>,
) -> Result<Subscriber<FileService, M, ()>, PortError> {
    let unreachable = unreachable.clone();
    let failed = move |_, info: &DegradationInfo| {
        unreachable.note(numbered(info.sender_port_id));
        DegradationAction::Ignore
    };
    service.subscriber_builder().buffer_size(depth).set_degradation_handler(failed).create().map_err(refused::<M>)
}

/// Hashes a publisher's identity (process, time, count) to one word.
fn numbered(id: u128) -> u64 {
    checksum(&[id as u64, (id >> 64) as u64])
}

fn create<M: Payload>(node: &Node<FileService>, depth: usize) -> Result<PortFactory<FileService, M, ()>, PortError> {
    let mut attributes = AttributeSpecifier::new();
    attributes = attributes.define(&layout_key()?, &attribute(&layout::<M>())?).map_err(refused::<M>)?;
    node.service_builder(&service_name::<M>()?)
        .publish_subscribe::<M>()
        .enable_safe_overflow(true)
        .history_size(1)
        .subscriber_max_buffer_size(depth)
        .max_publishers(MAX_PUBLISHERS)
        .max_subscribers(MAX_SUBSCRIBERS)
        .max_nodes(MAX_NODES)
        .create_with_attributes(&attributes)
        .map_err(refused::<M>)
}

fn open<M: Payload>(node: &Node<FileService>, layout: &str) -> Result<PortFactory<FileService, M, ()>, PortError> {
    let mut attributes = AttributeVerifier::new();
    attributes = attributes.require(&layout_key()?, &attribute(layout)?).map_err(refused::<M>)?;
    node.service_builder(&service_name::<M>()?)
        .publish_subscribe::<M>()
        .open_with_attributes(&attributes)
        .map_err(refused::<M>)
}

fn service_name<M: Payload>() -> Result<ServiceName, PortError> {
    ServiceName::new(&format!("trefoil/{}", M::NAME)).map_err(refused::<M>)
}

fn layout_key() -> Result<AttributeKey, PortError> {
    AttributeKey::new(b"layout").map_err(|e| PortError::Domain(format!("{e:?}")))
}

/// Computes the layout attribute of `M`: a hash of the default message as printed, which shows names, order, nesting,
/// lengths and kinds of numbers. iceoryx2 compares only name, size and alignment of a type.
fn layout<M: Payload>() -> String {
    let fnv = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    let hash = format!("{:?}", M::default()).bytes().fold(0xcbf2_9ce4_8422_2325, fnv);
    format!("{hash:016x}")
}

fn attribute(value: &str) -> Result<AttributeValue, PortError> {
    AttributeValue::new(value.as_bytes()).map_err(|e| PortError::Domain(format!("{e:?}")))
}

fn refused<M: Payload>(error: impl std::fmt::Debug) -> PortError {
    let reason = reason(error);
    let otherwise = || format!("{reason}; if the stack is of another version, stop it and start all of it again");
    PortError::Service { name: M::NAME, reason: shortage().unwrap_or_else(otherwise) }
}
