//! The process fault: a fault of the process itself. It leaves, or burns its processor.
//!
//! It begins on one tick, for who is there by then: whoever was started later has no part in it.

use crate::realtime::{ControlPage, now_ns, phase};
use contract::Topic;
use contract::fault_schedule::{Entry, FaultSchedule};
use contract::scenario::{Fault, FaultKind, Scenario};

/// The process faults of one process.
pub struct ProcessFaults {
    topic: Topic,
    faults: FaultSchedule<FaultKind>,
}

impl ProcessFaults {
    /// Of the process that speaks on `topic`.
    pub fn new(scenario: &Scenario, topic: Topic) -> Self {
        Self { topic, faults: FaultSchedule::new(scenario, |_, fault| process_fault(topic, fault)) }
    }

    /// Takes fault `number` as it is from now on: see [`FaultSchedule::apply_fault`].
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, process_fault(self.topic, fault));
    }

    /// Whether the process leaves instead of answering to `tick`, when the sample it waited for was `next`.
    pub fn leaves(&self, next: u64, tick: u64) -> bool {
        self.begin(next, tick).any(|process_fault| process_fault.effect == FaultKind::Exit)
    }

    /// The first tick on which it does not burn its processor any more, if it begins to before it answers to `tick`.
    pub fn burns_until(&self, next: u64, tick: u64) -> Option<u64> {
        let hogs = self.begin(next, tick).filter(|process_fault| process_fault.effect == FaultKind::Hog);
        hogs.map(|process_fault| process_fault.ticks.end).max()
    }

    /// Those that begin with `tick`, or since the sample `next`; 0 is that of a process that waits for its first.
    fn begin(&self, next: u64, tick: u64) -> impl Iterator<Item = &Entry<FaultKind>> {
        self.faults.on(tick).filter(move |process_fault| next > 0 && next <= process_fault.ticks.start)
    }
}

/// Burns this thread's processor until then, or until the run is over.
pub fn burn(page: &ControlPage, until_ns: u64) {
    while now_ns() < until_ns && page.phase().count() < phase::LEAVE {
        std::hint::spin_loop();
    }
}

/// What `fault` is to the process that speaks on `topic`: nothing, unless it is its own.
fn process_fault(topic: Topic, fault: &Fault) -> Option<FaultKind> {
    let of_itself = matches!(fault.kind, FaultKind::Exit | FaultKind::Hog) && fault.target.process() == Some(topic);
    of_itself.then_some(fault.kind)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::scenario::FaultTarget;

    fn process_faults(faults: &[(FaultKind, f64, Option<f64>)]) -> ProcessFaults {
        let fault = |(kind, at_s, for_s): &(_, _, _)| Fault::new(FaultTarget::Mixer, *kind, *at_s, *for_s);
        let scenario = Scenario { fault: faults.iter().map(fault).collect(), ..Scenario::default() };
        ProcessFaults::new(&scenario, Topic::Actuators)
    }

    /// The ticks up to the 99th on which a process leaves that comes with tick `first` and misses none.
    fn leaves(process_faults: &ProcessFaults, first: u64) -> Vec<u64> {
        (first..100).filter(|tick| process_faults.leaves(*tick, *tick)).collect()
    }

    #[test]
    fn a_process_leaves_with_every_exit_that_begins_while_it_is_there() {
        let exits = process_faults(&[(FaultKind::Exit, 0.1, None), (FaultKind::Exit, 0.3, Some(0.05))]);
        assert_eq!(leaves(&exits, 5), [10, 30]);
        assert_eq!(leaves(&exits, 10), [10, 30]);
        assert_eq!(leaves(&exits, 11), [30], "the first began without it");
        assert!(exits.leaves(8, 12), "it slept when it was to leave");
        assert!(!exits.leaves(8, 9) && !exits.leaves(32, 33) && !exits.leaves(0, 12));
        assert_eq!(leaves(&process_faults(&[(FaultKind::Exit, 0.1, Some(0.0))]), 5), [], "one that lasts no time");
        assert_eq!(
            leaves(&process_faults(&[(FaultKind::Exit, 0.0, None)]), 0),
            [],
            "nobody waits for the first sample yet"
        );
    }

    #[test]
    fn a_process_that_burns_its_processor_may_leave_too() {
        let both = process_faults(&[(FaultKind::Hog, 0.1, Some(0.2)), (FaultKind::Exit, 0.1, None)]);
        assert_eq!(both.burns_until(10, 10), Some(30));
        assert_eq!(both.burns_until(11, 11), None);
        assert_eq!(leaves(&both, 5), [10]);
        let others = Scenario {
            fault: vec![Fault::new(FaultTarget::Guidance, FaultKind::Exit, 0.1, None)],
            ..Scenario::default()
        };
        assert_eq!(leaves(&ProcessFaults::new(&others, Topic::Actuators), 5), []);
    }
}
