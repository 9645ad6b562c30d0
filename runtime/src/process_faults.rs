//! The faults of one process: the only place that reads new faults and computes their effects on the process.
//!
//! ```text
//! scenario, fault table --once a tick--> schedule --> link      changed and lost messages (crate::link)
//!                                                 --> slow      the message is delayed
//!                                                 --> offset    the process reads a shifted clock
//!                                                 --> exit, hog the process ends, or occupies its processor
//!                                                 --> the node's core (vehicle, sensors, solver): new faults
//! ```
//!
//! An exit or a hog affects the process that works on the tick on which the fault begins, and none that is started
//! later. In lockstep and in process the launcher carries out the exits and hogs of the run. A process carries out
//! those of its own settings, if their faults differ from the run's.
//!
//! The offset of a clock shifts the time that the process reads for its stamps and for the check of its own deadline,
//! and nothing else. The kernel and the other processes decide when it is woken.

use std::cell::{Ref, RefCell};
use std::sync::Arc;

use crate::fault_table::FaultUpdates;
use crate::realtime::{ControlPage, now_ns, phase};
use contract::Topic;
use settings::fault_schedule::{Entry, FaultSchedule, MAX_LIVE_FAULTS};
use settings::{Fault, FaultKind, FaultTarget, Mode, Scenario};

/// Default offset of a clock \[ms\].
const USUAL_OFFSET_MS: f64 = 20.0;
/// Default delay of a message \[ms\].
const USUAL_SLOW_MS: f64 = 5.0;

/// Faults of the process that answers on one topic.
pub struct ProcessFaults {
    page: Arc<ControlPage>,
    topic: Topic,
    /// `true` if the process carries out exits and hogs itself.
    acts: bool,
    schedule: RefCell<FaultSchedule<Fault>>,
    updates: RefCell<FaultUpdates>,
    /// Faults that the last update brought.
    new: RefCell<Vec<(usize, Fault)>>,
}

impl ProcessFaults {
    /// Collects the faults of a process with the settings `scenario`; with `acts` it carries out exits and hogs itself.
    pub fn new(page: Arc<ControlPage>, topic: Topic, scenario: &Scenario, acts: bool) -> Self {
        let schedule = FaultSchedule::new(scenario, |_, fault| of_process(topic, fault, acts));
        let in_flight = scenario.run.mode == Mode::Realtime;
        let new = Vec::with_capacity(if in_flight { MAX_LIVE_FAULTS } else { 0 });
        Self { page, topic, acts, schedule: schedule.into(), updates: RefCell::default(), new: new.into() }
    }

    /// Takes new faults from the fault table; called once a tick.
    pub fn update(&self) {
        let mut new = self.new.borrow_mut();
        new.clear();
        self.updates.borrow_mut().take(&self.page.fault_table, |number, fault| {
            self.schedule.borrow_mut().apply_fault(number, fault, of_process(self.topic, fault, self.acts));
            if new.len() < new.capacity() {
                new.push((number, *fault));
            }
        });
    }

    /// Number of entries and changes of the fault table that the process knows.
    pub fn known(&self) -> u64 {
        self.updates.borrow().known()
    }

    /// Passes the faults that the last update brought to `apply`, with their numbers.
    pub fn new_faults(&self, mut apply: impl FnMut(usize, &Fault)) {
        self.new.borrow().iter().for_each(|(number, fault)| apply(*number, fault));
    }

    /// All faults of the process, active or not.
    pub fn schedule(&self) -> Ref<'_, FaultSchedule<Fault>> {
        self.schedule.borrow()
    }

    /// Delay of the answer to sample `tick` \[ns\].
    pub fn held_up_ns(&self, tick: u64) -> u64 {
        self.sum(tick, FaultKind::Slow, |fault| (fault.ms.unwrap_or(USUAL_SLOW_MS) * 1e6) as i64) as u64
    }

    /// Time that the process reads on `tick` when its clock shows `now_ns`; 0 in process, where no clock is read.
    pub fn read_ns(&self, tick: u64, now_ns: u64) -> u64 {
        let offset = |fault: &Fault| (fault.ms.unwrap_or(USUAL_OFFSET_MS) * 1e6) as i64;
        if now_ns == 0 { 0 } else { now_ns.saturating_add_signed(self.sum(tick, FaultKind::Offset, offset)) }
    }

    /// Returns whether the process ends instead of answering to `tick`, when it waited for sample `next`.
    pub fn leaves(&self, next: u64, tick: u64) -> bool {
        let schedule = self.schedule();
        began(&schedule, FaultKind::Exit, next, tick).next().is_some()
    }

    /// First tick after the hogs that begin at a sample from `next` to `tick`; `None` if no hog begins there.
    pub fn burns_until(&self, next: u64, tick: u64) -> Option<u64> {
        let schedule = self.schedule();
        began(&schedule, FaultKind::Hog, next, tick).map(|hog| hog.ticks.end).max()
    }

    fn sum(&self, tick: u64, kind: FaultKind, size: impl Fn(&Fault) -> i64) -> i64 {
        let schedule = self.schedule();
        schedule.on(tick).map(|entry| &entry.effect).filter(|fault| fault.kind == kind).map(size).sum()
    }
}

/// Burns this thread's processor until `until_ns` or the end of the run.
pub fn burn(page: &ControlPage, until_ns: u64) {
    while now_ns() < until_ns && page.phase.count() < phase::LEAVE {
        std::hint::spin_loop();
    }
}

/// Active faults of a kind that began at a sample from `next` to `tick`; empty if `next` is 0, before the first sample.
fn began(
    schedule: &FaultSchedule<Fault>,
    kind: FaultKind,
    next: u64,
    tick: u64,
) -> impl Iterator<Item = &Entry<Fault>> {
    schedule.on(tick).filter(move |entry| entry.effect.kind == kind && next > 0 && next <= entry.ticks.start)
}

/// Returns the fault if it concerns the process that answers on `topic`, or its messages; `None` otherwise.
fn of_process(topic: Topic, fault: &Fault, acts: bool) -> Option<Fault> {
    let own = fault.target.process() == Some(topic);
    let concerns = match fault.kind {
        FaultKind::Exit | FaultKind::Hog => own && acts,
        FaultKind::Slow if own => true,
        FaultKind::Offset => {
            fault.target == FaultTarget::Clock && fault.process.and_then(FaultTarget::process) == Some(topic)
        }
        _ => fault.target.topic() == Some(topic),
    };
    concerns.then_some(*fault)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(topic: Topic, faults: &[Fault]) -> ProcessFaults {
        let scenario = Scenario { fault: faults.to_vec(), ..Scenario::default() };
        ProcessFaults::new(Arc::new(ControlPage::private().expect("memory")), topic, &scenario, true)
    }

    fn of_mixer(faults: &[(FaultKind, f64, Option<f64>)]) -> ProcessFaults {
        let fault = |(kind, at_s, for_s): &(_, _, _)| Fault::new(FaultTarget::Mixer, *kind, *at_s, *for_s);
        of(Topic::Actuators, &faults.iter().map(fault).collect::<Vec<_>>())
    }

    /// Empty list of ticks.
    const NONE: [u64; 0] = [];

    /// Ticks below 100 on which a process ends that works on every tick from `first` on.
    fn leaves(faults: &ProcessFaults, first: u64) -> Vec<u64> {
        (first..100).filter(|tick| faults.leaves(*tick, *tick)).collect()
    }

    #[test]
    fn a_process_ends_with_every_exit_that_begins_while_it_works() {
        let exits = of_mixer(&[(FaultKind::Exit, 0.1, None), (FaultKind::Exit, 0.3, Some(0.05))]);
        assert_eq!(leaves(&exits, 5), [10, 30]);
        assert_eq!(leaves(&exits, 10), [10, 30]);
        assert_eq!(leaves(&exits, 11), [30], "the first began without it");
        assert!(exits.leaves(8, 12), "it slept when it was to leave");
        assert!(!exits.leaves(8, 9) && !exits.leaves(32, 33) && !exits.leaves(0, 12));
        assert_eq!(leaves(&of_mixer(&[(FaultKind::Exit, 0.1, Some(0.0))]), 5), NONE, "one that lasts no time");
        assert_eq!(
            leaves(&of_mixer(&[(FaultKind::Exit, 0.0, None)]), 0),
            NONE,
            "it does not wait for the first sample yet"
        );
    }

    #[test]
    fn a_process_that_burns_its_processor_may_end_too() {
        let both = of_mixer(&[(FaultKind::Hog, 0.1, Some(0.2)), (FaultKind::Exit, 0.1, None)]);
        assert_eq!(both.burns_until(10, 10), Some(30));
        assert_eq!(both.burns_until(11, 11), None);
        assert_eq!(leaves(&both, 5), [10]);
        let others = of(Topic::Actuators, &[Fault::new(FaultTarget::Guidance, FaultKind::Exit, 0.1, None)]);
        assert_eq!(leaves(&others, 5), NONE);
    }

    #[test]
    fn a_process_ignores_exits_that_the_launcher_carries_out() {
        let exit = Fault::new(FaultTarget::Mixer, FaultKind::Exit, 0.1, None);
        let scenario = Scenario { fault: vec![exit], ..Scenario::default() };
        let page = Arc::new(ControlPage::private().expect("memory"));
        assert_eq!(leaves(&ProcessFaults::new(page, Topic::Actuators, &scenario, false), 5), NONE);
    }

    #[test]
    fn the_clock_of_one_process_is_off_while_its_fault_lasts() {
        let fault = Fault {
            process: Some(FaultTarget::Mixer),
            ms: Some(-3.0),
            ..Fault::new(FaultTarget::Clock, FaultKind::Offset, 0.1, Some(0.02))
        };
        let read = |topic| [9, 10, 11, 12].map(|tick| of(topic, &[fault]).read_ns(tick, 5_000_000));
        assert_eq!(read(Topic::Actuators), [5_000_000, 2_000_000, 2_000_000, 5_000_000]);
        assert_eq!(read(Topic::Controls), [5_000_000; 4]);
        assert_eq!(of(Topic::Actuators, &[fault]).read_ns(10, 0), 0, "in process");
    }

    #[test]
    fn a_fault_given_in_flight_is_taken_once_and_handed_on() {
        let faults = of(Topic::Actuators, &[]);
        let slow = Fault { ms: Some(2.0), ..Fault::new(FaultTarget::Mixer, FaultKind::Slow, 0.1, Some(0.1)) };
        let new = || {
            let mut new = vec![];
            faults.update();
            faults.new_faults(|number, fault| new.push((number, fault.kind)));
            new
        };
        assert_eq!(new(), []);
        assert!(faults.page.fault_table.enter(4, &slow));
        assert_eq!((new(), new()), (vec![(4, FaultKind::Slow)], vec![]));
        assert_eq!([9, 10, 19, 20].map(|tick| faults.held_up_ns(tick)), [0, 2_000_000, 2_000_000, 0]);
    }
}
