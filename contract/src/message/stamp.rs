//! What all messages have in common: the stamp, which says which plant sample a message descends from, through which
//! messages, and when each was published.

use bytemuck::{Pod, Zeroable};

use crate::Topic;
use crate::integrity::checksum;
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

/// What all four messages have in common.
pub trait Message: Pod + Default + std::fmt::Debug + Send {
    /// The topic it travels on.
    const TOPIC: Topic;
    /// Provenance and timing.
    fn stamp(&self) -> &Stamp;
    /// The same, for the process that publishes it.
    fn stamp_mut(&mut self) -> &mut Stamp;

    /// Whether every number that a receiver computes with is finite and within its limit.
    fn plausible(&self) -> bool;

    /// Whether it says that the flight is over: then it is sent however late it is.
    fn is_last(&self) -> bool {
        false
    }

    /// The message with the checksum that its bits have.
    #[must_use]
    fn with_checksum(mut self) -> Self {
        self.stamp_mut().checksum = 0;
        self.stamp_mut().checksum = checksum(&self);
        self
    }

    /// Whether the checksum fits the bits.
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
    /// The instant that sample stands for: the plant's release time (in lockstep, the moment at which its tick was begun).
    pub sample_ns: u64,
    /// Number of this message among those of its publisher, from 1; 0 means no message yet.
    pub sequence: u64,
    /// Incarnation of the publisher, from 1; two with the same numbers are never the same process.
    pub epoch: u64,
    /// Sequence numbers of the messages it was computed from, by topic; 0 where none was used. In the place of its own topic
    /// stand the ticks that another process of the node had done, where its publisher continues from the memory of that.
    pub inputs: [u64; Topic::COUNT],
    /// The epochs of those messages, and of that process.
    pub input_epochs: [u64; Topic::COUNT],
    /// Publication times along the chain, by topic, up to and including this message.
    pub publish_ns: [u64; Topic::COUNT],
    /// When the publisher was due: the release for the plant; for the others when their input was sent, or when it was late; in
    /// lockstep when it woke.
    pub release_ns: u64,
    /// When the publisher began to work on it.
    pub start_ns: u64,
    /// CPU time its thread used for the previous cycle, warm-up included (`runtime::cycle_timing`) \[ns\].
    pub cpu_ns: u64,
    /// Deadlines the publisher has missed so far.
    pub misses: u64,
    /// Periods the publisher has skipped so far.
    pub slips: u64,
    /// In lockstep and in process: how long faults delayed the chain from the sample to here, in all nodes \[ns\].
    pub held_ns: u64,
    /// Faults given in flight that its publisher knew of: entries and changes of the fault table (`runtime::fault_table`).
    pub faults: u64,
    /// Whether receivers act on this message, and if not why: see [`delivery`].
    pub delivery: u64,
    /// See [`Message::with_checksum`].
    pub checksum: u64,
}

/// Bits of [`Stamp::delivery`]; a message may have several.
pub mod delivery {
    /// Receivers act on it.
    pub const DELIVERED: u64 = 0;
    /// The publisher is on standby: another process is active.
    pub const STANDBY: u64 = 1;
    /// A fault lost or changed it. What is delivered in its place, if anything, is another message with the same number.
    pub const FAULT: u64 = 2;
    /// It has no content: it shows a receiver that messages of the publisher arrive.
    pub const PROBE: u64 = 4;
    /// It missed its deadline, whose policy withholds it. It shows what was computed; its number is that of the message that
    /// is sent in its place, or next.
    pub const LATE: u64 = 8;
}

impl Stamp {
    /// Provenance of a message that answers to sample `tick`, with no inputs yet.
    pub fn at(tick: u64, sample_ns: u64) -> Self {
        Self { tick, sample_ns, ..Self::default() }
    }

    /// The same, computed from `parent` too. The times of a parent of an older sample are not part of this chain.
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

    /// Whether receivers act on the message.
    pub fn is_delivered(&self) -> bool {
        self.delivery == delivery::DELIVERED
    }

    /// Whether its publisher was on standby.
    pub fn is_standby(&self) -> bool {
        self.delivery & delivery::STANDBY != 0
    }

    /// Whether a fault lost or changed it, so that it only shows what the publisher computed.
    pub fn is_faulted(&self) -> bool {
        self.delivery & delivery::FAULT != 0
    }

    /// Whether its deadline's policy withheld it.
    pub fn is_withheld(&self) -> bool {
        self.delivery & delivery::LATE != 0
    }

    /// The stamp of a probe, the first message of a process: see [`delivery::PROBE`].
    pub fn probe(epoch: u32) -> Self {
        Self { epoch: u64::from(epoch), delivery: delivery::PROBE, ..Self::default() }
    }

    /// Whether it is the stamp of a probe.
    pub fn is_probe(&self) -> bool {
        self.delivery == delivery::PROBE
    }

    /// The stamp of the message itself, once it is numbered and on its way.
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
