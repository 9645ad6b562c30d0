//! One message of any topic, as observers of the ring get it.

use std::any::Any;

use contract::Topic;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State};
use contract::stamp::delivery;

/// Evaluates an expression with the message in a record, for any topic.
#[macro_export]
macro_rules! with_message {
    ($record:expr, $message:ident => $value:expr) => {
        match $record {
            $crate::record::Record::State($message) => $value,
            $crate::record::Record::Reference($message) => $value,
            $crate::record::Record::Controls($message) => $value,
            $crate::record::Record::Actuators($message) => $value,
        }
    };
}

/// One message of any topic.
#[derive(Debug, Clone, Copy, PartialEq)]
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

    /// Returns the words of the message in memory.
    pub fn words(&self) -> &[u64] {
        with_message!(self, message => bytemuck::cast_slice(bytemuck::bytes_of(message)))
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
