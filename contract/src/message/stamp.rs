//! The stamp, which all messages have in common: the plant sample that a message descends from, the messages it was
//! computed from, and the time at which each was published.

use bytemuck::{Pod, Zeroable};

use crate::Topic;
use crate::integrity::checksum;
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

/// Common interface of the four messages.
pub trait Message: Pod + Default + std::fmt::Debug + Send {
    /// Topic of the message.
    const TOPIC: Topic;
    /// Provenance and timing.
    fn stamp(&self) -> &Stamp;
    /// Mutable provenance and timing, for the process that publishes the message.
    fn stamp_mut(&mut self) -> &mut Stamp;

    /// Returns whether every number that a receiver computes with is finite and within its limit.
    fn plausible(&self) -> bool;

    /// Returns whether the message ends the flight; such a message is sent however late it is.
    fn is_last(&self) -> bool {
        false
    }

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

/// Provenance and timing of one message. All times are `CLOCK_MONOTONIC` nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct Stamp {
    /// Number of the plant sample; its simulated time is `tick` times the sample time.
    pub tick: u64,
    /// Instant of that sample: the plant's release time; in lockstep, the moment at which its tick began.
    pub sample_ns: u64,
    /// Number of this message among those of its publisher, from 1; 0 = no message yet.
    pub sequence: u64,
    /// Number of the publisher's process among all processes of its node, from 1.
    pub epoch: u64,
    /// Sequence numbers of the messages it was computed from, by topic; 0 = none. The entry of its own topic holds
    /// instead the ticks done by the process whose snapshot the publisher restored; 0 if it restored none.
    pub inputs: [u64; Topic::COUNT],
    /// Epochs of those messages, and of that process.
    pub input_epochs: [u64; Topic::COUNT],
    /// Publication times along the chain, by topic, up to and including this message.
    pub publish_ns: [u64; Topic::COUNT],
    /// Time at which the publisher was due: the release for the plant; for the other nodes the time at which their
    /// input was sent, or became late. In lockstep the time at which the publisher woke.
    pub release_ns: u64,
    /// Time at which the publisher began to work on this message.
    pub start_ns: u64,
    /// CPU time of the publisher's thread in its previous cycle, warm-up included (`runtime::cycle_timing`) \[ns\].
    pub cpu_ns: u64,
    /// Deadlines that the publisher has missed so far.
    pub misses: u64,
    /// Periods that the publisher has skipped so far.
    pub slips: u64,
    /// Delay that faults added in all nodes of the chain from the sample to here, in lockstep and in process \[ns\].
    pub held_ns: u64,
    /// Number of entries and changes of the fault table (`runtime::fault_table`) that the publisher knew of.
    pub faults: u64,
    /// Bits of [`delivery`]: 0 if receivers act on this message, else the reason why not.
    pub delivery: u64,
    /// Checksum of the whole message, computed with this field 0: see [`Message::with_checksum`].
    pub checksum: u64,
}

/// Bits of [`Stamp::delivery`]; a message may have several.
pub mod delivery {
    /// No bit: receivers act on the message.
    pub const DELIVERED: u64 = 0;
    /// Message of a standby: another process of the node is active.
    pub const STANDBY: u64 = 1;
    /// Message as computed, which a fault has lost or changed. A message delivered in its place has the same number.
    pub const FAULT: u64 = 2;
    /// Message without content, which shows a receiver that messages of the publisher arrive.
    pub const PROBE: u64 = 4;
    /// Message as computed, which missed its deadline and is withheld by the policy. Its number is that of the message
    /// that is sent in its place, or of the next one.
    pub const LATE: u64 = 8;
}

impl Stamp {
    /// Starts the provenance of a message that answers to sample `tick`, without inputs.
    pub fn at(tick: u64, sample_ns: u64) -> Self {
        Self { tick, sample_ns, ..Self::default() }
    }

    /// Adds `parent` to the inputs. The times of a parent of another sample are not part of this chain.
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

    /// Returns whether the policy for late messages withheld it.
    pub fn is_withheld(&self) -> bool {
        self.delivery & delivery::LATE != 0
    }

    /// Stamp of a probe, the first message of a process: see [`delivery::PROBE`].
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
