//! The count: every message of the processes in office once, and the gaps between them.
//!
//! What faults make of a message bears its number once more, as do late and double ones; a message that was lost on
//! purpose is there too, marked. So a gap in the numbers is a message that the one who counts has missed.

use contract::Topic;
use contract::stamp::unheard;

use super::Record;

/// The newest message of each topic: epoch and number.
#[derive(Debug, Default)]
pub struct Count([(u64, u64); Topic::COUNT]);

impl Count {
    /// How many messages were missed just before this one; `None` when this one is not to be counted: unheard because its
    /// publisher works in another's shadow, not whole, or counted before.
    pub fn gap(&mut self, record: &Record) -> Option<u64> {
        let stamp = record.stamp();
        if stamp.unheard == unheard::SHADOW || !record.is_whole() {
            return None;
        }
        let (epoch, newest) = &mut self.0[record.topic() as usize];
        if *epoch != stamp.epoch {
            // A process that takes over counts from one; one that worked in the shadow before is further.
            let gap = if *epoch == 0 { stamp.sequence.saturating_sub(1) } else { 0 };
            (*epoch, *newest) = (stamp.epoch, stamp.sequence);
            return Some(gap);
        }
        let gap = stamp.sequence.checked_sub(newest.checked_add(1)?)?;
        *newest = stamp.sequence;
        Some(gap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Message, Stamp, State};

    fn sent(epoch: u64, sequence: u64, unheard: u64) -> Record {
        let stamp = Stamp { epoch, sequence, unheard, ..Stamp::default() };
        State { stamp, ..State::default() }.sealed().into()
    }

    #[test]
    fn every_message_counts_once() {
        let mut count = Count::default();
        let mut gap = |epoch, sequence, unheard| count.gap(&sent(epoch, sequence, unheard));
        assert_eq!(gap(1, 1, unheard::HEARD), Some(0));
        assert_eq!(gap(1, 2, unheard::FAULT), Some(0), "lost on the way, not on us");
        assert_eq!(gap(1, 2, unheard::HEARD), None, "what came of it");
        assert_eq!(gap(1, 5, unheard::HEARD), Some(2));
        assert_eq!(gap(2, 9, unheard::SHADOW), None);
        assert_eq!(gap(2, 10, unheard::HEARD), Some(0), "took over");
        let Record::State(mut bent) = sent(2, 11, unheard::HEARD) else { unreachable!("a state") };
        bent.status = 7;
        assert_eq!(count.gap(&bent.into()), None);
    }

    #[test]
    fn who_comes_late_has_missed_the_beginning() {
        assert_eq!(Count::default().gap(&sent(1, 4, unheard::HEARD)), Some(3));
    }
}
