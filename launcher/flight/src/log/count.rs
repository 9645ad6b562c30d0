//! The count: every message of the processes in office once, and the gaps between them.
//!
//! What faults make of a message bears its number once more, as do late and double ones; a message that was lost on
//! purpose is there too, marked. So a gap in the numbers is a message that the one who counts has missed.

use contract::Topic;
use contract::message::{Message, Stamp};

use super::Record;

/// The newest stamp of each process that works for a node: one in office, one in its shadow, whose epochs differ in the
/// last bit ([`runtime::office`]).
#[derive(Debug, Default)]
pub struct Count([[Stamp; 2]; Topic::COUNT]);

impl Count {
    /// The stamp before this one of the same process, number 0 where there is none; `None` when this message is not to be
    /// counted: unheard because its publisher works in another's shadow, not whole, or counted before.
    pub fn before(&mut self, record: &Record) -> Option<Stamp> {
        let stamp = record.stamp();
        if !record.is_whole() {
            return None;
        }
        let newest = &mut self.0[record.topic() as usize][stamp.epoch as usize % 2];
        let before = if newest.epoch == stamp.epoch { *newest } else { Stamp::default() };
        if stamp.sequence <= before.sequence {
            return None;
        }
        *newest = *stamp;
        (!stamp.in_shadow()).then_some(before)
    }

    /// How many messages were missed just before this one, if it is to be counted.
    pub fn gap(&mut self, record: &Record) -> Option<u64> {
        self.before(record).map(|before| record.stamp().sequence - before.sequence - 1)
    }
}

/// Those of one topic's `messages` that count, each with the stamp before it of the same process.
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
    use contract::stamp::unheard;

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
        assert_eq!(gap(1, 5, unheard::HEARD), None, "twice");
        let Record::State(mut bent) = sent(1, 6, unheard::HEARD) else { unreachable!("a state") };
        bent.status = 7;
        assert_eq!(count.gap(&bent.into()), None);
    }

    #[test]
    fn who_works_in_the_shadow_is_followed_and_not_counted() {
        let mut count = Count::default();
        let mut gap = |epoch, sequence, unheard| count.gap(&sent(epoch, sequence, unheard));
        assert_eq!(gap(1, 1, unheard::HEARD), Some(0));
        assert_eq!(gap(2, 1, unheard::SHADOW), None);
        assert_eq!(gap(2, 2, unheard::SHADOW | unheard::FAULT), None, "what a fault has struck neither");
        assert_eq!(gap(1, 4, unheard::HEARD), Some(2), "the one in office goes on where it was");
        assert_eq!(gap(2, 5, unheard::HEARD), Some(2), "took over, and two were missed");
        assert_eq!(gap(1, 5, unheard::SHADOW), None);
        assert_eq!(gap(1, 6, unheard::HEARD), Some(0), "has it back");
    }

    #[test]
    fn the_stamp_before_is_that_of_the_same_process() {
        let message = |epoch, sequence, unheard, misses| {
            let stamp = Stamp { epoch, sequence, unheard, misses, ..Stamp::default() };
            State { stamp, ..State::default() }.sealed()
        };
        let messages = [
            message(1, 1, unheard::HEARD, 3),
            message(2, 1, unheard::SHADOW, 20),
            message(2, 2, unheard::HEARD, 21),
            message(1, 2, unheard::SHADOW, 4),
            message(1, 3, unheard::HEARD, 4),
        ];
        let misses: Vec<_> =
            counted(&messages).map(|(m, before)| (m.stamp.epoch, m.stamp.misses, before.misses)).collect();
        assert_eq!(misses, [(1, 3, 0), (2, 21, 20), (1, 4, 4)]);
    }

    #[test]
    fn who_comes_late_has_missed_the_beginning() {
        assert_eq!(Count::default().gap(&sent(1, 4, unheard::HEARD)), Some(3));
    }
}
