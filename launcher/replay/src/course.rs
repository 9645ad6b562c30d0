//! Progress of one process of a replay, and the messages that it has sent.

use std::collections::VecDeque;

use contract::Topic;
use flight::log::Record;

use crate::program::Program;
use crate::script::Read;
use crate::worker::Worker;

/// Largest number of cycles between sending a message and its delivery.
pub(super) const LATEST: usize = 1000;

/// Runner of the cycles of a process.
pub(super) enum Runs {
    Here(Box<Worker>),
    Elsewhere(Box<Program>),
}

/// Progress of one process.
#[derive(Default)]
pub(super) struct Course {
    pub worker: Option<Runs>,
    /// Index of its next cycle, and of its next recorded message.
    pub cycle: usize,
    pub recorded: usize,
    /// `true` if it waits for a message that never comes.
    pub is_held_up: bool,
    /// `true` if its last cycle was over before the replay begins, so that the next one begins with the logged memory.
    pub follows: bool,
    /// Tick, message as the process meant it, and as it was delivered; `None` if it was not.
    pub sent: VecDeque<(u64, Record, Option<Record>)>,
    /// Last input read, by topic.
    pub read: [Option<Read>; Topic::COUNT],
}

impl Course {
    pub fn sent(&self, tick: u64) -> Option<&(u64, Record, Option<Record>)> {
        let at = self.sent.partition_point(|(sent, ..)| *sent < tick);
        self.sent.get(at).filter(|(sent, ..)| *sent == tick)
    }

    /// Takes in a message that the process sent in the cycle of `tick`.
    pub fn take(&mut self, tick: u64, record: &Record) {
        let Some((_, stamp)) = record.stamped() else { return };
        if !record.is_intact() || stamp.is_withheld() && self.sent(tick).is_some() {
            return;
        }
        let of = |(_, sent, _): &(u64, Record, Option<Record>)| {
            sent.stamped().is_some_and(|(_, sent)| sent.sequence == stamp.sequence && !sent.is_withheld())
        };
        match self.sent.iter_mut().rev().take(LATEST).find(|sent| of(sent)) {
            Some((.., delivered)) if !stamp.is_faulted() => *delivered = Some(*record),
            Some(_) => {}
            None => {
                let delivered = (!stamp.is_faulted() && !stamp.is_withheld()).then_some(*record);
                match self.sent.back_mut() {
                    // This message was sent in the place of one that was withheld.
                    Some(last) if last.0 == tick => *last = (tick, *record, delivered),
                    _ => self.sent.push_back((tick, *record, delivered)),
                }
            }
        }
    }
}
