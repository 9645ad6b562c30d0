//! Limits and outcome of a solve.

use settings::{Mode, Scenario};

/// Amount that a fault subtracts from a slack so that no plan is feasible.
pub const CONTRADICTION: f64 = 1e6;

/// Result of a solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SolveVerdict {
    /// Optimum, to the solver's tolerance.
    Solved,
    /// Last iterate, which may be outside the set, when iterations or time ran out.
    LimitReached,
    /// No plan.
    Failed,
}

/// Result and effort of a solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SolveOutcome {
    /// Result of the solve.
    pub verdict: SolveVerdict,
    /// Number of iterations.
    pub iterations: u64,
}

/// Limits of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolveLimits {
    /// Largest number of iterations.
    pub iterations: u32,
    /// Longest time \[s\]; infinite without a limit.
    pub time_s: f64,
}

impl SolveLimits {
    /// Reads the limits of a scenario; time is limited in mode `realtime` only.
    pub fn of(scenario: &Scenario) -> Self {
        let timed = scenario.run.mode == Mode::Realtime && scenario.attitude.mpc.time_limit_ms > 0.0;
        let time_s = if timed { scenario.attitude.mpc.time_limit_ms / 1e3 } else { f64::INFINITY };
        Self { iterations: scenario.attitude.mpc.max_iterations, time_s }
    }
}
