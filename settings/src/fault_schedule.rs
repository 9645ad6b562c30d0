//! Schedule of the faults of one part of the stack: which are active on a tick, with their numbers.
//!
//! The faults of the scenario are in the schedule from the start. In real time, faults can be added and ended early in
//! flight (`runtime::fault_table`). The schedule reserves room for them, so that nothing is allocated in flight.

use std::ops::Range;

use crate::table::fault::{Fault, FaultKind, FaultTarget};
use crate::table::run::{Mode, Scenario};

/// Longest delay of a sensor that can be given in flight \[ms\]: the plant keeps its measurements for this long.
pub const MAX_SENSOR_DELAY_MS: f64 = 1000.0;
/// Longest delay of a sensor \[samples\], for which the memory of the plant has room.
pub const MAX_SENSOR_DELAY_TICKS: u64 = 1000;
/// Largest number of faults that can be given in flight: the room in shared memory and in every schedule.
pub const MAX_LIVE_FAULTS: usize = 128;

/// Faults of one part of the stack: first the faults of the scenario in the order of their numbers, then the faults
/// given in flight. `E` is the effect of a fault on that part.
#[derive(Debug, Clone)]
pub struct FaultSchedule<E> {
    entries: Vec<Entry<E>>,
    sample_s: f64,
}

/// One fault of the schedule.
#[derive(Debug, Clone)]
pub struct Entry<E> {
    /// Index among all faults of the run; the fault's random draws depend on it.
    pub number: usize,
    /// Target, kind and beginning \[s\]; faults of the same number that differ in one of these are different faults.
    what: (FaultTarget, FaultKind, f64),
    /// Ticks on which the fault is active.
    pub ticks: Range<u64>,
    /// Effect on the part of the stack.
    pub effect: E,
}

impl<E> FaultSchedule<E> {
    /// Schedules those faults of `scenario` for which `effect`, called with number and fault, returns `Some`.
    pub fn new(scenario: &Scenario, effect: impl Fn(usize, &Fault) -> Option<E>) -> Self {
        let room = if scenario.run.mode == Mode::Realtime { MAX_LIVE_FAULTS } else { 0 };
        let entries = Vec::with_capacity(scenario.fault.len() + room);
        let mut schedule = Self { entries, sample_s: scenario.sample_s() };
        for (number, fault) in scenario.fault.iter().enumerate() {
            schedule.apply_fault(number, fault, effect(number, fault));
        }
        schedule
    }

    /// Adds fault `number`, or changes the end of a known fault. A new fault is ignored without an `effect` or without
    /// room. A candidate may have faults of its own in place of the run's. Then a fault given in flight can have the
    /// number of another fault, and both stay.
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

    /// All faults, active or not.
    pub fn all(&self) -> &[Entry<E>] {
        &self.entries
    }

    /// All faults, active or not, to change their effects.
    pub fn all_mut(&mut self) -> &mut [Entry<E>] {
        &mut self.entries
    }

    /// Effects of the faults that are active on `tick`.
    pub fn on_mut(&mut self, tick: u64) -> impl Iterator<Item = &mut E> {
        self.entries.iter_mut().filter(move |entry| entry.ticks.contains(&tick)).map(|entry| &mut entry.effect)
    }

    /// Faults that are active on `tick`.
    pub fn on(&self, tick: u64) -> impl Iterator<Item = &Entry<E>> {
        self.entries.iter().filter(move |entry| entry.ticks.contains(&tick))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(at_s: f64, for_s: Option<f64>) -> Fault {
        Fault::new(FaultTarget::Mpc, FaultKind::Nan, at_s, for_s)
    }

    fn schedule(mode: Mode) -> FaultSchedule<usize> {
        let other = Fault::new(FaultTarget::Wind, FaultKind::Step, 0.0, None);
        let mut scenario = Scenario { fault: vec![other, fault(0.1, None)], ..Scenario::default() };
        scenario.run.mode = mode;
        FaultSchedule::new(&scenario, |number, fault| (fault.target == FaultTarget::Mpc).then_some(number))
    }

    fn on(schedule: &FaultSchedule<usize>, tick: u64) -> Vec<usize> {
        schedule.on(tick).map(|entry| entry.effect).collect()
    }

    #[test]
    fn faults_given_in_flight_are_added_up_to_the_reserved_room() {
        let mut schedule = schedule(Mode::Realtime);
        let room = schedule.entries.capacity();
        assert_eq!(on(&schedule, 500), [1]);
        schedule.apply_fault(1, &fault(0.1, Some(0.2)), Some(7));
        schedule.apply_fault(2, &fault(0.3, Some(0.1)), Some(2));
        schedule.apply_fault(3, &fault(0.3, None), None);
        assert_eq!([29, 30, 40].map(|tick| on(&schedule, tick)), [vec![1], vec![2], vec![]]);
        for number in 2..2 * MAX_LIVE_FAULTS {
            schedule.apply_fault(number, &fault(0.3, None), Some(number));
        }
        assert_eq!(schedule.entries.capacity(), room, "beyond the room faults are left out");
        assert_eq!(on(&schedule, 500).len(), room - 1, "all but the one that is over");
    }

    #[test]
    fn a_fault_given_in_flight_leaves_another_of_its_number_as_it_is() {
        let mut schedule = schedule(Mode::Realtime);
        schedule.apply_fault(1, &fault(3.0, Some(1.0)), Some(7));
        assert_eq!([20, 310, 420].map(|tick| on(&schedule, tick)), [vec![1], vec![1, 7], vec![1]]);
        schedule.apply_fault(1, &fault(3.0, Some(0.1)), Some(7));
        assert_eq!([20, 309, 310].map(|tick| on(&schedule, tick)), [vec![1], vec![1, 7], vec![1]]);
    }

    #[test]
    fn room_is_reserved_in_real_time_only() {
        assert_eq!(schedule(Mode::Lockstep).entries.capacity(), 2);
        let none = FaultSchedule::<()>::new(&Scenario { fault: vec![], ..lockstep() }, |_, _| Some(()));
        assert_eq!(none.entries.capacity(), 0);
        assert!(schedule(Mode::Realtime).entries.capacity() > 0);
    }

    fn lockstep() -> Scenario {
        let mut scenario = Scenario::default();
        scenario.run.mode = Mode::Lockstep;
        scenario
    }
}
