//! The faults of one process: the one place where a process learns of faults and is asked what they do to it.
//!
//! ```text
//! scenario, fault table --once a tick--> schedule --> link      what becomes of a message (crate::link)
//!                                                 --> slow      the message is held up
//!                                                 --> offset    the process reads another time
//!                                                 --> exit, hog the process leaves, or burns its processor
//!                                                 --> the node's core (vehicle, sensors, solver): new faults
//! ```
//!
//! An exit or a hog begins on one tick, for the process that works then: one that was started later has no part in it.
//! In lockstep and in process the launcher acts out those of the run; a process acts out those of its own settings.
//!
//! The offset of a clock shifts what the process reads, for its stamps and for the judgement of its own deadline, and
//! nothing else: when it is woken is up to the kernel and the other processes.

use std::cell::{Ref, RefCell};
use std::sync::Arc;

use crate::fault_table::FaultUpdates;
use crate::realtime::{ControlPage, now_ns, phase};
use contract::Topic;
use contract::fault_schedule::{Entry, FaultSchedule, MAX_LIVE_FAULTS};
use contract::scenario::{Fault, FaultKind, FaultTarget, Mode, Scenario};

/// How far a clock is off, if the fault does not say \[ms\].
const USUAL_OFFSET_MS: f64 = 20.0;
/// How long a message is held up, if the fault does not say \[ms\].
const USUAL_SLOW_MS: f64 = 5.0;

/// The faults of the process that answers on one topic.
pub struct ProcessFaults {
    page: Arc<ControlPage>,
    topic: Topic,
    /// Whether it leaves and burns by itself.
    acts: bool,
    schedule: RefCell<FaultSchedule<Fault>>,
    updates: RefCell<FaultUpdates>,
    /// What the last update brought.
    new: RefCell<Vec<(usize, Fault)>>,
}

impl ProcessFaults {
    /// Of the process that answers on `topic` with the settings `scenario`; with `acts` it leaves and burns by itself.
    pub fn new(page: Arc<ControlPage>, topic: Topic, scenario: &Scenario, acts: bool) -> Self {
        let schedule = FaultSchedule::new(scenario, |_, fault| of_process(topic, fault, acts));
        let in_flight = scenario.run.mode == Mode::Realtime;
        let new = Vec::with_capacity(if in_flight { MAX_LIVE_FAULTS } else { 0 });
        Self { page, topic, acts, schedule: schedule.into(), updates: RefCell::default(), new: new.into() }
    }

    /// Takes what the fault table has new; once a tick.
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

    /// How many entries and changes of the fault table the process knows.
    pub fn known(&self) -> u64 {
        self.updates.borrow().known()
    }

    /// Hands what the last update brought to `apply`, with its number.
    pub fn new_faults(&self, mut apply: impl FnMut(usize, &Fault)) {
        self.new.borrow().iter().for_each(|(number, fault)| apply(*number, fault));
    }

    /// All of them.
    pub fn schedule(&self) -> Ref<'_, FaultSchedule<Fault>> {
        self.schedule.borrow()
    }

    /// How long the answer to sample `tick` is held up \[ns\].
    pub fn held_up_ns(&self, tick: u64) -> u64 {
        self.sum(tick, FaultKind::Slow, |fault| (fault.ms.unwrap_or(USUAL_SLOW_MS) * 1e6) as i64) as u64
    }

    /// What the process reads on `tick` when it is `now_ns`; in process no clock is read, and stays at zero.
    pub fn read_ns(&self, tick: u64, now_ns: u64) -> u64 {
        let offset = |fault: &Fault| (fault.ms.unwrap_or(USUAL_OFFSET_MS) * 1e6) as i64;
        if now_ns == 0 { 0 } else { now_ns.saturating_add_signed(self.sum(tick, FaultKind::Offset, offset)) }
    }

    /// Whether the process leaves instead of answering to `tick`, when the sample it waited for was `next`.
    pub fn leaves(&self, next: u64, tick: u64) -> bool {
        let schedule = self.schedule();
        began(&schedule, FaultKind::Exit, next, tick).next().is_some()
    }

    /// The first tick on which it does not burn its processor any more, if it begins to before it answers to `tick`.
    pub fn burns_until(&self, next: u64, tick: u64) -> Option<u64> {
        let schedule = self.schedule();
        began(&schedule, FaultKind::Hog, next, tick).map(|hog| hog.ticks.end).max()
    }

    fn sum(&self, tick: u64, kind: FaultKind, size: impl Fn(&Fault) -> i64) -> i64 {
        let schedule = self.schedule();
        schedule.on(tick).map(|entry| &entry.effect).filter(|fault| fault.kind == kind).map(size).sum()
    }
}

/// Burns this thread's processor until then, or until the run is over.
pub fn burn(page: &ControlPage, until_ns: u64) {
    while now_ns() < until_ns && page.phase.count() < phase::LEAVE {
        std::hint::spin_loop();
    }
}

/// Those of a kind that begin with `tick`, or since the sample `next`; 0 is that of a process that waits for its first.
fn began(
    schedule: &FaultSchedule<Fault>,
    kind: FaultKind,
    next: u64,
    tick: u64,
) -> impl Iterator<Item = &Entry<Fault>> {
    schedule.on(tick).filter(move |entry| entry.effect.kind == kind && next > 0 && next <= entry.ticks.start)
}

/// The fault, if it concerns the process that answers on `topic`, or the messages that it sends.
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

    /// The ticks up to the 99th on which a process leaves that comes with tick `first` and misses none.
    fn leaves(faults: &ProcessFaults, first: u64) -> Vec<u64> {
        (first..100).filter(|tick| faults.leaves(*tick, *tick)).collect()
    }

    #[test]
    fn a_process_leaves_with_every_exit_that_begins_while_it_is_there() {
        let exits = of_mixer(&[(FaultKind::Exit, 0.1, None), (FaultKind::Exit, 0.3, Some(0.05))]);
        assert_eq!(leaves(&exits, 5), [10, 30]);
        assert_eq!(leaves(&exits, 10), [10, 30]);
        assert_eq!(leaves(&exits, 11), [30], "the first began without it");
        assert!(exits.leaves(8, 12), "it slept when it was to leave");
        assert!(!exits.leaves(8, 9) && !exits.leaves(32, 33) && !exits.leaves(0, 12));
        assert_eq!(leaves(&of_mixer(&[(FaultKind::Exit, 0.1, Some(0.0))]), 5), [], "one that lasts no time");
        assert_eq!(
            leaves(&of_mixer(&[(FaultKind::Exit, 0.0, None)]), 0),
            [],
            "it does not wait for the first sample yet"
        );
    }

    #[test]
    fn a_process_that_burns_its_processor_may_leave_too() {
        let both = of_mixer(&[(FaultKind::Hog, 0.1, Some(0.2)), (FaultKind::Exit, 0.1, None)]);
        assert_eq!(both.burns_until(10, 10), Some(30));
        assert_eq!(both.burns_until(11, 11), None);
        assert_eq!(leaves(&both, 5), [10]);
        let others = of(Topic::Actuators, &[Fault::new(FaultTarget::Guidance, FaultKind::Exit, 0.1, None)]);
        assert_eq!(leaves(&others, 5), []);
    }

    #[test]
    fn what_the_launcher_acts_out_the_process_does_not() {
        let exit = Fault::new(FaultTarget::Mixer, FaultKind::Exit, 0.1, None);
        let scenario = Scenario { fault: vec![exit], ..Scenario::default() };
        let page = Arc::new(ControlPage::private().expect("memory"));
        assert_eq!(leaves(&ProcessFaults::new(page, Topic::Actuators, &scenario, false), 5), []);
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
