//! Sorts the messages of a log tick by tick, and within a tick by their order in the ring, TRUTH first.
//!
//! A recorder empties its queues topic by topic, so a log is in this order only from one emptying to the next.

use std::collections::VecDeque;

use contract::Topic;

use super::Record;

/// Number of messages held back until the order of their topics is known: more than the queues of a recorder hold.
const HELD_BACK: usize = 16_384;

/// Passes messages on tick by tick while they are read. Messages of one kind keep their order of writing.
pub struct TickByTick<F> {
    /// Messages by [`Record::kind`], each with its tick.
    waiting: [VecDeque<(u64, Record)>; Record::KINDS],
    held: usize,
    each: F,
}

impl<F: FnMut(&Record)> TickByTick<F> {
    pub fn new(each: F) -> Self {
        Self { waiting: Default::default(), held: 0, each }
    }

    pub fn push(&mut self, record: &Record) {
        self.waiting[record.kind()].push_back((tick(record), *record));
        self.held += 1;
        if self.held > HELD_BACK {
            self.tell();
        }
    }

    /// Passes on all messages that are still held.
    pub fn finish(mut self) {
        while self.held > 0 {
            self.tell();
        }
    }

    fn tell(&mut self) {
        let ticks = self.waiting.each_ref().map(|of_kind| of_kind.front().map(|(tick, _)| *tick));
        if let Some((_, record)) = next(ticks).and_then(|kind| self.waiting[kind].pop_front()) {
            self.held -= 1;
            (self.each)(&record);
        }
    }
}

/// Returns the tick by which a message is sorted: 0 for a damaged message, which does not wait for others.
pub fn tick(record: &Record) -> u64 {
    if record.is_intact() { record.tick() } else { 0 }
}

/// Returns the largest tick that a log of this many `messages` can have, even if most of the flight is missing. Larger
/// ticks come from damaged stamps, which must not decide how much memory and time a log takes.
pub fn last_tick(messages: u64) -> u64 {
    1_000_000 + 10 * messages
}

/// Returns the [kind](Record::kind) of the message that comes first, given the tick of the next message of each kind;
/// `None` if there is no message.
pub fn next(ticks: [Option<u64>; Record::KINDS]) -> Option<usize> {
    let in_order = std::iter::once(Topic::COUNT).chain(0..Topic::COUNT);
    in_order.filter(|kind| ticks[*kind].is_some()).min_by_key(|kind| ticks[*kind])
}
