//! The offices: which process speaks for which node, and how far it is.
//!
//! Every process that ever runs a node is an incarnation of its own, its epoch: 1 for the first, later ones higher. Two
//! of them may work at once, but one holds the office, and only the holder is heard.
//!
//! ```text
//! started -> ready --> shadow <--> holder    shadow    works on the same inputs, unheard
//!               \---------------->/          heir      takes over when the next tick begins; a shadow changes places
//! ```
//!
//! Who is started finds a place offered to it, and takes it by naming the port through which it will speak
//! ([`Office::claim`]). One process gets it: a second one of the same epoch is turned away, and one that speaks without
//! a place is refused wherever it is heard.
//!
//! Against the clock the launcher names the heir, and the plant lets it in between two ticks ([`Office::turn_over`]), so
//! that a tick has one holder. In lockstep the launcher makes the appointments itself, while the plant waits for them.
//! Everything is an atomic word of the shared board.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

use crate::guard::Refusal;
use crate::snapshot::{SNAPSHOT_WORDS, Snapshot};

/// Epochs whose ports are known: a recorder may be behind by some of them.
const VOICES: usize = 64;
/// A place that is offered.
const VACANT: u64 = 1;

/// The office of one node.
#[repr(C, align(64))]
pub struct Office {
    /// Who works, in one word so that two change places at once.
    staff: AtomicU64,
    /// The newest epoch whose process is ready to work.
    pub ready: Word,
    /// The epoch that holds the office from the next tick on; 0 = no change.
    pub heir: Word,
    /// The first tick of an epoch since it was let in, by the epoch's last bit: holder and shadow differ in it.
    since: [Word; 2],
    /// Ticks done, counted from the first of the run, likewise.
    done: [Word; 2],
    /// What the holder remembers after its newest tick.
    pub memory: Cell,
    /// The place of each of the newest epochs: not offered (0), vacant, or the port that its process speaks through.
    voices: [AtomicU64; VOICES],
    /// Messages that the node has refused, by cause: see [`crate::guard::Refusal`].
    pub refused: [Word; Refusal::ALL.len()],
}

/// The epochs that work for a node; 0 = nobody.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Staff {
    /// Who is heard.
    pub holder: u32,
    /// Who works unheard.
    pub shadow: u32,
}

impl Staff {
    /// Whether `epoch` works, heard or unheard.
    pub fn employs(self, epoch: u32) -> bool {
        epoch != 0 && (self.holder == epoch || self.shadow == epoch)
    }

    /// Those who work.
    pub fn epochs(self) -> impl Iterator<Item = u32> {
        [self.holder, self.shadow].into_iter().filter(|epoch| *epoch != 0)
    }

    /// Without `epoch`.
    #[must_use]
    pub fn without(self, epoch: u32) -> Self {
        let unless = |other: u32| if other == epoch { 0 } else { other };
        Self { holder: unless(self.holder), shadow: unless(self.shadow) }
    }

    fn to_word(self) -> u64 {
        u64::from(self.shadow) << 32 | u64::from(self.holder)
    }

    fn from_word(word: u64) -> Self {
        Self { holder: word as u32, shadow: (word >> 32) as u32 }
    }
}

impl Office {
    /// Who works.
    pub fn staff(&self) -> Staff {
        Staff::from_word(self.staff.load(Ordering::Acquire))
    }

    /// The epoch that is heard; 0 = vacant.
    pub fn holder(&self) -> u32 {
        self.staff().holder
    }

    /// Changes who works. Those who are new begin with `tick`.
    pub fn appoint(&self, tick: u32, change: impl Fn(Staff) -> Staff) {
        let before = self.staff();
        for epoch in change(before).epochs().filter(|epoch| !before.employs(*epoch)) {
            self.done(epoch).set(tick);
            self.since(epoch).set(tick);
        }
        let changed = |word| Some(change(Staff::from_word(word)).to_word());
        let _ = self.staff.fetch_update(Ordering::AcqRel, Ordering::Acquire, changed); // the change is never refused
    }

    /// Ticks that `epoch` has done.
    pub fn done(&self, epoch: u32) -> &Word {
        &self.done[epoch as usize % 2]
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

    fn voice(&self, epoch: u32) -> &AtomicU64 {
        &self.voices[epoch as usize % VOICES]
    }

    /// Lets the heir in, if one is named, for the tick that begins; one that was the shadow changes places.
    pub fn turn_over(&self, tick: u32) {
        let heir = self.heir.get();
        if heir != 0 {
            let succeed = |Staff { holder, shadow }: Staff| Staff {
                holder: heir,
                shadow: if shadow == heir { holder } else { shadow },
            };
            self.appoint(tick, succeed);
            self.heir.set(0);
        }
    }
}

/// A number of the board.
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
mod tests {
    use super::*;

    fn office() -> Box<Office> {
        let word = || Word(AtomicU32::new(0));
        Box::new(Office {
            staff: AtomicU64::new(0),
            ready: word(),
            heir: word(),
            since: [word(), word()],
            done: [word(), word()],
            memory: Cell {
                written: AtomicU64::new(0),
                copies: std::array::from_fn(|_| std::array::from_fn(|_| AtomicU64::new(0))),
            },
            voices: std::array::from_fn(|_| AtomicU64::new(0)),
            refused: std::array::from_fn(|_| word()),
        })
    }

    #[test]
    fn a_place_that_is_offered_goes_to_one_process() {
        let office = office();
        assert!(!office.claim(1, 71), "nobody was asked for");
        office.offer(1);
        assert!(!office.claim(2, 72), "it is another's");
        assert!(office.claim(1, 71));
        assert!(!office.claim(1, 72), "it is taken");
        assert!(office.port(1) == 71);
        assert!(office.knows(71) && !office.knows(72));
    }

    #[test]
    fn an_heir_takes_over_when_a_tick_begins() {
        let office = office();
        office.turn_over(7);
        assert_eq!(office.staff(), Staff::default(), "nobody is named");
        office.appoint(0, |_| Staff { holder: 1, shadow: 0 });
        office.heir.set(2);
        assert!(office.staff().employs(1) && !office.staff().employs(2) && !office.staff().employs(0));
        office.turn_over(8);
        assert_eq!(office.staff(), Staff { holder: 2, shadow: 0 });
        assert_eq!((office.since(2).get(), office.done(2).get(), office.heir.get()), (8, 8, 0));
    }

    #[test]
    fn a_shadow_and_its_holder_change_places_and_back() {
        let office = office();
        office.appoint(0, |_| Staff { holder: 1, shadow: 0 });
        office.done(1).set(20);
        office.appoint(20, |staff| Staff { shadow: 2, ..staff });
        office.heir.set(2);
        office.turn_over(30);
        assert_eq!(office.staff(), Staff { holder: 2, shadow: 1 });
        assert_eq!((office.since(1).get(), office.since(2).get()), (0, 20), "who worked before goes on where it is");
        office.heir.set(1);
        office.turn_over(40);
        assert_eq!(office.staff(), Staff { holder: 1, shadow: 2 });
        office.appoint(41, |staff| staff.without(2));
        assert_eq!(office.staff().epochs().collect::<Vec<_>>(), [1]);
    }

    #[test]
    fn a_snapshot_is_read_whole() {
        let cell = &office().memory;
        assert_eq!(cell.read(), None, "nothing was written yet");
        std::thread::scope(|scope| {
            scope.spawn(|| (1..=200_000).for_each(|i| cell.write(&[i; SNAPSHOT_WORDS])));
            for _ in 0..100_000 {
                if let Some(snapshot) = cell.read() {
                    assert!(snapshot.iter().all(|word| *word == snapshot[0]), "torn: {snapshot:?}");
                }
            }
        });
        assert_eq!(cell.read(), Some([200_000; SNAPSHOT_WORDS]));
    }
}
