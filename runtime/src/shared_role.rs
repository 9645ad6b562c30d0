//! The roles: which process speaks for which node, and how far it is.
//!
//! Every process that ever runs a node is an incarnation of its own, its epoch: 1 for the first, later ones higher. Two
//! of them may work at once, but one is active, and only the active is heard.
//!
//! ```text
//! started -> ready --> standby <--> active    standby    works on the same inputs, delivery
//!               \---------------->/          pending      takes over when the next tick begins; a standby changes places
//! ```
//!
//! Who is started finds a place offered to it, and takes it by naming the port through which it will speak
//! ([`SharedRole::claim`]). One process gets it: a second one of the same epoch is turned away, and one that speaks without
//! a place is refused wherever it is heard.
//!
//! Against the clock the launcher names the pending, and the plant lets it in between two ticks ([`SharedRole::activate_pending`]), so
//! that a tick has one active. In lockstep the launcher makes the appointments itself, while the plant waits for them.
//! Everything is an atomic word of the shared page; active, standby and pending are one, so that whatever the launcher and
//! the plant do at the same time is done one after the other.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

use crate::port::PortFailure;
use contract::Topic;
use contract::guard::Refusal;
use contract::snapshot::{SNAPSHOT_WORDS, Snapshot};

/// Epochs whose ports are known: a recorder may be behind by some of them.
const VOICES: usize = 64;
/// A place that is offered.
pub(crate) const VACANT: u64 = 1;

/// The role of one node.
#[repr(C, align(64))]
pub struct SharedRole {
    /// Who works, and who is to: a [`PackedAssignment`].
    packed: AtomicU64,
    /// The newest epoch whose process is ready to work; it says so itself.
    pub ready: Word,
    /// The newest such epoch to whose port the launcher has connected: from then on it misses nothing that is sent there.
    pub met: Word,
    /// The first tick of an epoch since it was let in, by the epoch's last bit: active and standby differ in it.
    since: [Word; 2],
    /// Ticks done, counted from the first of the run, likewise.
    done: [Word; 2],
    /// Messages that it has sent, likewise.
    sent: [Word; 2],
    /// Messages that have reached it from the active process of each topic, whatever became of them, likewise.
    received: [[Word; Topic::COUNT]; 2],
    /// How often its ports have failed, by cause: see [`PortFailure`].
    pub port_failures: [Word; PortFailure::ALL.len()],
    /// What the active remembers after its newest tick.
    pub memory: Cell,
    /// The place of each of the newest epochs: not offered (0), vacant, or the port that its process speaks through.
    voices: [AtomicU64; VOICES],
    /// Messages that the node has refused, by cause: see [`contract::guard::Refusal`].
    pub refused: [Word; Refusal::ALL.len()],
}

/// The epochs that work for a node; 0 = nobody.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Assignment {
    /// Who is heard.
    pub active: u32,
    /// Who works delivery.
    pub standby: u32,
}

impl Assignment {
    /// Whether `epoch` works, heard or delivery.
    pub fn includes(self, epoch: u32) -> bool {
        epoch != 0 && (self.active == epoch || self.standby == epoch)
    }

    /// Those who work.
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

/// Who works, and who is to.
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
    /// Who works.
    pub fn assignment(&self) -> Assignment {
        self.packed().assignment
    }

    /// The epoch that is heard; 0 = vacant.
    pub fn active(&self) -> u32 {
        self.assignment().active
    }

    /// Changes who works. Those who are new begin with `tick`.
    pub fn assign(&self, tick: u32, change: impl Fn(Assignment) -> Assignment) {
        self.update(|PackedAssignment { assignment, pending }| PackedAssignment {
            assignment: self.begin(tick, assignment, change(assignment)),
            pending,
        });
    }

    /// Names who is active from the next tick on; 0 = no change.
    pub fn set_pending(&self, pending: u32) {
        self.update(|packed| PackedAssignment { pending, ..packed });
    }

    /// `epoch` neither works nor is to work any more; a standby that is left alone becomes the pending.
    pub fn dismiss(&self, epoch: u32) {
        self.update(|PackedAssignment { assignment, pending }| {
            let assignment = assignment.without(epoch);
            let alone = assignment.active == 0 && assignment.standby != 0;
            let pending = if pending == epoch { 0 } else { pending };
            PackedAssignment { assignment, pending: if alone { assignment.standby } else { pending } }
        });
    }

    /// Lets the pending in, if one is named, for the tick that begins; one that was the standby changes places.
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
        &self.done[epoch as usize % 2]
    }

    /// Messages that `epoch` has sent.
    pub fn sent(&self, epoch: u32) -> &Word {
        &self.sent[epoch as usize % 2]
    }

    /// Messages that all processes of the node have sent.
    pub fn sent_by_all(&self) -> u64 {
        self.sent.iter().map(|sent| u64::from(sent.get())).sum()
    }

    /// Messages on `topic` that have reached `epoch` from the active process there.
    pub fn received(&self, epoch: u32, topic: Topic) -> &Word {
        &self.received[epoch as usize % 2][topic as usize]
    }

    /// The first tick of `epoch` since it was let in.
    pub fn since(&self, epoch: u32) -> &Word {
        &self.since[epoch as usize % 2]
    }

    /// Offers the place of `epoch` to the process that is about to be started for it; the launcher's part.
    pub fn offer(&self, epoch: u32) {
        self.voice(epoch).store(VACANT, Ordering::Release);
    }

    /// Takes the place of `epoch` for the process that speaks through `port`; false when it is not to be had.
    pub fn claim(&self, epoch: u32, port: u64) -> bool {
        self.voice(epoch).compare_exchange(VACANT, port, Ordering::AcqRel, Ordering::Relaxed).is_ok()
    }

    /// The port that the process speaks through that has the place of `epoch`; no port's number if nobody has it.
    pub fn port(&self, epoch: u32) -> u64 {
        self.voice(epoch).load(Ordering::Acquire)
    }

    /// Whether anybody who has or had a place speaks through `port`.
    pub fn knows(&self, port: u64) -> bool {
        self.voices.iter().any(|voice| voice.load(Ordering::Acquire) == port)
    }

    fn packed(&self) -> PackedAssignment {
        PackedAssignment::from_word(self.packed.load(Ordering::Acquire))
    }

    /// The one way in which the packed changes: at once, or anew from what another has made of it meanwhile.
    fn update(&self, change: impl Fn(PackedAssignment) -> PackedAssignment) {
        let changed = |word| {
            let before = PackedAssignment::from_word(word);
            Some(change(before)).filter(|after| *after != before).map(PackedAssignment::to_word)
        };
        let _ = self.packed.fetch_update(Ordering::AcqRel, Ordering::Acquire, changed); // fails where nothing changes
    }

    /// Has those begin with `tick` who are new in `after`, and gives it back.
    fn begin(&self, tick: u32, before: Assignment, after: Assignment) -> Assignment {
        for epoch in after.epochs().filter(|epoch| !before.includes(*epoch)) {
            self.done(epoch).set(tick);
            self.since(epoch).set(tick);
        }
        after
    }

    fn voice(&self, epoch: u32) -> &AtomicU64 {
        &self.voices[epoch as usize % VOICES]
    }
}

/// A number of the page.
#[repr(transparent)]
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

/// A [`Snapshot`] that one process writes and others read, whole or not at all.
///
/// Two copies, written in turn: a writer that dies in the middle leaves the other one good.
#[repr(C, align(64))]
pub struct Cell {
    /// Times written.
    written: AtomicU64,
    copies: [[AtomicU64; SNAPSHOT_WORDS]; 2],
}

impl Cell {
    /// Puts `snapshot` in. One writer at a time.
    pub fn write(&self, snapshot: &Snapshot) {
        let count = self.written.load(Ordering::Relaxed) + 1;
        fence(Ordering::Release); // who sees a word of this copy sees that the other one was finished
        for (word, value) in self.copies[count as usize % 2].iter().zip(snapshot) {
            word.store(*value, Ordering::Relaxed);
        }
        self.written.store(count, Ordering::Release);
    }

    /// The newest snapshot; `None` when there is none, or when it was overwritten while it was read.
    pub fn read(&self) -> Option<Snapshot> {
        let count = self.written.load(Ordering::Acquire);
        let copy = &self.copies[count as usize % 2];
        let snapshot = std::array::from_fn(|i| copy[i].load(Ordering::Relaxed));
        fence(Ordering::Acquire);
        // This copy is the next but one to be written, which begins when the count is one higher.
        (count > 0 && self.written.load(Ordering::Relaxed) == count).then_some(snapshot)
    }
}

#[cfg(test)]
mod tests;
