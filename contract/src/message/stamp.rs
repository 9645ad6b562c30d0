//! The stamp, with which every message on a topic begins: the plant sample that the message descends from, the messages
//! that it was computed from, and the times at which these were published.

use bytemuck::Pod;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use super::Stamp;
use super::field::Field;
use crate::integrity::checksum;
use crate::topic::Topic;

/// Checks of the content of a message.
pub trait Content {
    /// Returns whether every number that a receiver computes with is finite and within its limit. In STATE, NaN stands
    /// for a position or velocity whose sensor is off.
    fn plausible(&self) -> bool;

    /// Returns whether the message ends the flight; such a message is sent however late it is.
    fn is_last(&self) -> bool {
        false
    }
}

/// Message that a port carries: one of the four of the ring, or TRUTH.
pub trait Payload: Pod + Default + std::fmt::Debug + Send + ZeroCopySend {
    /// Name of the messages: the name of their topic, or `truth`.
    const NAME: &'static str;
    /// All fields, in order.
    const FIELDS: &'static [Field];
}

/// Common interface of the four messages of the ring.
pub trait Message: Content + Payload {
    /// Topic of the message.
    const TOPIC: Topic;
    /// Provenance and timing.
    fn stamp(&self) -> &Stamp;
    /// Mutable provenance and timing, for the process that publishes the message.
    fn stamp_mut(&mut self) -> &mut Stamp;

    /// Returns the message with the checksum of its bits.
    #[must_use]
    fn with_checksum(mut self) -> Self {
        self.stamp_mut().checksum = 0;
        self.stamp_mut().checksum = checksum(&self);
        self
    }

    /// Returns whether the checksum fits the bits.
    fn is_intact(&self) -> bool {
        self.with_checksum().stamp().checksum == self.stamp().checksum
    }
}

/// Bits of [`Stamp::delivery`]; a message may have several.
pub mod delivery {
    /// No bit: receivers act on the message.
    pub const DELIVERED: u64 = 0;
    /// Message of a standby: another process of the node is active.
    pub const STANDBY: u64 = 1;
    /// Message as it was computed, before a fault lost or changed it. A message delivered in its place has the same
    /// sequence number.
    pub const FAULT: u64 = 2;
    /// Message without content, which shows a receiver that messages of the publisher arrive.
    pub const PROBE: u64 = 4;
    /// Message that missed its deadline and is withheld by the policy. The message that is sent in its place has the
    /// same sequence number; without such a message the next one has it.
    pub const LATE: u64 = 8;
}

impl Stamp {
    /// Starts the provenance of a message that answers to sample `tick`, taken at `sample_ns`, without inputs.
    pub fn at(tick: u64, sample_ns: u64) -> Self {
        Self { tick, sample_ns, ..Self::default() }
    }

    /// Adds `parent` to the inputs. If `parent` answers to another sample, its times are not part of this chain.
    #[must_use]
    pub fn with<M: Message>(mut self, parent: &M) -> Self {
        let p = parent.stamp();
        self.inputs[M::TOPIC as usize] = p.sequence;
        self.input_epochs[M::TOPIC as usize] = p.epoch;
        if p.tick == self.tick {
            for (mine, theirs) in self.publish_ns.iter_mut().zip(p.publish_ns) {
                *mine = (*mine).max(theirs);
            }
            self.held_ns = self.held_ns.max(p.held_ns);
        }
        self
    }

    /// Returns whether receivers act on the message.
    pub fn is_delivered(&self) -> bool {
        self.delivery == delivery::DELIVERED
    }

    /// Returns whether the publisher was on standby.
    pub fn is_standby(&self) -> bool {
        self.delivery & delivery::STANDBY != 0
    }

    /// Returns whether a fault has lost or changed the message, so that this copy only shows what was computed.
    pub fn is_faulted(&self) -> bool {
        self.delivery & delivery::FAULT != 0
    }

    /// Returns whether the policy for late messages withheld the message.
    pub fn is_withheld(&self) -> bool {
        self.delivery & delivery::LATE != 0
    }

    /// Stamp of a probe, which a process sends before its first message: see [`delivery::PROBE`].
    pub fn probe(epoch: u32) -> Self {
        Self { epoch: u64::from(epoch), delivery: delivery::PROBE, ..Self::default() }
    }

    /// Returns whether this is the stamp of a probe.
    pub fn is_probe(&self) -> bool {
        self.delivery == delivery::PROBE
    }

    /// Adds the message's own sequence number and publication time.
    #[must_use]
    pub fn published(mut self, topic: Topic, sequence: u64, publish_ns: u64) -> Self {
        self.sequence = sequence;
        self.publish_ns[topic as usize] = publish_ns;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Reference, State};

    #[test]
    fn delivery_tells_standby_and_fault_apart() {
        let marks = |delivery| {
            let stamp = Stamp { delivery, ..Stamp::default() };
            (stamp.is_delivered(), stamp.is_standby(), stamp.is_faulted())
        };
        assert_eq!(marks(delivery::DELIVERED), (true, false, false));
        assert_eq!(marks(delivery::STANDBY), (false, true, false));
        assert_eq!(marks(delivery::FAULT), (false, false, true));
        assert_eq!(marks(delivery::STANDBY | delivery::FAULT), (false, true, true));
    }

    #[test]
    fn provenance_keeps_the_sample_and_collects_the_inputs() {
        let sample = Stamp { tick: 7, sample_ns: 70, ..Stamp::default() };
        let state = State { stamp: Stamp { epoch: 1, ..sample.published(Topic::State, 8, 71) }, ..State::default() };
        let stamp = Stamp::at(7, 70).with(&state).published(Topic::Reference, 9, 72);
        let reference = Reference { stamp, ..Reference::default() };
        let stamp = Stamp::at(7, 70).with(&reference).with(&state).published(Topic::Controls, 10, 73);
        assert_eq!((stamp.tick, stamp.sample_ns, stamp.sequence), (7, 70, 10));
        assert_eq!((stamp.inputs, stamp.input_epochs), ([8, 9, 0, 0], [1, 0, 0, 0]));
        assert_eq!(stamp.publish_ns, [71, 72, 73, 0]);
        let late = Stamp::at(8, 80).with(&reference).published(Topic::Controls, 11, 83);
        assert_eq!((late.inputs, late.publish_ns), ([0, 9, 0, 0], [0, 0, 83, 0]), "an input of the sample before");
    }
}
