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
mod outcome;

pub use self::outcome::{Limits, Outcome, Verdict};

use contract::Scenario;
use contract::scenario::{FaultKind, Solver as Choice};
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
