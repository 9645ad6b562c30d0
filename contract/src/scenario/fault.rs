//! `[[fault]]`: what goes wrong, and when. A function of the tick and the run's seed, so that a faulty run repeats.

use serde::{Deserialize, Serialize};

/// One `[[fault]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// When it begins \[s\].
    pub at_s: f64,
    /// How long it lasts \[s\]; absent = until the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
    /// What it strikes.
    pub target: FaultTarget,
    /// What happens to it.
    pub kind: FaultKind,
}

/// `fault.target`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultTarget {
    /// The solver inside attitude-mpc.
    #[serde(rename = "mpc", alias = "solver")]
    Mpc,
}

/// `fault.kind`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FaultKind {
    /// The solver is given constraints that contradict each other.
    Infeasible,
    /// The solver is given numbers that are none.
    Nan,
    /// The solver is granted a single iteration.
    #[serde(rename = "iteration cap", alias = "iteration-cap", alias = "iteration_cap")]
    IterationCap,
}

impl Fault {
    /// Whether it is at work on `tick`, at a sample time \[s\].
    pub fn strikes(&self, tick: u64, sample_s: f64) -> bool {
        // The first tick at or after a time; a time that is a tick but for rounding is that tick.
        let tick_of = |time_s: f64| (time_s / sample_s - 1e-6).ceil() as u64;
        let first = tick_of(self.at_s);
        let end = self.for_s.map_or(u64::MAX, |for_s| tick_of(self.at_s + for_s));
        (first..end).contains(&tick)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_strikes_from_its_first_tick_to_before_its_end() {
        let fault = |at_s, for_s| Fault { at_s, for_s, target: FaultTarget::Mpc, kind: FaultKind::Nan };
        let struck = |fault: &Fault| (0..1000).filter(|tick| fault.strikes(*tick, 0.01)).collect::<Vec<_>>();
        assert_eq!(struck(&fault(0.29, Some(0.03))), [29, 30, 31]);
        assert_eq!(struck(&fault(0.291, Some(0.01))), [30]);
        assert_eq!(struck(&fault(9.98, None)), [998, 999]);
        assert!(struck(&fault(1.0, Some(0.0))).is_empty());
    }
}
