//! The plan: who is away on which tick, as far as the scenario decides it.
//!
//! In lockstep and in process a scripted death takes effect between two ticks, and so does the replacement, however long
//! that takes on the wall clock: the same flight every time.
//!
//! ```text
//! kill, exit   gone for `for_s`, or RESTART; then another process continues from the memory of the last tick
//! stop, hog    hangs for `for_s`; beyond HANG it is noticed, killed, and replaced RESTART later
//! ```

use crate::Topic;
use crate::scenario::{Fault, FaultKind, Scenario, Swap, SwapNode, SwapTicks};

/// From a death that was noticed to the replacement's first tick \[s\].
pub const RESTART_S: f64 = 0.1;
/// Ticks without progress after which a process counts as hung.
pub const HANG_TICKS: u64 = 3;

/// Who is away when, and when somebody new may come or go.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    absences: [Vec<Absence>; Topic::COUNT],
    /// From the candidate's first tick to the first without the one before it.
    swaps: Vec<std::ops::RangeInclusive<u64>>,
}

/// Ticks on which a node is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Absence {
    /// The first.
    pub from: u64,
    /// The first on which somebody is there again.
    pub until: u64,
    /// Whether it is another process that comes back.
    pub replaced: bool,
}

impl Plan {
    /// What the process faults and swaps of `scenario` come to.
    pub fn new(scenario: &Scenario) -> Self {
        let sample_s = scenario.sample_s();
        let of = |topic| {
            let struck = scenario.fault.iter().filter(|fault| fault.target.process() == Some(topic));
            struck.filter_map(|fault| Absence::of(fault, sample_s)).collect()
        };
        let span = |swap: &Swap| {
            let SwapTicks { from, until, .. } = swap.ticks(sample_s);
            from..=if swap.node == SwapNode::Recorder { from } else { until } // it takes over at once
        };
        Self { absences: Topic::ALL.map(of), swaps: scenario.swap.iter().map(span).collect() }
    }

    /// Why the publisher of `topic` is away on `tick`, if it is: of several reasons the one that lasts longest.
    pub fn absence(&self, topic: Topic, tick: u64) -> Option<Absence> {
        let here = |absence: &&Absence| (absence.from..absence.until).contains(&tick);
        self.absences[topic as usize].iter().filter(here).max_by_key(|absence| absence.until).copied()
    }

    /// Whether somebody may come or go as `tick` begins.
    pub fn decides(&self, tick: u64) -> bool {
        let turns = |absence: &Absence| absence.from == tick || absence.until == tick;
        self.absences.iter().flatten().any(turns) || self.swaps.iter().any(|swap| swap.contains(&tick))
    }
}

impl Absence {
    /// What a fault of a process comes to; `None` when the process is there all the time.
    pub fn of(fault: &Fault, sample_s: f64) -> Option<Self> {
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

    /// From which tick to which, and whether another comes back, under a fault of attitude-mpc at tick 10.
    fn absence(kind: FaultKind, for_s: Option<f64>) -> (u64, u64, bool) {
        let fault = Fault::new(FaultTarget::AttitudeMpc, kind, 0.1, for_s);
        let scenario = Scenario { fault: vec![fault], ..Scenario::default() };
        let plan = Plan::new(&scenario);
        assert!((0..100).all(|tick| plan.absence(Topic::Actuators, tick).is_none()), "nobody else is struck");
        let away: Vec<u64> = (0..100).filter(|tick| plan.absence(Topic::Controls, *tick).is_some()).collect();
        let until = away[0] + away.len() as u64;
        assert_eq!((0..100).filter(|tick| plan.decides(*tick)).collect::<Vec<_>>(), [away[0], until]);
        (away[0], until, plan.absence(Topic::Controls, away[0]).unwrap().replaced)
    }

    #[test]
    fn who_is_killed_comes_back_as_another() {
        assert_eq!(absence(FaultKind::Kill, Some(0.03)), (10, 13, true));
        assert_eq!(absence(FaultKind::Exit, None), (10, 20, true), "0.1 s later");
    }

    #[test]
    fn who_hangs_is_replaced_when_it_is_noticed() {
        assert_eq!(absence(FaultKind::Stop, Some(0.03)), (10, 13, false), "it came back by itself");
        assert_eq!(absence(FaultKind::Stop, Some(5.0)), (10, 23, true));
        assert_eq!(absence(FaultKind::Hog, None), (10, 23, true));
    }

    #[test]
    fn a_swap_may_be_decided_on_any_of_its_ticks() {
        let swap = Swap { standby_s: 0.05, watch_s: 0.1, ..Swap::new(SwapNode::Mixer, 0.2) };
        let recorder = Swap { node: SwapNode::Recorder, at_s: 0.4, ..swap.clone() };
        let scenario = Scenario { swap: vec![swap, recorder], ..Scenario::default() };
        let plan = Plan::new(&scenario);
        let decided: Vec<u64> = (0..100).filter(|tick| plan.decides(*tick)).collect();
        assert_eq!(decided, (20..=35).chain([40]).collect::<Vec<_>>(), "a recorder takes over at once");
    }
}
