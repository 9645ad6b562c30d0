//! Ports, through which messages leave a node and reach it.
//!
//! | module | holds |
//! |---|---|
//! | `shared_memory`, `storage` | ports between processes, by iceoryx2 |
//! | `descriptors` | descriptors of iceoryx2, checked before iceoryx2 uses their numbers |
//! | [`crate::queue`] | ports of one thread |
//!
//! The rest of the crate uses ports through [`SendPort`] and [`ReceivePort`].

#[cfg(target_os = "linux")]
mod descriptors;
#[cfg(target_os = "linux")]
mod shared_memory;
#[cfg(target_os = "linux")]
mod storage;

pub use crate::error::{PortError, PortFailure};
use crate::limits::{MAX_OBSERVER_DEPTH, OBSERVER_S};
pub use crate::limits::{MIN_OBSERVER_DEPTH, NODE_DEPTH};
#[cfg(target_os = "linux")]
pub use shared_memory::{Bus, Services};
#[cfg(target_os = "linux")]
pub use storage::{bytes_needed, makers};

/// Port that can touch its memory without any other effect.
pub trait WarmUp {
    /// Touches the memory that the next send will use.
    fn warm_up(&self);
}

/// Port that sends one kind of message.
pub trait SendPort<M>: WarmUp {
    /// Sends `message` to every subscriber that can be reached.
    ///
    /// # Errors
    /// No subscriber could be reached.
    fn send(&self, message: &M) -> Result<(), PortFailure>;
    /// Unique number of this port, which receivers get with every message sent through it.
    fn number(&self) -> u64;
}

/// Port that receives one kind of message.
pub trait ReceivePort<M> {
    /// Passes the oldest unread message, if any, to `take`, with the number of the port that it was sent through.
    /// Returns whether there was a message. The message does not change during `take`. In process, `take` must not send
    /// on the topic.
    ///
    /// # Errors
    /// The queue could not be read. A publisher that cannot be reached looks like one that sends nothing.
    fn receive(&self, take: &mut dyn FnMut(&M, u64)) -> Result<bool, PortFailure>;
    /// Returns whether a connection to the publisher behind `port` was tried and failed.
    fn cannot_reach(&self, port: u64) -> bool;
    /// Connects to every publisher anew, with an empty queue; too slow to be called in the loop.
    fn reconnect(&self) -> Result<(), PortError>;
}

/// Depth of the queues of recorder and launcher, which must receive every message, at `rate_hz` \[messages\].
pub fn observer_depth(rate_hz: u32) -> usize {
    (rate_hz as usize * OBSERVER_S).clamp(MIN_OBSERVER_DEPTH, MAX_OBSERVER_DEPTH)
}
