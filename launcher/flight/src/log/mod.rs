//! The flight log: every message of every topic, and every event, in one MCAP file that Foxglove, `PlotJuggler` and
//! Python can read.
//!
//! | in the file | is |
//! |---|---|
//! | topics `/state` `/reference` `/controls` `/actuators` | the messages, as the protobuf of `proto/trefoil.proto` |
//! | topic `/memory` | the snapshot of every node, every ten seconds, as protobuf ([`Memory`]) |
//! | topic `/events` | events of the processes, as protobuf ([`crate::event`]) |
//! | `log_time` | simulated time, the stamp's tick times the sample time: one time axis for runs of every mode |
//! | `publish_time` | instant of publication, `CLOCK_MONOTONIC`; 0 for events, and in process, which has no clock |
//! | metadata `scenario`, key `toml` | the run's merged settings, the first record of the file |
//! | metadata `trefoil` | version and commit of the writer, layout of the messages, run, and the two time rules above |
//!
//! The log survives its writer: [`LogWriter`] closes a chunk every 64 KiB and every second, a killed process loses no
//! more than that, and [`read()`] reads what is there. No node writes a log, because one write can take milliseconds.

/// Evaluates an expression with the message in a record, for any topic.
macro_rules! with_message {
    ($record:expr, $message:ident => $value:expr) => {
        match $record {
            Record::State($message) => $value,
            Record::Reference($message) => $value,
            Record::Controls($message) => $value,
            Record::Actuators($message) => $value,
        }
    };
}

pub(crate) use with_message;

mod count;
mod index;
mod join;
mod memory;
mod order;
mod read;
mod schema;
#[cfg(test)]
mod tests;
mod write;

use std::any::Any;

use contract::stamp::delivery;
use contract::{
    Topic,
    message::{Actuators, Controls, Message, Reference, Stamp, State},
};

pub use count::{Count, counted};
pub use index::{ALL, Span};
pub use join::{join, memories, part, read_parts, rest, stream};
pub use memory::Memory;
pub use order::last_tick;
pub use read::{Log, WrittenBy, read};
pub use write::LogWriter;

/// One message of any topic.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "a record lives for a moment, and a box would cost an allocation for each message"
)]
pub enum Record {
    State(State),
    Reference(Reference),
    Controls(Controls),
    Actuators(Actuators),
}

impl Record {
    /// Returns the topic of the message.
    pub fn topic(&self) -> Topic {
        match self {
            Self::State(_) => Topic::State,
            Self::Reference(_) => Topic::Reference,
            Self::Controls(_) => Topic::Controls,
            Self::Actuators(_) => Topic::Actuators,
        }
    }

    /// Returns the provenance and timing of the message.
    pub fn stamp(&self) -> &Stamp {
        with_message!(self, message => message.stamp())
    }

    /// Returns the message as receivers would get it without faults: marked as delivered, with a valid checksum.
    #[must_use]
    pub fn as_delivered(&self) -> Self {
        fn delivered<M: Message>(mut message: M) -> M {
            message.stamp_mut().delivery = delivery::DELIVERED;
            message.with_checksum()
        }
        with_message!(*self, message => delivered(message).into())
    }

    /// Returns the message, whatever its type.
    pub fn as_any(&self) -> &dyn Any {
        with_message!(self, message => message)
    }

    /// Returns the message; `None` if it is no `M`.
    pub fn message<M: Message>(&self) -> Option<&M> {
        self.as_any().downcast_ref()
    }

    /// Returns whether the checksum fits the bits.
    pub fn is_intact(&self) -> bool {
        with_message!(self, message => message.is_intact())
    }
}

macro_rules! record_from {
    ($($name:ident),*) => {$(
        impl From<$name> for Record {
            fn from(message: $name) -> Self {
                Self::$name(message)
            }
        }
    )*};
}
record_from!(State, Reference, Controls, Actuators);

/// Name of the metadata record that holds the scenario, and its key there.
const SCENARIO: (&str, &str) = ("scenario", "toml");
/// Name of the metadata record with the program and the run that wrote the log.
const WRITTEN_BY: &str = "trefoil";
const EVENTS: &str = "/events";
const MEMORY: &str = "/memory";
