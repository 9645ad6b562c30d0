//! The fault table: faults given in flight, on the control page that all processes share.
//!
//! The launcher enters a fault, and every process takes it at its next tick ([`FaultUpdates`]). Each fault has a
//! number. Faults of the scenario have the first numbers, and are in the table only if they end earlier than the
//! scenario says. An entry is never removed. Only its end changes, which is one word, so that no reader sees half of a
//! change.
//!
//! ```text
//! word  0       1                       2     3      4   5      6 7 8   9            10
//!       number  target, kind, how, imu  at_s  for_s  ms  value  vector  probability  count      absent: NaN or 0
//! ```

use std::sync::atomic::{AtomicU64, Ordering};

use settings::fault_schedule::MAX_LIVE_FAULTS;
use settings::{Fault, FaultTarget, MAX_FAULT_MS, MAX_FAULT_S, Wrong};

const WORDS: usize = 11;
/// Index of the only word of an entry that may change.
const FOR_S: usize = 3;

/// Table of the faults given in flight. The launcher writes it, every process reads it.
#[repr(C, align(64))]
pub struct FaultTable {
    /// Number of entries and changes so far.
    generation: AtomicU64,
    /// Number of entries.
    count: AtomicU64,
    entries: [[AtomicU64; WORDS]; MAX_LIVE_FAULTS],
}

impl Default for FaultTable {
    fn default() -> Self {
        let entries = std::array::from_fn(|_| Default::default());
        Self { generation: AtomicU64::default(), count: AtomicU64::default(), entries }
    }
}

impl FaultTable {
    /// Enters fault `number`, or changes its end if the table has it. Returns `false` if there was no room.
    pub fn enter(&self, number: usize, fault: &Fault) -> bool {
        let words = pack(number, fault);
        if let Some(entry) = self.find(number) {
            entry[FOR_S].store(words[FOR_S], Ordering::Relaxed);
        } else {
            let Some(entry) = self.entries.get(self.standing().len()) else { return false };
            entry.iter().zip(words).for_each(|(word, value)| word.store(value, Ordering::Relaxed));
            self.count.fetch_add(1, Ordering::Release);
        }
        self.generation.fetch_add(1, Ordering::Release);
        true
    }

    /// Returns whether all faults with these numbers could be entered.
    pub fn has_room_for(&self, numbers: impl Iterator<Item = usize>) -> bool {
        self.standing().len() + numbers.filter(|number| self.find(*number).is_none()).count() <= MAX_LIVE_FAULTS
    }

    /// Reads all entries, with their numbers; entries that are no valid fault are left out.
    fn faults(&self) -> impl Iterator<Item = (usize, Fault)> {
        self.standing().iter().filter_map(|entry| unpack(&std::array::from_fn(|i| entry[i].load(Ordering::Relaxed))))
    }

    fn find(&self, number: usize) -> Option<&[AtomicU64; WORDS]> {
        self.standing().iter().find(|entry| entry[0].load(Ordering::Relaxed) == number as u64)
    }

    fn standing(&self) -> &[[AtomicU64; WORDS]] {
        &self.entries[..MAX_LIVE_FAULTS.min(self.count.load(Ordering::Acquire) as usize)]
    }
}

/// Part of the table that one process knows.
#[derive(Default)]
pub struct FaultUpdates {
    /// Generation of the table at the last look.
    known: u64,
}

impl FaultUpdates {
    /// Number of entries and changes that the process knows.
    pub fn known(&self) -> u64 {
        self.known
    }

    /// Passes every fault of `table` to `apply`, with its number, if anything is new; otherwise it costs one load.
    pub fn take(&mut self, table: &FaultTable, mut apply: impl FnMut(usize, &Fault)) {
        let generation = table.generation.load(Ordering::Acquire);
        if generation != self.known {
            self.known = generation;
            table.faults().for_each(|(number, fault)| apply(number, &fault));
        }
    }
}

fn pack(number: usize, fault: &Fault) -> [u64; WORDS] {
    let kind = fault.target.kinds().iter().position(|kind| *kind == fault.kind).unwrap_or(usize::MAX);
    let how = fault.how.map_or(0, |how| 1 + how as u64);
    let imu = fault.imu.unwrap_or(0);
    let bits = |number: Option<f64>| number.unwrap_or(f64::NAN).to_bits();
    let [north, east, down] = fault.vector.map_or([None; 3], |vector| vector.map(Some));
    [
        number as u64,
        u64::from_le_bytes([fault.target as u8, kind as u8, how as u8, imu as u8, 0, 0, 0, 0]),
        fault.at_s.to_bits(),
        bits(fault.for_s),
        bits(fault.ms),
        bits(fault.value),
        bits(north),
        bits(east),
        bits(down),
        bits(fault.probability),
        fault.count.unwrap_or(0),
    ]
}

/// Reads a fault and its number; `None` if the words are no valid fault.
fn unpack(words: &[u64; WORDS]) -> Option<(usize, Fault)> {
    let [target, kind, how, imu, ..] = words[1].to_le_bytes();
    let (target, _) = *FaultTarget::ALL.get(usize::from(target))?;
    let kind = *target.kinds().get(usize::from(kind))?;
    let how = match how {
        0 => None,
        how => Some(*[Wrong::Bias, Wrong::Scale, Wrong::Sign].get(usize::from(how - 1))?),
    };
    let number = |i: usize| f64::from_bits(words[i]);
    let given = |i: usize| Some(number(i)).filter(|number| !number.is_nan());
    let fault = Fault {
        at_s: number(2),
        for_s: given(FOR_S),
        target,
        kind,
        process: None,
        imu: Some(u64::from(imu)).filter(|imu| *imu > 0),
        ms: given(4),
        value: given(5),
        vector: given(6).zip(given(7)).zip(given(8)).map(|((north, east), down)| [north, east, down]),
        probability: given(9),
        count: Some(words[10]).filter(|count| *count > 0),
        how,
    };
    let times = [fault.at_s, fault.for_s.unwrap_or(0.0)];
    let sizes = fault.vector.into_iter().flatten().chain(fault.value).chain(fault.probability);
    let is_one = times.iter().all(|time_s| (0.0..=MAX_FAULT_S).contains(time_s))
        && fault.ms.is_none_or(|ms| (0.0..=MAX_FAULT_MS).contains(&ms))
        && { sizes }.all(f64::is_finite);
    is_one.then_some((words[0] as usize, fault))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::ControlPage;
    use proptest::prelude::*;

    prop_compose! {
        /// Generates any fault that can be given in flight.
        fn any_fault()(
            (target, _) in prop::sample::select(&FaultTarget::ALL[..]),
            kind: prop::sample::Index,
            at_s in 0.0..MAX_FAULT_S,
            for_s in prop::option::of(0.0..MAX_FAULT_S),
            imu in prop::option::of(1..=2_u64),
            ms in prop::option::of(0.0..MAX_FAULT_MS),
            value in prop::option::of(-1e300..1e300),
            vector in prop::option::of(prop::array::uniform3(-1e3..1e3)),
            probability in prop::option::of(0.0..1.0),
            count in prop::option::of(1u64..),
            how in prop::option::of(prop::sample::select(vec![Wrong::Bias, Wrong::Scale, Wrong::Sign])),
        ) -> Fault {
            Fault { at_s, for_s, target, kind: *kind.get(target.kinds()), process: None, imu, ms, value, vector, probability, count, how }
        }
    }

    proptest! {
        #[test]
        fn a_fault_comes_out_as_it_went_in(number: usize, fault in any_fault()) {
            prop_assert_eq!(unpack(&pack(number, &fault)), Some((number, fault)));
        }

        /// Checks that any words are read as a fault that could have been entered, or as no fault.
        #[test]
        fn words_that_are_no_fault_are_left_out(words: [u64; WORDS], what in 0u64..1 << 21) {
            for words in [words, { let mut near = words; near[1] = what; near }] {
                if let Some((number, fault)) = unpack(&words) {
                    prop_assert!(fault.target.kinds().contains(&fault.kind) && fault.at_s >= 0.0);
                    prop_assert_eq!(unpack(&pack(number, &fault)), Some((number, fault)));
                }
            }
        }
    }

    fn page() -> ControlPage {
        ControlPage::private().expect("memory")
    }

    fn taken(updates: &mut FaultUpdates, page: &ControlPage) -> Vec<(usize, Option<f64>)> {
        let mut taken = vec![];
        updates.take(&page.fault_table, |number, fault| taken.push((number, fault.for_s)));
        taken
    }

    fn fault(for_s: f64) -> Fault {
        Fault::new(FaultTarget::Mpc, settings::FaultKind::Nan, 1.0, Some(for_s))
    }

    #[test]
    fn all_faults_are_taken_once_and_again_after_any_change() {
        let page = page();
        let mut updates = FaultUpdates::default();
        assert_eq!(taken(&mut updates, &page), []);
        assert!(page.fault_table.enter(3, &fault(0.5)) && page.fault_table.enter(0, &fault(0.1)));
        assert_eq!(taken(&mut updates, &page), [(3, Some(0.5)), (0, Some(0.1))]);
        assert_eq!(taken(&mut updates, &page), []);
        assert!(page.fault_table.enter(3, &fault(0.2)));
        assert_eq!(taken(&mut updates, &page), [(3, Some(0.2)), (0, Some(0.1))]);
        assert_eq!(taken(&mut FaultUpdates::default(), &page).len(), 2, "a process that comes later takes them all");
    }

    #[test]
    fn a_full_table_accepts_new_ends_only() {
        let page = page();
        assert!((0..MAX_LIVE_FAULTS).all(|number| page.fault_table.enter(number, &fault(0.5))));
        assert!(
            !page.fault_table.enter(MAX_LIVE_FAULTS, &fault(0.5))
                && !page.fault_table.has_room_for(0..=MAX_LIVE_FAULTS)
        );
        assert!(page.fault_table.has_room_for(0..MAX_LIVE_FAULTS) && page.fault_table.enter(7, &fault(0.2)));
        assert_eq!(taken(&mut FaultUpdates::default(), &page)[7], (7, Some(0.2)));
    }
}
