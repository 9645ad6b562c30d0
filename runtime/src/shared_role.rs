//! The shared role: the processes that run a node, and their progress, in shared memory.
//!
//! Every process that ever runs a node has its own epoch: 1 for the first, one more for each later one. Two epochs may
//! work at once; one is active, and only its messages are delivered.
//!
//! ```text
//! offered -> claimed -> ready --> standby <--> active     standby   answers too, but its messages are not delivered
//!                            \-------------->/            pending   becomes active when the next tick begins
//! ```
//!
//! The launcher offers a place to the epoch that it is about to start ([`SharedRole::offer`]). The process takes the
//! place by naming the port that it sends through ([`SharedRole::claim`]). Only one process gets the place; a second
//! one of the same epoch is turned away, and every receiver refuses messages with this epoch from any other port.
//!
//! In real time the launcher names the pending epoch, and the plant activates it between two ticks
//! ([`SharedRole::activate_pending`]), so that a tick has one active epoch. In lockstep the launcher changes the
//! assignment itself, while the plant waits for it. Active, standby and pending epoch share one word, so that
//! simultaneous changes by launcher and plant take effect one after the other.
//!
//! The counts of a process stand in the slot of its epoch. There is a slot for every epoch that can work, or be about
//! to work, at the same time. [`SharedRole::offer`] reuses a slot that no such epoch has. A process whose slot was
//! reused is no longer part of the run, and counts in a spare slot that is never read.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

use crate::error::PortFailure;
use crate::limits::{MEMORY_READS, ROLE_PORTS, ROLE_SLOTS};
use contract::Topic;
use contract::guard::Refusal;
use contract::snapshot::{NO_MEMORY, SNAPSHOT_WORDS, Snapshot};

/// Entry of an epoch whose place was offered and not yet taken.
pub(crate) const VACANT: u64 = 1;

/// Role of one node on the control page.
#[repr(C, align(64))]
#[derive(Default)]
pub struct SharedRole {
    /// Active, standby and pending epoch: a [`PackedAssignment`].
    packed: AtomicU64,
    /// Newest epoch whose process is ready to work; set by the process.
    pub ready: Word,
    /// Newest epoch whose messages the launcher receives; set by the launcher after `ready`, when it has connected to
    /// the port of the process.
    pub observed: Word,
    /// Newest epoch whose process is warm and waits for samples; set by the process.
    pub waiting: Word,
    /// Messages that all processes of the node have sent.
    pub sent_by_all: Word,
    /// Failures of the node's ports, by cause: see [`PortFailure`].
    pub port_failures: [Word; PortFailure::ALL.len()],
    /// Messages that the node has refused, by cause: see [`contract::guard::Refusal`].
    pub refused: [Word; Refusal::ALL.len()],
    slots: [Slot; ROLE_SLOTS],
    spare: Slot,
    /// Entries by epoch: 0 = not offered, [`VACANT`], or the port that the process sends through.
    ports: PortNumbers,
    /// Snapshot of the active process after its newest tick.
    pub memory: SnapshotCell<SNAPSHOT_WORDS>,
}

/// Counts of one process of a node.
#[repr(C)]
#[derive(Default)]
struct Slot {
    /// Epoch that has the slot; 0 = free.
    epoch: Word,
    /// First tick of the epoch since it became active or standby.
    since: Word,
    /// Ticks done, counted from the first of the run.
    done: Word,
    /// Messages sent.
    sent: Word,
    /// Messages received from the active process of each topic, refused ones included.
    received: [Word; Topic::COUNT],
}

/// Epochs that work for a node; 0 = none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Assignment {
    /// Epoch whose messages are delivered.
    pub active: u32,
    /// Epoch that answers too, but whose messages are not delivered.
    pub standby: u32,
}

impl Assignment {
    /// Returns whether `epoch` is active or on standby; `false` for 0.
    pub fn includes(self, epoch: u32) -> bool {
        epoch != 0 && (self.active == epoch || self.standby == epoch)
    }

    /// Iterates over the active and the standby epoch, without those that are 0.
    pub fn epochs(self) -> impl Iterator<Item = u32> {
        [self.active, self.standby].into_iter().filter(|epoch| *epoch != 0)
    }

    /// Returns the assignment without `epoch`.
    #[must_use]
    pub fn without(self, epoch: u32) -> Self {
        let unless = |other: u32| if other == epoch { 0 } else { other };
        Self { active: unless(self.active), standby: unless(self.standby) }
    }
}

/// Assignment and pending epoch, as packed into one word.
#[derive(Clone, Copy, PartialEq, Eq)]
struct PackedAssignment {
    assignment: Assignment,
    /// Epoch that becomes active with the next tick; 0 = no change.
    pending: u32,
}

impl PackedAssignment {
    /// Bits of an epoch: three epochs fit into a word, and no run has two million processes of a node.
    const BITS: u32 = 21;

    fn to_word(self) -> u64 {
        let Self { assignment: Assignment { active, standby }, pending } = self;
        [pending, standby, active].into_iter().fold(0, |word, epoch| word << Self::BITS | u64::from(epoch))
    }

    fn from_word(word: u64) -> Self {
        let epoch = |place: u32| (word >> (place * Self::BITS)) as u32 & ((1 << Self::BITS) - 1);
        Self { assignment: Assignment { active: epoch(0), standby: epoch(1) }, pending: epoch(2) }
    }
}

impl SharedRole {
    /// Epochs that work.
    pub fn assignment(&self) -> Assignment {
        self.packed().assignment
    }

    /// Active epoch; 0 = the role is vacant.
    pub fn active(&self) -> u32 {
        self.assignment().active
    }

    /// Changes the assignment. New epochs in it begin with `tick`.
    pub fn assign(&self, tick: u32, change: impl Fn(Assignment) -> Assignment) {
        self.update(|PackedAssignment { assignment, pending }| PackedAssignment {
            assignment: self.begin(tick, assignment, change(assignment)),
            pending,
        });
    }

    /// Names the epoch that becomes active with the next tick; 0 = no change.
    pub fn set_pending(&self, pending: u32) {
        self.update(|packed| PackedAssignment { pending, ..packed });
    }

    /// Removes `epoch` from the role; a standby that is left without an active process becomes pending.
    pub fn dismiss(&self, epoch: u32) {
        self.update(|PackedAssignment { assignment, pending }| {
            let assignment = assignment.without(epoch);
            let alone = assignment.active == 0 && assignment.standby != 0;
            let pending = if pending == epoch { 0 } else { pending };
            PackedAssignment { assignment, pending: if alone { assignment.standby } else { pending } }
        });
    }

    /// Makes the pending epoch, if any, active from `tick` on. If it was the standby, the active epoch becomes the
    /// standby.
    pub fn activate_pending(&self, tick: u32) {
        self.update(|packed| {
            let PackedAssignment { assignment: Assignment { active, standby }, pending } = packed;
            if pending == 0 {
                return packed;
            }
            let assignment = Assignment { active: pending, standby: if standby == pending { active } else { standby } };
            PackedAssignment { assignment: self.begin(tick, packed.assignment, assignment), pending: 0 }
        });
    }

    /// Ticks that `epoch` has done, counted from the first of the run.
    pub fn done(&self, epoch: u32) -> &Word {
        &self.slot(epoch).done
    }

    /// Number of messages that `epoch` has sent.
    pub fn sent(&self, epoch: u32) -> &Word {
        &self.slot(epoch).sent
    }

    /// Number of messages on `topic` that `epoch` has received from the active process of that topic.
    pub fn received(&self, epoch: u32, topic: Topic) -> &Word {
        &self.slot(epoch).received[topic as usize]
    }

    /// First tick of `epoch` since it became active or standby.
    pub fn since(&self, epoch: u32) -> &Word {
        &self.slot(epoch).since
    }

    /// Offers a place to the process that is about to be started as `epoch`; called by the launcher.
    ///
    /// The process gets a free slot, or that of the oldest epoch that is neither active, standby nor pending.
    pub fn offer(&self, epoch: u32) {
        let PackedAssignment { assignment, pending } = self.packed();
        // Epoch 1 is assigned before it is offered, and has no slot yet.
        let has = |slot: &&Slot| slot.epoch.get() == epoch;
        let is_free = |slot: &&Slot| !assignment.includes(slot.epoch.get()) && slot.epoch.get() != pending;
        let free = self.slots.iter().filter(|slot| slot.epoch.get() == 0 || is_free(slot));
        let slot = self.slots.iter().find(has).or_else(|| free.min_by_key(|slot| slot.epoch.get()));
        if let Some(slot) = slot {
            slot.epoch.set(0);
            slot.counts().for_each(|count| count.set(0));
            slot.epoch.set(epoch);
        }
        self.port_of(epoch).store(VACANT, Ordering::Release);
    }

    /// Takes the place of `epoch` for the process that sends through `port`; `false` if the place is not free.
    pub fn claim(&self, epoch: u32, port: u64) -> bool {
        self.port_of(epoch).compare_exchange(VACANT, port, Ordering::AcqRel, Ordering::Relaxed).is_ok()
    }

    /// Port that the process of `epoch` sends through; 0 or 1, which is no port, if the place was not taken.
    pub fn port(&self, epoch: u32) -> u64 {
        self.port_of(epoch).load(Ordering::Acquire)
    }

    /// Returns whether the process of `epoch` has taken its place.
    pub fn is_taken(&self, epoch: u32) -> bool {
        self.port(epoch) > VACANT
    }

    /// Returns whether a process that has or had a place sends through `port`.
    pub fn knows(&self, port: u64) -> bool {
        self.ports.0.iter().any(|known| known.load(Ordering::Acquire) == port)
    }

    fn packed(&self) -> PackedAssignment {
        PackedAssignment::from_word(self.packed.load(Ordering::Acquire))
    }

    /// Changes `packed` atomically: `change` is called again if another process has changed the word meanwhile.
    fn update(&self, change: impl Fn(PackedAssignment) -> PackedAssignment) {
        let changed = |word| {
            let before = PackedAssignment::from_word(word);
            Some(change(before)).filter(|after| *after != before).map(PackedAssignment::to_word)
        };
        let _ = self.packed.fetch_update(Ordering::AcqRel, Ordering::Acquire, changed); // an error means no change
    }

    /// Lets the epochs that are new in `after` begin with `tick`, and returns `after`.
    fn begin(&self, tick: u32, before: Assignment, after: Assignment) -> Assignment {
        for epoch in after.epochs().filter(|epoch| !before.includes(*epoch)) {
            self.done(epoch).set(tick);
            self.since(epoch).set(tick);
        }
        after
    }

    fn slot(&self, epoch: u32) -> &Slot {
        self.slots.iter().find(|slot| epoch != 0 && slot.epoch.get() == epoch).unwrap_or(&self.spare)
    }

    fn port_of(&self, epoch: u32) -> &AtomicU64 {
        &self.ports.0[epoch as usize % ROLE_PORTS]
    }
}

impl Slot {
    fn counts(&self) -> impl Iterator<Item = &Word> {
        [&self.since, &self.done, &self.sent].into_iter().chain(&self.received)
    }
}

/// Ports of the newest epochs.
#[repr(transparent)]
struct PortNumbers([AtomicU64; ROLE_PORTS]);

impl Default for PortNumbers {
    fn default() -> Self {
        Self(std::array::from_fn(|_| AtomicU64::default()))
    }
}

/// Number on the control page, shared by all processes.
#[repr(transparent)]
#[derive(Default)]
pub struct Word(AtomicU32);

impl Word {
    /// Loads the number.
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Acquire)
    }

    /// Stores `value`.
    pub fn set(&self, value: u32) {
        self.0.store(value, Ordering::Release);
    }

    /// Adds one.
    pub fn count(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// Long number on the control page.
#[repr(transparent)]
#[derive(Default)]
pub struct LongWord(AtomicU64);

impl LongWord {
    /// Loads the number.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }

    /// Stores `value`.
    pub fn set(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }
}

/// Snapshot of a node's memory, of up to `WORDS` words, which one process writes and others read, whole or not at all.
///
/// There are two copies, written alternately: a writer that dies while writing leaves the other one intact.
#[repr(C, align(64))]
pub struct SnapshotCell<const WORDS: usize> {
    /// Number of writes.
    written: AtomicU64,
    copies: [Copied<WORDS>; 2],
}

/// A snapshot with its origin before it.
#[repr(C)]
struct Copied<const WORDS: usize> {
    origin: [AtomicU64; 2],
    /// Number of words that were written.
    length: AtomicU64,
    words: [AtomicU64; WORDS],
}

/// Origin of a snapshot; the default means that there is no snapshot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Origin {
    /// Epoch of the process whose memory the snapshot is.
    pub epoch: u64,
    /// Ticks that the process had done, counted from the first of the run.
    pub done: u64,
}

impl Origin {
    /// Origin of the `memory` of process `epoch`, which has done ticks up to `done`; the default if it has no memory.
    pub fn of(epoch: u32, done: u64, memory: &Snapshot) -> Self {
        if *memory == NO_MEMORY { Self::default() } else { Self { epoch: u64::from(epoch), done } }
    }
}

impl<const WORDS: usize> Default for SnapshotCell<WORDS> {
    fn default() -> Self {
        let words = || std::array::from_fn(|_| AtomicU64::default());
        let copy = || Copied { origin: Default::default(), length: AtomicU64::default(), words: words() };
        Self { written: AtomicU64::default(), copies: [copy(), copy()] }
    }
}

impl<const WORDS: usize> SnapshotCell<WORDS> {
    /// Stores up to `WORDS` words of `snapshot`. Only one process may write at a time.
    pub fn write(&self, origin: Origin, snapshot: &[u64]) {
        let count = self.written.load(Ordering::Relaxed) + 1;
        fence(Ordering::Release); // a reader that sees a word of this copy sees that the other one was finished
        let copy = &self.copies[count as usize % 2];
        let length = snapshot.len() as u64;
        let places = copy.origin.iter().chain([&copy.length]).chain(&copy.words);
        for (place, value) in places.zip([origin.epoch, origin.done, length].iter().chain(snapshot)) {
            place.store(*value, Ordering::Relaxed);
        }
        self.written.store(count, Ordering::Release);
    }

    /// Reads the newest snapshot; `None` if there is none, or if it was overwritten while it was read.
    pub fn read(&self) -> Option<(Origin, Vec<u64>)> {
        let count = self.written.load(Ordering::Acquire);
        let Copied { origin: [epoch, done], length, words } = &self.copies[count as usize % 2];
        let origin = Origin { epoch: epoch.load(Ordering::Relaxed), done: done.load(Ordering::Relaxed) };
        let length = WORDS.min(length.load(Ordering::Relaxed) as usize);
        let snapshot = words[..length].iter().map(|word| word.load(Ordering::Relaxed)).collect();
        fence(Ordering::Acquire);
        // The next write goes to the other copy; the one after it, to this copy, begins when the count is one higher.
        (count > 0 && self.written.load(Ordering::Relaxed) == count).then_some((origin, snapshot))
    }

    /// Reads the newest snapshot, up to [`MEMORY_READS`] times if it was overwritten; `None` if that fails or there is
    /// none.
    pub fn read_whole(&self) -> Option<(Origin, Vec<u64>)> {
        (0..MEMORY_READS).find_map(|_| self.read())
    }
}

#[cfg(test)]
mod tests;
