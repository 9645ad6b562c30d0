//! The plan: who works on which tick, as far as the scenario decides it.
//!
//! In lockstep and in process a scripted death takes effect between two ticks, and so does the replacement, however long
//! that takes on the wall clock: the same flight every time.
//!
//! ```text
//! kill, exit   gone for `for_s`, or RESTART; then another process continues from the memory of the last tick
//! stop, hog    hangs for `for_s`; beyond HANG it is noticed, killed, and replaced RESTART later
//! ```

use crate::Topic;
use crate::scenario::{Fault, FaultKind, Scenario};

/// From a death that was noticed to the replacement's first tick \[s\].
pub const RESTART_S: f64 = 0.1;
/// Ticks without progress after which a process counts as hung.
pub const HANG_TICKS: u64 = 3;

/// Who works when.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    absences: [Vec<Absence>; Topic::COUNT],
}

/// Ticks on which a node is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Absence {
    from: u64,
    until: u64,
    /// Whether it is another process that comes back.
    replaced: bool,
}

impl Plan {
    /// What the process faults of `scenario` come to.
    pub fn new(scenario: &Scenario) -> Self {
        let sample_s = scenario.sample_s();
        let of = |topic| {
            let struck = scenario.fault.iter().filter(|fault| fault.target.process() == Some(topic));
            struck.filter_map(|fault| Absence::of(fault, sample_s)).collect()
        };
        Self { absences: Topic::ALL.map(of) }
    }

    /// The epoch of the process that works as the publisher of `topic` on `tick`; 0 when there is none.
    pub fn epoch(&self, topic: Topic, tick: u64) -> u32 {
        let absences = &self.absences[topic as usize];
        if absences.iter().any(|absence| (absence.from..absence.until).contains(&tick)) {
            return 0;
        }
        1 + absences.iter().filter(|absence| absence.replaced && absence.until <= tick).count() as u32
    }

    /// The epoch of the process that is to be there after all that has happened up to `tick`: it may be started then.
    pub fn successor(&self, topic: Topic, tick: u64) -> u32 {
        let gone = |absence: &&Absence| absence.replaced && absence.from <= tick;
        1 + self.absences[topic as usize].iter().filter(gone).count() as u32
    }
}

impl Absence {
    fn of(fault: &Fault, sample_s: f64) -> Option<Self> {
        let ticks = |time_s: f64| (time_s / sample_s - 1e-6).ceil() as u64;
        let from = fault.ticks(sample_s).start;
        let (length, replaced) = match fault.kind {
            FaultKind::Kill | FaultKind::Exit => (ticks(fault.for_s.unwrap_or(RESTART_S)), true),
            FaultKind::Stop | FaultKind::Hog => {
                let wanted = fault.for_s.map_or(u64::MAX, ticks);
                if wanted > HANG_TICKS { (HANG_TICKS + ticks(RESTART_S), true) } else { (wanted, false) }
            }
            _ => return None,
        };
        (length > 0).then_some(Self { from, until: from + length, replaced })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::FaultTarget;

    /// Epochs of attitude-mpc from tick 8 on, under a fault at tick 10.
    fn epochs(kind: FaultKind, for_s: Option<f64>, count: usize) -> Vec<u32> {
        let fault = Fault::new(FaultTarget::AttitudeMpc, kind, 0.1, for_s);
        let scenario = Scenario { fault: vec![fault], ..Scenario::default() };
        let plan = Plan::new(&scenario);
        assert!((0..100).all(|tick| plan.epoch(Topic::Actuators, tick) == 1), "nobody else is struck");
        (8..).take(count).map(|tick| plan.epoch(Topic::Controls, tick)).collect()
    }

    #[test]
    fn who_is_killed_comes_back_as_another() {
        assert_eq!(epochs(FaultKind::Kill, Some(0.03), 7), [1, 1, 0, 0, 0, 2, 2]);
        assert_eq!(epochs(FaultKind::Kill, Some(0.0), 4), [1, 1, 1, 1], "gone for no tick");
        assert_eq!(epochs(FaultKind::Exit, None, 14), [1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 2], "0.1 s later");
    }

    #[test]
    fn who_hangs_is_replaced_when_it_is_noticed() {
        assert_eq!(epochs(FaultKind::Stop, Some(0.03), 7), [1, 1, 0, 0, 0, 1, 1], "it came back by itself");
        let replaced = epochs(FaultKind::Stop, Some(5.0), 17);
        assert_eq!(replaced, [[1; 2].as_slice(), &[0; 13], &[2; 2]].concat());
        assert_eq!(replaced, epochs(FaultKind::Hog, None, 17));
    }

    #[test]
    fn two_deaths_make_a_third_process() {
        let kill = |at_s| Fault::new(FaultTarget::Mixer, FaultKind::Kill, at_s, Some(0.02));
        let scenario = Scenario { fault: vec![kill(0.1), kill(0.2)], ..Scenario::default() };
        let plan = Plan::new(&scenario);
        let ticks = [5, 10, 12, 19, 20, 22];
        assert_eq!(ticks.map(|tick| plan.epoch(Topic::Actuators, tick)), [1, 0, 2, 2, 0, 3]);
        assert_eq!(ticks.map(|tick| plan.successor(Topic::Actuators, tick)), [1, 2, 2, 2, 3, 3]);
    }
}
