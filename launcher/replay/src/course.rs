//! Progress of one process of a replay, and the messages that it has sent.

use std::collections::VecDeque;

use contract::Topic;
use flight::log::Record;

use crate::program::Program;
use crate::script::{Key, Read};
use crate::worker::Worker;

/// Largest number of cycles between sending a message and its delivery.
pub(super) const LATEST: usize = 1000;

/// Runner of the cycles of a process.
pub(super) enum Runs {
    Here(Box<Worker>),
    Elsewhere(Box<Program>),
}

/// Cause for which the next cycle of a process waits.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Waits {
    /// No wait: all inputs of the cycle are there.
    Nothing,
    /// A message that was sent but not delivered here; a cycle can run without it, if need be.
    Delivery,
    /// The memory of the process that this process continues.
    Memory,
    /// A message that was not sent here.
    Message(Key),
}

impl Waits {
    /// Describes a wait in vain for people.
    pub fn words(&self) -> String {
        let Self::Message(Key { topic, epoch, tick }) = self else { return "the log is not whole".into() };
        let which = if *tick == u64::MAX { "a message".into() } else { format!("the answer to tick {tick}") };
        format!("it used {which} of {} {epoch}, which is not there", topic.publisher())
    }
}

/// Progress of one process.
#[derive(Default)]
pub(super) struct ProcessCourse {
    pub worker: Option<Runs>,
    /// Index of the next cycle, and of the next recorded message.
    pub cycle: usize,
    pub recorded: usize,
    /// Tick of the next cycle and the cause of its wait, if the wait never ends.
    pub held_up: Option<(u64, Waits)>,
    /// `true` if the last cycle was over before the replay begins, so that the next cycle begins with the logged
    /// memory.
    pub follows: bool,
    /// Messages sent: tick, message as the process meant it, and message as it was delivered; `None` if it was not
    /// delivered.
    pub sent: VecDeque<(u64, Record, Option<Record>)>,
    /// Last input read, by topic.
    pub read: [Option<Read>; Topic::COUNT],
}

impl ProcessCourse {
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
                    // This message was sent in the place of a withheld message.
                    Some(last) if last.0 == tick => *last = (tick, *record, delivered),
                    _ => self.sent.push_back((tick, *record, delivered)),
                }
            }
        }
    }
}
