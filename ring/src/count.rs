//! Counts every message of the active processes once, and finds the gaps in their sequence numbers.
//!
//! A message that a fault has changed, a late message and a duplicate have the sequence number of the original. A
//! message that a fault has dropped is sent too, marked as such. So a gap means messages that the reader has missed.

use contract::Topic;
use contract::message::{Message, Stamp, Truth};

use crate::record::Record;

/// Count of the messages of all nodes: the newest stamps of the last few processes of each.
#[derive(Debug, Default)]
pub struct Count {
    newest: [[Stamp; PROCESSES]; Topic::COUNT],
    /// Newest sequence number of TRUTH.
    truth: u64,
    /// `true` if the messages carry no checksums.
    unchecked: bool,
}

/// Number of processes followed per node: the active one, a standby, and earlier ones whose messages may still arrive.
const PROCESSES: usize = 4;

impl Count {
    /// Creates a count of messages without checksums.
    pub fn without_checksums() -> Self {
        Self { unchecked: true, ..Self::default() }
    }

    /// Returns the previous stamp of the same process, with sequence number 0 if there is none. `None` if the message
    /// is not counted: its publisher is on standby, it was withheld, it is damaged, or its number is not new. `None`
    /// also for TRUTH, which has no stamp.
    pub fn before(&mut self, record: &Record) -> Option<Stamp> {
        let (topic, stamp) = record.stamped()?;
        if stamp.is_withheld() || !self.unchecked && !record.is_intact() {
            return None;
        }
        let processes = &mut self.newest[topic as usize];
        let known = processes.iter().position(|newest| newest.epoch == stamp.epoch);
        let silent = (0..PROCESSES).min_by_key(|i| (processes[*i].tick, processes[*i].epoch)).unwrap_or(0);
        let newest = &mut processes[known.unwrap_or(silent)];
        let before = if known.is_some() { *newest } else { Stamp::default() };
        if stamp.sequence <= before.sequence {
            return None;
        }
        *newest = *stamp;
        (!stamp.is_standby()).then_some(before)
    }

    /// Returns the number of messages missed just before `record`; `None` if `record` is not counted.
    pub fn gap(&mut self, record: &Record) -> Option<u64> {
        if let Record::Truth(truth) = record {
            return self.gap_of_truth(truth);
        }
        let before = self.before(record)?;
        record.stamped().map(|(_, stamp)| stamp.sequence - before.sequence - 1)
    }

    fn gap_of_truth(&mut self, truth: &Truth) -> Option<u64> {
        if !self.unchecked && !truth.is_intact() {
            return None;
        }
        // A TRUTH whose STATE was withheld has the same number as the TRUTH before.
        let next = self.truth.saturating_add(1);
        self.truth = self.truth.max(truth.sequence);
        Some(truth.sequence.saturating_sub(next))
    }
}

/// Selects the messages of one topic that are counted, each with the previous stamp of the same process.
pub fn counted<M: Message>(messages: &[M]) -> impl Iterator<Item = (&M, Stamp)>
where
    Record: From<M>,
{
    let mut count = Count::default();
    messages.iter().filter_map(move |message| Some((message, count.before(&(*message).into())?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::State;
    use contract::stamp::delivery;

    fn sent(epoch: u64, sequence: u64, delivery: u64) -> Record {
        let stamp = Stamp { epoch, sequence, delivery, ..Stamp::default() };
        State { stamp, ..State::default() }.with_checksum().into()
    }

    #[test]
    fn every_message_counts_once() {
        let mut count = Count::default();
        let mut gap = |epoch, sequence, delivery| count.gap(&sent(epoch, sequence, delivery));
        assert_eq!(gap(1, 1, delivery::DELIVERED), Some(0));
        assert_eq!(gap(1, 2, delivery::FAULT), Some(0), "lost on the way, not on us");
        assert_eq!(gap(1, 2, delivery::DELIVERED), None, "what came of it");
        assert_eq!(gap(1, 5, delivery::DELIVERED), Some(2));
        assert_eq!(gap(1, 5, delivery::DELIVERED), None, "twice");
        let Record::State(mut bent) = sent(1, 6, delivery::DELIVERED) else { unreachable!("a state") };
        bent.status = 7;
        assert_eq!(count.gap(&bent.into()), None);
    }

    #[test]
    fn a_standby_is_followed_and_not_counted() {
        let mut count = Count::default();
        let mut gap = |epoch, sequence, delivery| count.gap(&sent(epoch, sequence, delivery));
        assert_eq!(gap(1, 1, delivery::DELIVERED), Some(0));
        assert_eq!(gap(2, 1, delivery::STANDBY), None);
        assert_eq!(gap(2, 2, delivery::STANDBY | delivery::FAULT), None, "what a fault has struck neither");
        assert_eq!(gap(1, 4, delivery::DELIVERED), Some(2), "the one active goes on where it was");
        assert_eq!(gap(2, 5, delivery::DELIVERED), Some(2), "took over, and two were missed");
        assert_eq!(gap(1, 5, delivery::STANDBY), None);
        assert_eq!(gap(1, 6, delivery::DELIVERED), Some(0), "has it back");
    }

    #[test]
    fn the_stamp_before_is_that_of_the_same_process() {
        let message = |epoch, sequence, delivery, misses| {
            let stamp = Stamp { epoch, sequence, delivery, misses, ..Stamp::default() };
            State { stamp, ..State::default() }.with_checksum()
        };
        let messages = [
            message(1, 1, delivery::DELIVERED, 3),
            message(2, 1, delivery::STANDBY, 20),
            message(2, 2, delivery::DELIVERED, 21),
            message(1, 2, delivery::STANDBY, 4),
            message(1, 3, delivery::DELIVERED, 4),
        ];
        let misses: Vec<_> =
            counted(&messages).map(|(m, before)| (m.stamp.epoch, m.stamp.misses, before.misses)).collect();
        assert_eq!(misses, [(1, 3, 0), (2, 21, 20), (1, 4, 4)]);
    }

    #[test]
    fn a_lost_truth_is_counted() {
        let mut count = Count::default();
        let truth = |sequence| Truth { sequence, ..Truth::default() }.with_checksum();
        let mut gap = |truth: Truth| count.gap(&truth.into());
        assert_eq!([1, 2, 2, 5].map(|sequence| gap(truth(sequence))), [Some(0), Some(0), Some(0), Some(2)]);
        assert_eq!(gap(Truth { tick: 7, ..truth(9) }), None, "damaged");
    }

    #[test]
    fn messages_before_the_first_one_seen_count_as_missed() {
        assert_eq!(Count::default().gap(&sent(1, 4, delivery::DELIVERED)), Some(3));
    }
}
