//! The seizure: a fault of the process itself. It leaves, or burns its processor.
//!
//! It begins on one tick, for who is there by then: whoever was started later has no part in it.

use crate::realtime::{Board, now_ns, phase};
use contract::Topic;
use contract::roll::{Entry, Roll};
use contract::scenario::{Fault, FaultKind, Scenario};

/// The seizures of one process.
pub struct Seizures {
    topic: Topic,
    faults: Roll<FaultKind>,
}

impl Seizures {
    /// Of the process that speaks on `topic`.
    pub fn new(scenario: &Scenario, topic: Topic) -> Self {
        Self { topic, faults: Roll::new(scenario, |_, fault| seizure(topic, fault)) }
    }

    /// Takes fault `number` as it is from now on: see [`Roll::suffer`].
    pub fn suffer(&mut self, number: usize, fault: &Fault) {
        self.faults.suffer(number, fault, seizure(self.topic, fault));
    }

    /// Whether the process leaves instead of answering to `tick`, when the sample it waited for was `next`.
    pub fn leaves(&self, next: u64, tick: u64) -> bool {
        self.begin(next, tick).any(|seizure| seizure.effect == FaultKind::Exit)
    }

    /// The first tick on which it does not burn its processor any more, if it begins to before it answers to `tick`.
    pub fn burns_until(&self, next: u64, tick: u64) -> Option<u64> {
        let hogs = self.begin(next, tick).filter(|seizure| seizure.effect == FaultKind::Hog);
        hogs.map(|seizure| seizure.ticks.end).max()
    }

    /// Those that begin with `tick`, or since the sample `next`; 0 is that of a process that waits for its first.
    fn begin(&self, next: u64, tick: u64) -> impl Iterator<Item = &Entry<FaultKind>> {
        self.faults.on(tick).filter(move |seizure| next > 0 && next <= seizure.ticks.start)
    }
}

/// Burns this thread's processor until then, or until the run is over.
pub fn burn(board: &Board, until_ns: u64) {
    while now_ns() < until_ns && board.phase().count() < phase::LEAVE {
        std::hint::spin_loop();
    }
}

/// What `fault` is to the process that speaks on `topic`: nothing, unless it is its own.
fn seizure(topic: Topic, fault: &Fault) -> Option<FaultKind> {
    let of_itself = matches!(fault.kind, FaultKind::Exit | FaultKind::Hog) && fault.target.process() == Some(topic);
    of_itself.then_some(fault.kind)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::scenario::FaultTarget;

    fn seizures(faults: &[(FaultKind, f64, Option<f64>)]) -> Seizures {
        let fault = |(kind, at_s, for_s): &(_, _, _)| Fault::new(FaultTarget::Mixer, *kind, *at_s, *for_s);
        let scenario = Scenario { fault: faults.iter().map(fault).collect(), ..Scenario::default() };
        Seizures::new(&scenario, Topic::Actuators)
    }

    /// The ticks up to the 99th on which a process leaves that comes with tick `first` and misses none.
    fn leaves(seizures: &Seizures, first: u64) -> Vec<u64> {
        (first..100).filter(|tick| seizures.leaves(*tick, *tick)).collect()
    }

    #[test]
    fn a_process_leaves_with_every_exit_that_begins_while_it_is_there() {
        let exits = seizures(&[(FaultKind::Exit, 0.1, None), (FaultKind::Exit, 0.3, Some(0.05))]);
        assert_eq!(leaves(&exits, 5), [10, 30]);
        assert_eq!(leaves(&exits, 10), [10, 30]);
        assert_eq!(leaves(&exits, 11), [30], "the first began without it");
        assert!(exits.leaves(8, 12), "it slept when it was to leave");
        assert!(!exits.leaves(8, 9) && !exits.leaves(32, 33) && !exits.leaves(0, 12));
        assert_eq!(leaves(&seizures(&[(FaultKind::Exit, 0.1, Some(0.0))]), 5), [], "one that lasts no time");
        assert_eq!(leaves(&seizures(&[(FaultKind::Exit, 0.0, None)]), 0), [], "nobody waits for the first sample yet");
    }

    #[test]
    fn a_process_that_burns_its_processor_may_leave_too() {
        let both = seizures(&[(FaultKind::Hog, 0.1, Some(0.2)), (FaultKind::Exit, 0.1, None)]);
        assert_eq!(both.burns_until(10, 10), Some(30));
        assert_eq!(both.burns_until(11, 11), None);
        assert_eq!(leaves(&both, 5), [10]);
        let others = Scenario {
            fault: vec![Fault::new(FaultTarget::Guidance, FaultKind::Exit, 0.1, None)],
            ..Scenario::default()
        };
        assert_eq!(leaves(&Seizures::new(&others, Topic::Actuators), 5), []);
    }
}
