//! What a solve is granted, and what it comes to.

use contract::Scenario;
use contract::scenario::Mode;

/// What a fault takes from a slack to leave no plan: more than any plan has.
pub const CONTRADICTION: f64 = 1e6;

/// What a solve came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The optimum, to the solver's tolerance.
    Solved,
    /// Iterations or time ran out: the last iterate, which may be outside the set.
    LimitReached,
    /// Nothing.
    Failed,
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// What it came to.
    pub verdict: Verdict,
    /// Iterations it took.
    pub iterations: u64,
}

/// What a solve is granted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Iterations.
    pub iterations: u32,
    /// Time \[s\].
    pub time_s: f64,
}

impl Limits {
    /// The limits of a scenario: time only where there is a clock.
    pub fn of(scenario: &Scenario) -> Self {
        let timed = scenario.run.mode == Mode::Realtime && scenario.mpc.time_limit_ms > 0.0;
        let time_s = if timed { scenario.mpc.time_limit_ms / 1e3 } else { f64::INFINITY };
        Self { iterations: scenario.mpc.max_iterations, time_s }
    }
}
