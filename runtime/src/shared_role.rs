//! The shared role: which process runs a node, and how far it is, in shared memory.
//!
//! Every process that ever runs a node has an epoch of its own: 1 for the first, one more for each later one. Two of
//! them may work at once; one is active, and only its messages are delivered.
//!
//! ```text
//! offered -> claimed -> ready --> standby <--> active     standby   answers too, its messages are not delivered
//!                            \-------------->/            pending   becomes active when the next tick begins
//! ```
//!
//! The launcher offers a place to the epoch that it is about to start ([`SharedRole::offer`]). The process takes the
//! place by naming the port that it sends through ([`SharedRole::claim`]). One process gets it; another one of the same
//! epoch is turned away, and what comes through any other port is refused by every listener.
//!
//! In real time the launcher names the pending epoch, and the plant activates it between two ticks
//! ([`SharedRole::activate_pending`]), so that a tick has one active epoch. In lockstep the launcher assigns by itself,
//! while the plant waits for it. Active, standby and pending are one word, so that what launcher and plant do at the
//! same time is done one after the other.
//!
//! What a process counts stands in the slot of its epoch. There are as many slots as epochs can work or be about to;
//! [`SharedRole::offer`] takes one that no such epoch has. A process whose slot was taken is no part of the run any more,
//! and counts in a spare slot that is not read.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

use crate::error::PortFailure;
use crate::limits::{MEMORY_READS, ROLE_PORTS, ROLE_SLOTS};
use contract::Topic;
use contract::guard::Refusal;
use contract::snapshot::SNAPSHOT_WORDS;

/// The entry of an epoch that was offered a place which no process has taken.
pub(crate) const VACANT: u64 = 1;

/// The role of one node.
#[repr(C, align(64))]
#[derive(Default)]
pub struct SharedRole {
    /// Active, standby and pending: a [`PackedAssignment`].
    packed: AtomicU64,
    /// The newest epoch whose process is ready to work; the process says so.
    pub ready: Word,
    /// The newest such epoch to whose port the launcher has connected: from then on it misses nothing that is sent there.
    pub connected: Word,
    /// The newest epoch whose process is warm and waits for samples; the process says so.
    pub waiting: Word,
    /// Messages that all processes of the node have sent.
    pub sent_by_all: Word,
    /// How often the node's ports have failed, by cause: see [`PortFailure`].
    pub port_failures: [Word; PortFailure::ALL.len()],
    /// Messages that the node has refused, by cause: see [`contract::guard::Refusal`].
    pub refused: [Word; Refusal::ALL.len()],
    slots: [Slot; ROLE_SLOTS],
    spare: Slot,
    /// By epoch: not offered (0), vacant, or the port that the process sends through.
    ports: PortNumbers,
    /// What the active process remembers after its newest tick.
    pub memory: SnapshotCell<SNAPSHOT_WORDS>,
}

/// What one process of a node counts.
#[repr(C)]
#[derive(Default)]
struct Slot {
    /// Whose slot it is; 0 = free.
    epoch: Word,
    /// The first tick of the epoch since it was let in.
    since: Word,
    /// Ticks done, counted from the first of the run.
    done: Word,
    /// Messages sent.
    sent: Word,
    /// Messages received from the active process of each topic, whatever became of them.
    received: [Word; Topic::COUNT],
}

/// The epochs that work for a node; 0 = none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Assignment {
    /// Its messages are delivered.
    pub active: u32,
    /// It answers too, and its messages are not delivered.
    pub standby: u32,
}

impl Assignment {
    /// Whether `epoch` is active or on standby.
    pub fn includes(self, epoch: u32) -> bool {
        epoch != 0 && (self.active == epoch || self.standby == epoch)
    }

    /// The active and the standby epoch, as far as there are.
    pub fn epochs(self) -> impl Iterator<Item = u32> {
        [self.active, self.standby].into_iter().filter(|epoch| *epoch != 0)
    }

    /// Without `epoch`.
    #[must_use]
    pub fn without(self, epoch: u32) -> Self {
        let unless = |other: u32| if other == epoch { 0 } else { other };
        Self { active: unless(self.active), standby: unless(self.standby) }
    }
}

/// Assignment and pending epoch.
#[derive(Clone, Copy, PartialEq, Eq)]
struct PackedAssignment {
    assignment: Assignment,
    /// The epoch that is active from the next tick on; 0 = no change.
    pending: u32,
}

impl PackedAssignment {
    /// Bits of an epoch: three fit into a word, and no run has two million processes of a node.
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
    /// The epochs that work.
    pub fn assignment(&self) -> Assignment {
        self.packed().assignment
    }

    /// The active epoch; 0 = the role is vacant.
    pub fn active(&self) -> u32 {
        self.assignment().active
    }

    /// Changes the assignment. Epochs that are new in it begin with `tick`.
    pub fn assign(&self, tick: u32, change: impl Fn(Assignment) -> Assignment) {
        self.update(|PackedAssignment { assignment, pending }| PackedAssignment {
            assignment: self.begin(tick, assignment, change(assignment)),
            pending,
        });
    }

    /// Names the epoch that is active from the next tick on; 0 = no change.
    pub fn set_pending(&self, pending: u32) {
        self.update(|packed| PackedAssignment { pending, ..packed });
    }

    /// `epoch` is neither active, standby nor pending any more; a standby that is left alone becomes pending.
    pub fn dismiss(&self, epoch: u32) {
        self.update(|PackedAssignment { assignment, pending }| {
            let assignment = assignment.without(epoch);
            let alone = assignment.active == 0 && assignment.standby != 0;
            let pending = if pending == epoch { 0 } else { pending };
            PackedAssignment { assignment, pending: if alone { assignment.standby } else { pending } }
        });
    }

    /// Makes the pending epoch, if there is one, active for the tick that begins; a standby and the active epoch change
    /// places.
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

    /// Ticks that `epoch` has done.
    pub fn done(&self, epoch: u32) -> &Word {
        &self.slot(epoch).done
    }

    /// Messages that `epoch` has sent.
    pub fn sent(&self, epoch: u32) -> &Word {
        &self.slot(epoch).sent
    }

    /// Messages on `topic` that `epoch` has received from the active process there.
    pub fn received(&self, epoch: u32, topic: Topic) -> &Word {
        &self.slot(epoch).received[topic as usize]
    }

    /// The first tick of `epoch` since it was let in.
    pub fn since(&self, epoch: u32) -> &Word {
        &self.slot(epoch).since
    }

    /// Offers a place to the process that is about to be started as `epoch`; the launcher's part.
    ///
    /// Its slot is the one of the oldest epoch that is neither active, standby nor pending.
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

    /// Takes the place of `epoch` for the process that sends through `port`; false when it is not to be had.
    pub fn claim(&self, epoch: u32, port: u64) -> bool {
        self.port_of(epoch).compare_exchange(VACANT, port, Ordering::AcqRel, Ordering::Relaxed).is_ok()
    }

    /// The port that the process of `epoch` sends through; no port's number if the place was not taken.
    pub fn port(&self, epoch: u32) -> u64 {
        self.port_of(epoch).load(Ordering::Acquire)
    }

    /// Whether a process that has or had a place sends through `port`.
    pub fn knows(&self, port: u64) -> bool {
        self.ports.0.iter().any(|known| known.load(Ordering::Acquire) == port)
    }

    fn packed(&self) -> PackedAssignment {
        PackedAssignment::from_word(self.packed.load(Ordering::Acquire))
    }

    /// The one way in which `packed` changes: at once, or anew from what another process has made of it meanwhile.
    fn update(&self, change: impl Fn(PackedAssignment) -> PackedAssignment) {
        let changed = |word| {
            let before = PackedAssignment::from_word(word);
            Some(change(before)).filter(|after| *after != before).map(PackedAssignment::to_word)
        };
        let _ = self.packed.fetch_update(Ordering::AcqRel, Ordering::Acquire, changed); // fails where nothing changes
    }

    /// Has the epochs that are new in `after` begin with `tick`, and gives `after` back.
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

/// The ports of the newest epochs.
#[repr(transparent)]
struct PortNumbers([AtomicU64; ROLE_PORTS]);

impl Default for PortNumbers {
    fn default() -> Self {
        Self(std::array::from_fn(|_| AtomicU64::default()))
    }
}

/// A number of the control page.
#[repr(transparent)]
#[derive(Default)]
pub struct Word(AtomicU32);

impl Word {
    /// What it is.
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Acquire)
    }

    /// Makes it `value`.
    pub fn set(&self, value: u32) {
        self.0.store(value, Ordering::Release);
    }

    /// One more.
    pub fn count(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// So many words that one process writes and others read, whole or not at all: what a node remembers.
///
/// Two copies, written in turn: a writer that dies in the middle leaves the other one good.
#[repr(C, align(64))]
pub struct SnapshotCell<const WORDS: usize> {
    /// Times written.
    written: AtomicU64,
    copies: [Copied<WORDS>; 2],
}

/// A snapshot with its origin before it.
#[repr(C)]
struct Copied<const WORDS: usize> {
    origin: [AtomicU64; 2],
    words: [AtomicU64; WORDS],
}

/// Where a snapshot comes from; the default is nowhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Origin {
    /// The process whose memory it is.
    pub epoch: u64,
    /// Ticks that it had done, counted from the first of the run.
    pub done: u64,
}

impl<const WORDS: usize> Default for SnapshotCell<WORDS> {
    fn default() -> Self {
        let copy = || Copied { origin: Default::default(), words: std::array::from_fn(|_| AtomicU64::default()) };
        Self { written: AtomicU64::default(), copies: [copy(), copy()] }
    }
}

impl<const WORDS: usize> SnapshotCell<WORDS> {
    /// Puts `snapshot` in. One writer at a time.
    pub fn write(&self, origin: Origin, snapshot: &[u64; WORDS]) {
        let count = self.written.load(Ordering::Relaxed) + 1;
        fence(Ordering::Release); // a reader that sees a word of this copy sees that the other one was finished
        let copy = &self.copies[count as usize % 2];
        let places = copy.origin.iter().chain(&copy.words);
        for (place, value) in places.zip([origin.epoch, origin.done].iter().chain(snapshot)) {
            place.store(*value, Ordering::Relaxed);
        }
        self.written.store(count, Ordering::Release);
    }

    /// The newest snapshot; `None` when there is none, or when it was overwritten while it was read.
    pub fn read(&self) -> Option<(Origin, [u64; WORDS])> {
        let count = self.written.load(Ordering::Acquire);
        let Copied { origin: [epoch, done], words } = &self.copies[count as usize % 2];
        let origin = Origin { epoch: epoch.load(Ordering::Relaxed), done: done.load(Ordering::Relaxed) };
        let snapshot = words.each_ref().map(|word| word.load(Ordering::Relaxed));
        fence(Ordering::Acquire);
        // This copy is the next but one to be written, which begins when the count is one higher.
        (count > 0 && self.written.load(Ordering::Relaxed) == count).then_some((origin, snapshot))
    }

    /// The newest snapshot; `None` when there is none. One that is being written is read whole at the next attempt.
    pub fn read_whole(&self) -> Option<(Origin, [u64; WORDS])> {
        (0..MEMORY_READS).find_map(|_| self.read())
    }
}

#[cfg(test)]
mod tests;
