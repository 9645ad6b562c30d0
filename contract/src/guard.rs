//! The guard: decides which incoming messages are accepted.
//!
//! ```text
//! layout -> epoch -> publisher -> order -> age -> range -> checksum -> newest
//!   |         |        |            |       |       |         |
//!   port      |        input        |       |       |         bits changed on the way
//!   refuses   |        refuses      |       |       not finite, or beyond its limit
//!             |                     |       not later than the newest, or of a sample yet to come
//!             |                     older than the newest, or a duplicate
//!             not from the active process
//! ```
//!
//! The layout is compared when a port is opened (`runtime::port`), the publisher when a message is received
//! (`runtime::input`), where messages that are not to be delivered, for instance those of a standby, are left out
//! without a count. A refused message is counted by cause and has no other effect: for its receiver it is missing.

use crate::message::Message;

/// Cause of a refused message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Refusal {
    /// Epoch other than that of the active process.
    Epoch = 0,
    /// Epoch of the active process in a message that came through the port of another process.
    Publisher = 1,
    /// Sequence number not later than that of the newest message from the same publisher.
    Order = 2,
    /// Sample that is not later than that of the newest message, or that the plant has not taken yet.
    Age = 3,
    /// Number that is not finite or beyond its limit: see [`plausible`](crate::message::Content::plausible).
    Range = 4,
    /// Checksum that does not fit the bits.
    Checksum = 5,
}

impl Refusal {
    /// All causes, in the order in which they are checked.
    pub const ALL: [Self; 6] = [Self::Epoch, Self::Publisher, Self::Order, Self::Age, Self::Range, Self::Checksum];

    /// Name, as in run.json and in output for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Epoch => "epoch",
            Self::Publisher => "publisher",
            Self::Order => "order",
            Self::Age => "age",
            Self::Range => "range",
            Self::Checksum => "checksum",
        }
    }
}

/// Guard of one topic, with the newest accepted message, against which the next one is checked.
#[derive(Debug, Clone)]
pub struct Guard<M> {
    newest: M,
    checks_bits: bool,
}

impl<M: Message> Default for Guard<M> {
    /// Guard before the first message: the newest message has sequence 0.
    fn default() -> Self {
        Self { newest: M::default(), checks_bits: true }
    }
}

impl<M: Message> Guard<M> {
    /// Guard for messages without checksums: it makes every check except that of the checksum.
    pub fn without_checksums() -> Self {
        Self { checks_bits: false, ..Self::default() }
    }

    /// Newest accepted message; the default (sequence 0) before the first.
    pub fn newest(&self) -> &M {
        &self.newest
    }

    /// Accepts `message` if every check passes. `active` is the epoch of the active process, and `samples` is the
    /// number of samples that exist by now.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn take(&mut self, message: &M, active: u32, samples: u64) -> Result<(), Refusal> {
        let (stamp, newest) = (message.stamp(), self.newest.stamp());
        let first = newest.sequence == 0;
        if stamp.epoch != u64::from(active) {
            Err(Refusal::Epoch)
        } else if !first && stamp.epoch == newest.epoch && stamp.sequence <= newest.sequence {
            Err(Refusal::Order)
        } else if !first && stamp.tick <= newest.tick || stamp.tick >= samples {
            Err(Refusal::Age)
        } else if !message.plausible() {
            Err(Refusal::Range)
        } else if self.checks_bits && !message.is_intact() {
            Err(Refusal::Checksum)
        } else {
            self.newest = *message;
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Controls, Stamp, State};
    use proptest::prelude::*;

    fn demand(epoch: u64, sequence: u64, tick: u64) -> Controls {
        let stamp = Stamp { tick, sequence, epoch, ..Stamp::default() };
        Controls { stamp, demand: [0.1; 4], ..Controls::default() }.with_checksum()
    }

    #[test]
    fn a_message_is_refused_for_the_first_reason_in_order() {
        let mut guard = Guard::default();
        assert_eq!(guard.take(&demand(2, 1, 5), 1, 7), Err(Refusal::Epoch));
        assert_eq!(guard.take(&demand(1, 1, 5), 1, 7), Ok(()));
        assert_eq!(guard.take(&demand(1, 1, 5), 1, 7), Err(Refusal::Order), "twice");
        assert_eq!(guard.take(&demand(1, 2, 5), 1, 7), Err(Refusal::Age), "another answer to the same sample");
        assert_eq!(guard.take(&demand(1, 3, 4), 1, 7), Err(Refusal::Age));
        let garbage = Controls { demand: [f64::NAN, 0.0, 0.0, 0.0], ..demand(1, 3, 6) };
        assert_eq!(guard.take(&garbage, 1, 7), Err(Refusal::Range));
        let bent = Controls { demand: [0.2; 4], ..demand(1, 3, 6) };
        assert_eq!(guard.take(&bent, 1, 7), Err(Refusal::Checksum));
        assert_eq!(guard.take(&demand(1, 3, 6), 1, 7), Ok(()));
        assert_eq!(guard.newest(), &demand(1, 3, 6));
        assert_eq!(guard.take(&demand(2, 1, 7), 2, 8), Ok(()), "a new process counts from one again");
        assert_eq!(guard.take(&demand(2, 2, 8), 0, 9), Err(Refusal::Epoch), "no process is active");
    }

    #[test]
    fn an_answer_to_a_sample_yet_to_come_is_refused() {
        let mut guard = Guard::default();
        assert_eq!(guard.take(&demand(1, 1, 6), 1, 6), Err(Refusal::Age), "there are samples 0 to 5");
        assert_eq!(guard.take(&demand(1, 1, u64::MAX), 1, 6), Err(Refusal::Age));
        assert_eq!(guard.take(&demand(1, 2, 5), 1, 6), Ok(()), "and the next that is true is taken");
        assert_eq!(guard.take(&demand(1, 3, 6), 1, 7), Ok(()));
    }

    #[test]
    fn the_first_sample_may_be_number_zero() {
        assert_eq!(Guard::default().take(&demand(1, 1, 0), 1, 1), Ok(()));
    }

    proptest! {
        /// Checks that the guard refuses every message that differs from a good one in one word.
        #[test]
        fn a_message_with_any_word_changed_is_refused(word in 0..size_of::<State>() / 8, bits: u64) {
            let stamp = Stamp { epoch: 1, sequence: 1, tick: 3, ..Stamp::default() };
            let good = State { stamp, ..State::default() }.with_checksum();
            let mut bad = good;
            bytemuck::cast_slice_mut::<u8, u64>(bytemuck::bytes_of_mut(&mut bad))[word] = bits;
            let taken = Guard::default().take(&bad, 1, 4).is_ok();
            prop_assert_eq!(taken, bytemuck::bytes_of(&bad) == bytemuck::bytes_of(&good));
        }
    }
}
