//! Ports: how messages travel. Only this room names iceoryx2.
//!
//! Publish-subscribe with safe overflow: a publisher never waits, a slow subscriber loses the oldest. The launcher
//! creates every service and keeps it; the nodes only open. A process that dies in the middle of creating a service
//! would brick it for everyone, and a holder that outlives the nodes makes that impossible.
//!
//! The generic ports stay behind two small traits, so that only this crate pays for compiling them.

mod storage;

use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Marks a type that may travel: fixed layout, no pointers.
pub use iceoryx2::prelude::ZeroCopySend;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::{DegradationAction, DegradationInfo};
use iceoryx2::prelude::{PortFactory as _, *};
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use storage::{FileService, allocate_own, config, reason};
pub use storage::{LEAST_DEPTH, bytes_needed, makers, observer_depth};

use crate::Topic;
use crate::domain::Domain;
use crate::integrity::checksum;
use crate::message::{Actuators, Controls, Message, Reference, State};
use crate::rehearsal::Rehearse;

/// Queue of a node: the newest value wins, one more in case it arrives between two looks.
pub const NODE_DEPTH: usize = 2;
/// Publishers per topic: the node, who takes over from it, and dead ones that are not cleaned away yet.
const MAX_PUBLISHERS: usize = 16;
/// Subscribers per topic: three nodes and who stands by each, two recorders, launcher; of each node and of the recorder as
/// many dead ones as it takes to give it up, if none is cleaned away yet. A publisher sets memory aside for each.
const MAX_SUBSCRIBERS: usize = 24;
const MAX_NODES: usize = 48;

/// Why a port cannot be had. The text names the topic and what to do.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The service refused, with iceoryx2's own word for it.
    #[error("topic '{topic}': {reason}; if the stack is of another version, stop it and start all of it again")]
    Service {
        /// Which topic.
        topic: &'static str,
        /// What iceoryx2 said.
        reason: String,
    },
    /// Who speaks there cannot be heard.
    #[error("topic '{topic}': its publisher cannot be heard, for its files in shared memory are gone; fly again")]
    Deaf {
        /// Which topic.
        topic: &'static str,
    },
    /// The domain itself.
    #[error("shared memory of this run: {0}")]
    Domain(String),
}

/// Sends one kind of message.
pub trait Send<M>: Rehearse {
    /// Hands `message` to every subscriber; the number of those, 0 when it could not be sent.
    fn send(&self, message: &M) -> usize;
    /// The number of this port, which no other one has, and which every message carries that goes through it.
    fn number(&self) -> u64;
}

/// Receives one kind of message.
pub trait Receive<M> {
    /// The oldest message not yet seen, if any, and the number of the port that it was sent through.
    fn receive(&self) -> Option<(M, u64)>;
}

/// A process's attachment to a domain.
pub struct Bus {
    node: Node<FileService>,
    domain: Domain,
}

/// Keeps the four services of a run in being, and counts who has joined them.
pub struct Services {
    state: PortFactory<FileService, State, ()>,
    reference: PortFactory<FileService, Reference, ()>,
    controls: PortFactory<FileService, Controls, ()>,
    actuators: PortFactory<FileService, Actuators, ()>,
}

impl Bus {
    /// Attaches this process to `domain`.
    pub fn attach(domain: &Domain) -> Result<Self, PortError> {
        set_log_level(LogLevel::Fatal); // errors come back as values; the loop must not print
        let node = NodeBuilder::new()
            .config(&config(domain)?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<FileService>()
            .map_err(|e| PortError::Domain(reason(e)))?;
        Ok(Self { node, domain: domain.clone() })
    }

    /// Removes what processes that died have left in the services; the launcher's part. May take tens of milliseconds.
    pub fn bury_the_dead(&self) {
        // What cannot be removed now is left for the wiping at the end of the run.
        let _ = self.node.try_cleanup_dead_nodes();
    }

    /// Creates the four services, with queues of up to `depth`; the launcher's part.
    pub fn create_services(&self, depth: usize) -> Result<Services, PortError> {
        Ok(Services {
            state: create(&self.node, depth)?,
            reference: create(&self.node, depth)?,
            controls: create(&self.node, depth)?,
            actuators: create(&self.node, depth)?,
        })
    }

    /// Opens the sending side of `M`'s topic.
    pub fn sender<M: Wire>(&self) -> Result<Rc<dyn Send<M>>, PortError> {
        let port = M::sender(&self.node)?;
        allocate_own(&self.domain)?;
        Ok(port)
    }

    /// Tries to open `M`'s topic as a process that was built when messages were laid out otherwise: to be refused.
    pub fn open_as_another_version<M: Wire>(&self) -> Result<(), PortError> {
        M::open_as_another_version(&self.node)
    }

    /// Opens the receiving side of `M`'s topic with a queue of `depth`; refused if it cannot hear the port number
    /// `speaker` (0 = nobody in particular), as when the segments of that one have been removed.
    pub fn receiver<M: Wire>(&self, depth: usize, speaker: u64) -> Result<Box<dyn Receive<M>>, PortError> {
        let port = M::receiver(&self.node, depth, speaker)?;
        allocate_own(&self.domain)?;
        Ok(port)
    }
}

impl Services {
    /// How many publishers and subscribers a topic has now: what readiness is judged by.
    pub fn joined(&self, topic: Topic) -> (usize, usize) {
        let config = match topic {
            Topic::State => self.state.dynamic_config(),
            Topic::Reference => self.reference.dynamic_config(),
            Topic::Controls => self.controls.dynamic_config(),
            Topic::Actuators => self.actuators.dynamic_config(),
        };
        (config.number_of_publishers(), config.number_of_subscribers())
    }
}

/// A message that can travel: the four of [`crate::message`], and no other.
pub trait Wire: Message {
    #[doc(hidden)]
    fn sender(node: &Node<FileService>) -> Result<Rc<dyn Send<Self>>, PortError>;
    #[doc(hidden)]
    fn receiver(node: &Node<FileService>, depth: usize, speaker: u64) -> Result<Box<dyn Receive<Self>>, PortError>;
    #[doc(hidden)]
    fn open_as_another_version(node: &Node<FileService>) -> Result<(), PortError>;
}

macro_rules! wire {
    ($($name:ident),*) => {$(
        impl Wire for $name {
            fn sender(node: &Node<FileService>) -> Result<Rc<dyn Send<Self>>, PortError> {
                let port = open::<Self>(node, &layout::<Self>())?.publisher_builder().create().map_err(refused::<Self>)?;
                Ok(Rc::new(port))
            }
            fn receiver(
                node: &Node<FileService>,
                depth: usize,
                speaker: u64,
            ) -> Result<Box<dyn Receive<Self>>, PortError> {
                let deaf = Arc::new(AtomicBool::new(false));
                let note = deaf.clone();
                let failed = move |_, info: &DegradationInfo| {
                    // Of anybody else it reads as silence, which every receiver judges.
                    note.fetch_or(numbered(info.sender_port_id) == speaker, Ordering::Relaxed);
                    DegradationAction::Ignore
                };
                let builder = open::<Self>(node, &layout::<Self>())?;
                let builder = builder.subscriber_builder().buffer_size(depth).set_degradation_handler(failed);
                let port = builder.create().map_err(refused::<Self>)?;
                let deaf = deaf.load(Ordering::Relaxed);
                if deaf { Err(PortError::Deaf { topic: Self::TOPIC.name() }) } else { Ok(Box::new(port)) }
            }
            fn open_as_another_version(node: &Node<FileService>) -> Result<(), PortError> {
                open::<Self>(node, &"0".repeat(16)).map(drop)
            }
        }
    )*};
}
wire!(State, Reference, Controls, Actuators);

impl<M: Message + ZeroCopySend> Send<M> for Publisher<FileService, M, ()> {
    fn send(&self, message: &M) -> usize {
        self.send_copy(*message).unwrap_or(0)
    }

    fn number(&self) -> u64 {
        numbered(self.id().value())
    }
}

impl<M: Message + ZeroCopySend> Rehearse for Publisher<FileService, M, ()> {
    fn rehearse(&self) {
        drop(self.loan_uninit()); // the better half of a send
    }
}

impl<M: Message + ZeroCopySend> Receive<M> for Subscriber<FileService, M, ()> {
    fn receive(&self) -> Option<(M, u64)> {
        // A failed connection reads as silence: the age of the data is what every receiver judges.
        let sample = <Subscriber<FileService, M, ()>>::receive(self).ok().flatten()?;
        Some((*sample, numbered(sample.header().publisher_id().value())))
    }
}

/// A publisher's identity (process, time, count) as one word.
fn numbered(id: u128) -> u64 {
    checksum(&[id as u64, (id >> 64) as u64])
}

fn create<M: Message + ZeroCopySend>(
    node: &Node<FileService>,
    depth: usize,
) -> Result<PortFactory<FileService, M, ()>, PortError> {
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

fn open<M: Message + ZeroCopySend>(
    node: &Node<FileService>,
    layout: &str,
) -> Result<PortFactory<FileService, M, ()>, PortError> {
    let mut attributes = AttributeVerifier::new();
    attributes = attributes.require(&layout_key()?, &attribute(layout)?).map_err(refused::<M>)?;
    node.service_builder(&service_name::<M>()?)
        .publish_subscribe::<M>()
        .open_with_attributes(&attributes)
        .map_err(refused::<M>)
}

fn service_name<M: Message>() -> Result<ServiceName, PortError> {
    ServiceName::new(&format!("trefoil/{}", M::TOPIC.name())).map_err(refused::<M>)
}

fn layout_key() -> Result<AttributeKey, PortError> {
    AttributeKey::new(b"layout").map_err(|e| PortError::Domain(format!("{e:?}")))
}

/// iceoryx2 compares name, size and alignment of a type; two layouts of one size would pass. This attribute tells
/// them apart: a hash of the default message as printed, which shows names, order, nesting, lengths and number kinds.
fn layout<M: Message>() -> String {
    let fnv = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    let hash = format!("{:?}", M::default()).bytes().fold(0xcbf2_9ce4_8422_2325, fnv);
    format!("{hash:016x}")
}

fn attribute(value: &str) -> Result<AttributeValue, PortError> {
    AttributeValue::new(value.as_bytes()).map_err(|e| PortError::Domain(format!("{e:?}")))
}

fn refused<M: Message>(error: impl std::fmt::Debug) -> PortError {
    PortError::Service { topic: M::TOPIC.name(), reason: reason(error) }
}
