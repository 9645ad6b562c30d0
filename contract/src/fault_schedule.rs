//! The roll: the faults that one part of the stack has, with their numbers and their times.
//!
//! Those of the scenario stand in it from the start. Against the clock more may come while the stack flies, and some end
//! earlier than they were to (`runtime::fault_table`): there is room for them, so that nothing is allocated then.

use std::ops::Range;

use crate::scenario::{Fault, FaultKind, FaultTarget, Mode, Scenario};

/// A sensor's delay in it is no longer than this \[ms\]: so much of the past is remembered, for it may be asked for.
pub const LONGEST_DELAY_MS: f64 = 1000.0;
/// Faults that a flight takes while it flies.
pub const ROOM: usize = 128;

/// The faults of one part of the stack, in the order of their numbers; `E` is what a fault is to it.
#[derive(Debug, Clone)]
pub struct FaultSchedule<E> {
    entries: Vec<Entry<E>>,
    sample_s: f64,
}

/// One fault.
#[derive(Debug, Clone)]
pub struct Entry<E> {
    /// Its place among all faults of the run, which its random draws depend on.
    pub number: usize,
    /// Where it strikes, how, and from when on \[s\]: the same number with another of these is another fault.
    what: (FaultTarget, FaultKind, f64),
    /// When it is at work.
    pub ticks: Range<u64>,
    /// What it does.
    pub effect: E,
}

impl<E> FaultSchedule<E> {
    /// Those faults of `scenario` that have an `effect`, by number and fault.
    pub fn new(scenario: &Scenario, effect: impl Fn(usize, &Fault) -> Option<E>) -> Self {
        let room = if scenario.run.mode == Mode::Realtime { ROOM } else { 0 };
        let entries = Vec::with_capacity(scenario.fault.len() + room);
        let mut roll = Self { entries, sample_s: scenario.sample_s() };
        for (number, fault) in scenario.fault.iter().enumerate() {
            roll.apply_fault(number, fault, effect(number, fault));
        }
        roll
    }

    /// Takes fault `number` as it is from now on: one that stands here already may have another end; one that is new is
    /// taken if it has an `effect`. A process may have faults of its own in place of the run's, so that one that is given
    /// while flying finds its number taken.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault, effect: Option<E>) {
        let (what, ticks) = ((fault.target, fault.kind, fault.at_s), fault.ticks(self.sample_s));
        let known = |entry: &&mut Entry<E>| entry.number == number && entry.what == what;
        if let Some(entry) = self.entries.iter_mut().find(known) {
            entry.ticks = ticks;
        } else if let Some(effect) = effect
            && self.entries.len() < self.entries.capacity()
        {
            self.entries.push(Entry { number, what, ticks, effect });
        }
    }

    /// All of them.
    pub fn all(&self) -> &[Entry<E>] {
        &self.entries
    }

    /// All of them.
    pub fn all_mut(&mut self) -> &mut [Entry<E>] {
        &mut self.entries
    }

    /// What those do that are at work on `tick`.
    pub fn on_mut(&mut self, tick: u64) -> impl Iterator<Item = &mut E> {
        self.entries.iter_mut().filter(move |entry| entry.ticks.contains(&tick)).map(|entry| &mut entry.effect)
    }

    /// Those at work on `tick`.
    pub fn on(&self, tick: u64) -> impl Iterator<Item = &Entry<E>> {
        self.entries.iter().filter(move |entry| entry.ticks.contains(&tick))
    }

    /// Whether there is, or may come, any.
    pub fn may_strike(&self) -> bool {
        self.entries.capacity() > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(at_s: f64, for_s: Option<f64>) -> Fault {
        Fault::new(FaultTarget::Mpc, FaultKind::Nan, at_s, for_s)
    }

    fn roll(mode: Mode) -> FaultSchedule<usize> {
        let other = Fault::new(FaultTarget::Wind, FaultKind::Step, 0.0, None);
        let mut scenario = Scenario { fault: vec![other, fault(0.1, None)], ..Scenario::default() };
        scenario.run.mode = mode;
        FaultSchedule::new(&scenario, |number, fault| (fault.target == FaultTarget::Mpc).then_some(number))
    }

    fn on(roll: &FaultSchedule<usize>, tick: u64) -> Vec<usize> {
        roll.on(tick).map(|entry| entry.effect).collect()
    }

    #[test]
    fn a_fault_ends_when_it_is_told_to_and_others_come() {
        let mut roll = roll(Mode::Realtime);
        let room = roll.entries.capacity();
        assert_eq!(on(&roll, 500), [1]);
        roll.apply_fault(1, &fault(0.1, Some(0.2)), Some(7));
        roll.apply_fault(2, &fault(0.3, Some(0.1)), Some(2));
        roll.apply_fault(3, &fault(0.3, None), None);
        assert_eq!([29, 30, 40].map(|tick| on(&roll, tick)), [vec![1], vec![2], vec![]]);
        for number in 2..2 * ROOM {
            roll.apply_fault(number, &fault(0.3, None), Some(number));
        }
        assert_eq!(roll.entries.capacity(), room, "what is too much is left out");
        assert_eq!(on(&roll, 500).len(), room - 1, "but the one that is over");
    }

    #[test]
    fn one_given_while_flying_leaves_another_of_its_number_as_it_is() {
        let mut roll = roll(Mode::Realtime);
        roll.apply_fault(1, &fault(3.0, Some(1.0)), Some(7));
        assert_eq!([20, 310, 420].map(|tick| on(&roll, tick)), [vec![1], vec![1, 7], vec![1]]);
        roll.apply_fault(1, &fault(3.0, Some(0.1)), Some(7));
        assert_eq!([20, 309, 310].map(|tick| on(&roll, tick)), [vec![1], vec![1, 7], vec![1]]);
    }

    #[test]
    fn where_none_can_come_there_is_no_room() {
        assert_eq!(roll(Mode::Lockstep).entries.capacity(), 2);
        assert!(!FaultSchedule::<()>::new(&Scenario { fault: vec![], ..lockstep() }, |_, _| Some(())).may_strike());
        assert!(roll(Mode::Realtime).may_strike());
    }

    fn lockstep() -> Scenario {
        let mut scenario = Scenario::default();
        scenario.run.mode = Mode::Lockstep;
        scenario
    }
}
