//! The order in which a log is told: tick by tick, as the ring turned.
//!
//! A recorder empties its queues topic by topic, so that a log is in this order only from one look to the next.

use std::collections::VecDeque;

use contract::Topic;

use super::Record;

/// Messages that are held back until the order among their topics is known: more than the queues of a recorder hold.
const HELD_BACK: usize = 16_384;

/// Tells messages tick by tick as they are read. Each topic keeps its order of writing, and no more than a limit is held.
pub struct TickByTick<F> {
    waiting: [VecDeque<(u64, Record)>; Topic::COUNT],
    held: usize,
    each: F,
}

impl<F: FnMut(&Record)> TickByTick<F> {
    pub fn new(each: F) -> Self {
        Self { waiting: Default::default(), held: 0, each }
    }

    pub fn push(&mut self, record: &Record) {
        self.waiting[record.topic() as usize].push_back((tick(record), *record));
        self.held += 1;
        if self.held > HELD_BACK {
            self.tell();
        }
    }

    /// Tells what is left.
    pub fn finish(mut self) {
        while self.held > 0 {
            self.tell();
        }
    }

    fn tell(&mut self) {
        let ticks = self.waiting.each_ref().map(|of_topic| of_topic.front().map(|(tick, _)| *tick));
        if let Some((_, record)) = next(ticks).and_then(|topic| self.waiting[topic as usize].pop_front()) {
            self.held -= 1;
            (self.each)(&record);
        }
    }
}

/// The tick by which a message is put in order. One that is damaged tells none, and is not waited for.
pub fn tick(record: &Record) -> u64 {
    if record.is_intact() { record.stamp().tick } else { 0 }
}

/// The last tick that a log of so many `messages` can tell of, though most of the flight may be missing in it: a damaged stamp must
/// not decide how much memory and time a log takes.
pub fn last_tick(messages: u64) -> u64 {
    1_000_000 + 10 * messages
}

/// The topic whose next message comes first; `None` when none has one.
pub fn next(ticks: [Option<u64>; Topic::COUNT]) -> Option<Topic> {
    let known = Topic::ALL.into_iter().filter(|topic| ticks[*topic as usize].is_some());
    known.min_by_key(|topic| ticks[*topic as usize])
}
