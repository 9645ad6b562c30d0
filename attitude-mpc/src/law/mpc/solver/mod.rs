//! The constrained problem, and its two solvers.
//!
//! ```text
//! minimise  1/2 (U - U*)'H (U - U*) + 1/2 w sum e^2   over the moves U and the excesses e
//! so that   every move of U is inside the actuators' set, and |y| <= 1 + e for the predicted states y
//! ```
//!
//! Only the unconstrained optimum `U*` and the free motion of the states depend on the tick; the rest is set up once.
//!
//! | module | holds |
//! |---|---|
//! | [`clarabel`] | interior-point method in two stages: the default and the reference |
//! | [`active_set`] | dual active-set method of `qp`: faster |

pub mod active_set;
pub mod clarabel;
mod outcome;

pub use self::outcome::{SolveLimits, SolveOutcome, SolveVerdict};

use nalgebra::{DMatrix, DVector};
use settings::{FaultKind, Scenario, SolverName};

use self::active_set::ActiveSetSolver;
use self::clarabel::ConicSolver;
use crate::law::mpc::constraints::PlanSet;
use crate::memory::WarmStart;

/// Solver that the scenario selects.
pub enum Solver {
    /// Solver of `attitude.mpc.solver = "clarabel"`.
    Clarabel(Box<ConicSolver>),
    /// Solver of `attitude.mpc.solver = "active-set"`.
    ActiveSet(Box<ActiveSetSolver>),
}

impl Solver {
    /// Sets up the problem with the Hessian `H` (4Nu x 4Nu) for the solver of a scenario.
    pub fn new(scenario: &Scenario, hessian: &DMatrix<f64>, set: &PlanSet) -> Self {
        let limits = SolveLimits::of(scenario);
        match scenario.attitude.mpc.solver {
            SolverName::Clarabel => Self::Clarabel(Box::new(ConicSolver::new(hessian, set, limits))),
            SolverName::ActiveSet => Self::ActiveSet(Box::new(ActiveSetSolver::new(hessian, set, limits.iterations))),
        }
    }

    /// Finds the best plan of `set` for the `unconstrained` optimum, under the active `fault`, if any. Writes `plan`
    /// unless the verdict is `Failed`.
    pub fn solve(
        &mut self,
        unconstrained: &DVector<f64>,
        set: &mut PlanSet,
        fault: Option<FaultKind>,
        plan: &mut DVector<f64>,
    ) -> SolveOutcome {
        match self {
            Self::Clarabel(solver) => solver.solve(unconstrained, set, fault, plan),
            Self::ActiveSet(solver) => solver.solve(unconstrained, set, fault, plan),
        }
    }

    /// Constraints that the next solve starts from; none for Clarabel.
    pub fn warm_start(&self) -> WarmStart {
        match self {
            Self::Clarabel(_) => WarmStart::default(),
            Self::ActiveSet(solver) => solver.warm_start(),
        }
    }

    /// Makes the next solve start from `from`. Returns `false`, and changes nothing, if `from` does not fit this
    /// set-up.
    pub fn start_from(&mut self, from: &WarmStart) -> bool {
        match self {
            Self::Clarabel(_) => true,
            Self::ActiveSet(solver) => solver.start_from(from),
        }
    }
}

#[cfg(test)]
mod tests;
