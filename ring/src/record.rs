//! One message of the ring, or TRUTH, as observers get it.

use std::any::Any;

use contract::Topic;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State, Truth};

/// Evaluates an expression with the message in a record, whatever its type.
#[macro_export]
macro_rules! with_message {
    ($record:expr, $message:ident => $value:expr) => {
        match $record {
            $crate::record::Record::State($message) => $value,
            $crate::record::Record::Reference($message) => $value,
            $crate::record::Record::Controls($message) => $value,
            $crate::record::Record::Actuators($message) => $value,
            $crate::record::Record::Truth($message) => $value,
        }
    };
}

/// One message of any topic, or TRUTH.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Record {
    State(State),
    Reference(Reference),
    Controls(Controls),
    Actuators(Actuators),
    Truth(Truth),
}

impl Record {
    /// Number of kinds of records.
    pub const KINDS: usize = Topic::COUNT + 1;

    /// Returns the number of the record's kind: the number of the topic, or [`Topic::COUNT`] for TRUTH.
    pub fn kind(&self) -> usize {
        self.stamped().map_or(Topic::COUNT, |(topic, _)| topic as usize)
    }

    /// Returns topic, provenance and timing of the message; `None` for TRUTH.
    pub fn stamped(&self) -> Option<(Topic, &Stamp)> {
        match self {
            Self::State(message) => Some((Topic::State, message.stamp())),
            Self::Reference(message) => Some((Topic::Reference, message.stamp())),
            Self::Controls(message) => Some((Topic::Controls, message.stamp())),
            Self::Actuators(message) => Some((Topic::Actuators, message.stamp())),
            Self::Truth(_) => None,
        }
    }

    /// Returns the sample that the message answers to.
    pub fn tick(&self) -> u64 {
        match self {
            Self::Truth(truth) => truth.tick,
            _ => self.stamped().map_or(0, |(_, stamp)| stamp.tick),
        }
    }

    /// Returns the message with its stamp changed and a valid checksum; TRUTH, which has no stamp, as it is.
    #[must_use]
    pub fn with_stamp(&self, change: impl FnOnce(&mut Stamp)) -> Self {
        fn changed<M: Message + Into<Record>>(message: &M, change: impl FnOnce(&mut Stamp)) -> Record {
            let mut message = *message;
            change(message.stamp_mut());
            message.with_checksum().into()
        }
        match self {
            Self::State(message) => changed(message, change),
            Self::Reference(message) => changed(message, change),
            Self::Controls(message) => changed(message, change),
            Self::Actuators(message) => changed(message, change),
            Self::Truth(truth) => Self::Truth(*truth),
        }
    }

    /// Returns the words of the message in memory.
    pub fn words(&self) -> &[u64] {
        with_message!(self, message => bytemuck::cast_slice(bytemuck::bytes_of(message)))
    }

    /// Returns the message, whatever its type.
    pub fn as_any(&self) -> &dyn Any {
        with_message!(self, message => message)
    }

    /// Returns the message; `None` if it is of another type than `M`.
    pub fn message<M: 'static>(&self) -> Option<&M> {
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
record_from!(State, Reference, Controls, Actuators, Truth);
