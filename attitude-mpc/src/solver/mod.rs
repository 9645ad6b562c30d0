//! The constrained problem, and the two that can solve it.
//!
//! ```text
//! minimise  1/2 (U - U*)'H (U - U*) + 1/2 w sum e^2   over the moves U and the excesses e
//! so that   every move of U is inside the actuators' set, and |y| <= 1 + e for the predicted states y
//! ```
//!
//! Only the unconstrained optimum `U*` and the states' drift depend on the tick; everything else is set up once.
//!
//! | module | holds |
//! |---|---|
//! | [`clarabel`] | the interior-point method, in stages: the default, and the truth |
//! | [`active_set`] | our own dual active-set method: the fast one |

pub mod active_set;
pub mod clarabel;

use contract::Scenario;
use contract::scenario::{FaultKind, Mode, Solver as Choice};
use nalgebra::{DMatrix, DVector};

use self::active_set::ActiveSetSolver;
use self::clarabel::ConicSolver;
use crate::constraints::PlanSet;
use crate::memory::WarmStart;

/// One of the two.
pub enum Solver {
    /// `mpc.solver = "clarabel"`
    Clarabel(Box<ConicSolver>),
    /// `mpc.solver = "active-set"`
    ActiveSet(Box<ActiveSetSolver>),
}

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

impl Solver {
    /// Sets up the problem with the Hessian `H` (4Nu x 4Nu) for the solver a scenario asks for.
    pub fn new(scenario: &Scenario, hessian: &DMatrix<f64>, set: &PlanSet) -> Self {
        let limits = Limits::of(scenario);
        match scenario.mpc.solver {
            Choice::Clarabel => Self::Clarabel(Box::new(ConicSolver::new(hessian, set, limits))),
            Choice::ActiveSet => Self::ActiveSet(Box::new(ActiveSetSolver::new(hessian, set, limits.iterations))),
        }
    }

    /// Finds the best plan of `set` for the `unconstrained` optimum, with the `fault` that is active, if any. Writes `plan`
    /// unless it failed.
    pub fn solve(
        &mut self,
        unconstrained: &DVector<f64>,
        set: &mut PlanSet,
        fault: Option<FaultKind>,
        plan: &mut DVector<f64>,
    ) -> Outcome {
        match self {
            Self::Clarabel(solver) => solver.solve(unconstrained, set, fault, plan),
            Self::ActiveSet(solver) => solver.solve(unconstrained, set, fault, plan),
        }
    }

    /// What one solve leaves to the next: Clarabel starts from nothing.
    pub fn warm_start(&self) -> WarmStart {
        match self {
            Self::Clarabel(_) => WarmStart::default(),
            Self::ActiveSet(solver) => solver.warm_start(),
        }
    }

    /// Lets the next solve start from `from`. Returns false, and changes nothing, where it is not of this set-up.
    pub fn start_from(&mut self, from: &WarmStart) -> bool {
        match self {
            Self::Clarabel(_) => true,
            Self::ActiveSet(solver) => solver.start_from(from),
        }
    }
}

#[cfg(test)]
mod tests;
