//! The skew: how far the clock of one process is off, as a `[[fault]]` wants it.
//!
//! It shifts what the process reads, for its stamps and for the judgement of its own deadline, and nothing else: when it
//! is woken is the kernel's business and the others'. Without a clock, in lockstep, no flight depends on it.

use contract::Topic;
use contract::scenario::{Fault, FaultTarget, Scenario};

/// Of a fault that does not say \[ms\].
const USUAL_MS: f64 = 20.0;

/// What is wrong with the clock of one process, tick by tick.
pub struct Skew {
    faults: Vec<Fault>,
    /// Sample time \[s\].
    sample_s: f64,
}

impl Skew {
    /// Of the process that speaks on `topic`.
    pub fn new(scenario: &Scenario, topic: Topic) -> Self {
        let of_it = |fault: &&Fault| {
            fault.target == FaultTarget::Clock && fault.process.and_then(FaultTarget::process) == Some(topic)
        };
        Self { faults: scenario.fault.iter().filter(of_it).copied().collect(), sample_s: scenario.sample_s() }
    }

    /// What the process reads on `tick` when it is `now_ns`.
    pub fn read_ns(&self, tick: u64, now_ns: u64) -> u64 {
        let at_work = self.faults.iter().filter(|fault| fault.strikes(tick, self.sample_s));
        let offsets = at_work.map(|fault| (fault.ms.unwrap_or(USUAL_MS) * 1e6) as i64);
        now_ns.saturating_add_signed(offsets.sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::scenario::FaultKind;

    #[test]
    fn one_process_is_off_while_its_fault_lasts() {
        let fault = Fault {
            process: Some(FaultTarget::Mixer),
            ms: Some(-3.0),
            ..Fault::new(FaultTarget::Clock, FaultKind::Offset, 0.1, Some(0.02))
        };
        let scenario = Scenario { fault: vec![fault], ..Scenario::default() };
        let read = |topic| [9, 10, 11, 12].map(|tick| Skew::new(&scenario, topic).read_ns(tick, 5_000_000));
        assert_eq!(read(Topic::Actuators), [5_000_000, 2_000_000, 2_000_000, 5_000_000]);
        assert_eq!(read(Topic::Controls), [5_000_000; 4]);
    }
}
