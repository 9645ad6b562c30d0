//! The stamp: which plant sample a message descends from, through whom, and when.

use crate::Topic;
use crate::message::Message;
use crate::port::ZeroCopySend;

/// Provenance and timing of one message. All times are `CLOCK_MONOTONIC` nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[repr(C)]
pub struct Stamp {
    /// Number of the plant sample; its simulated time is `tick` times the sample time.
    pub tick: u64,
    /// The instant that sample stands for: the plant's release time (in lockstep, its publication).
    pub sample_ns: u64,
    /// Number of this message among those of its publisher, from 1; 0 means no message yet.
    pub sequence: u64,
    /// Incarnation of the publisher, from 1; two with the same numbers are never the same process.
    pub epoch: u64,
    /// Sequence numbers of the messages it was computed from, by topic; 0 where none was used.
    pub inputs: [u64; Topic::COUNT],
    /// Publication times along the chain, by topic, up to and including this message.
    pub publish_ns: [u64; Topic::COUNT],
    /// When the publisher was due: the release for the plant, the arrival of its input for the others.
    pub release_ns: u64,
    /// When the publisher began to work on it.
    pub start_ns: u64,
    /// CPU time its thread used for the previous cycle, rehearsal included ([`crate::rehearsal`]) \[ns\].
    pub cpu_ns: u64,
    /// Deadlines the publisher has missed so far.
    pub misses: u64,
    /// Periods the publisher has skipped so far.
    pub slips: u64,
}

impl Stamp {
    /// Lineage of a message computed from `parent`: the same sample, one station further.
    pub fn of<M: Message>(parent: &M) -> Self {
        let p = parent.stamp();
        Self { tick: p.tick, sample_ns: p.sample_ns, ..Self::default() }.with(parent)
    }

    /// The same, computed from `other` too.
    #[must_use]
    pub fn with<M: Message>(mut self, other: &M) -> Self {
        let o = other.stamp();
        self.inputs[M::TOPIC as usize] = o.sequence;
        for (mine, theirs) in self.publish_ns.iter_mut().zip(o.publish_ns) {
            *mine = (*mine).max(theirs);
        }
        self
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
    fn lineage_keeps_the_sample_and_collects_the_inputs() {
        let sample = Stamp { tick: 7, sample_ns: 70, ..Stamp::default() };
        let state = State { stamp: sample.published(Topic::State, 8, 71), ..State::default() };
        let stamp = Stamp::of(&state).published(Topic::Reference, 9, 72);
        let reference = Reference { stamp, ..Reference::default() };
        let stamp = Stamp::of(&reference).with(&state).published(Topic::Controls, 10, 73);
        assert_eq!((stamp.tick, stamp.sample_ns, stamp.sequence), (7, 70, 10));
        assert_eq!(stamp.inputs, [8, 9, 0, 0]);
        assert_eq!(stamp.publish_ns, [71, 72, 73, 0]);
    }
}
