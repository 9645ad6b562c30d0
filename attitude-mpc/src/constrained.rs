//! When to solve, and what to do when that fails: a plan that is always inside the set.
//!
//! 1. The unconstrained plan, when it is inside: one matrix-vector product, checked and not solved.
//! 2. The solver's, drawn back from the border by a hair.
//! 3. When it found nothing: the unconstrained plan, every move replaced by the nearest one inside, as the mixer would.
//! 4. When it ran out of iterations or time: the way from there towards where it stopped, as far as the set goes, if
//!    that costs less.

use airframe::linear::INPUTS;
use airframe::projection::Projection;
use contract::Scenario;
use contract::fault_schedule::FaultSchedule;
use contract::message::SolveStatus;
use contract::scenario::{Fault, FaultKind, FaultTarget};
use nalgebra::{DMatrix, DVector};

use crate::condensed::Course;
use crate::constraints::PlanSet;
use crate::solver::{Solver, Verdict};

/// Largest violation of a solver's plan that is accepted, and then drawn inside; also the largest slack of a limit that
/// counts as touched. In the units of the slacks.
const MAX_VIOLATION: f64 = 1e-6;

/// The set of the plans, and the solver that keeps them inside.
pub struct Constrained {
    set: PlanSet,
    /// See [`crate::solver`].
    pub solver: Solver,
    hessian: DMatrix<f64>,
    faults: FaultSchedule<FaultKind>,
    projection: Projection,
    /// Do without the solver: see [`AttitudeMpc::hurry`](crate::AttitudeMpc::hurry).
    pub hurried: bool,
    /// The solver's plan, 4Nu.
    solved: DVector<f64>,
    /// Room for another, 4Nu.
    spare: DVector<f64>,
}

/// What a plan took.
#[derive(Debug, Clone, Copy, Default)]
pub struct Account {
    /// Iterations of the solver.
    pub iterations: u64,
    /// Time in it \[ns\].
    pub solve_ns: u64,
    /// Limits of the actuators that the plan touches.
    pub touching: u64,
}

impl Constrained {
    /// The constraints of a scenario around a problem with the Hessian `H` (4Nu x 4Nu); `None` where it has none.
    pub fn new(scenario: &Scenario, hessian: DMatrix<f64>, course: &Course, roll_trim_rad: f64) -> Option<Self> {
        let set = PlanSet::new(scenario, course, roll_trim_rad)?;
        let room = DVector::zeros(hessian.nrows());
        Some(Self {
            solver: Solver::new(scenario, &hessian, &set),
            faults: FaultSchedule::new(scenario, |_, fault| of_the_solver(fault)),
            hurried: false,
            projection: Projection::new(set.moves.clone(), &scenario.mixer.projection_weights),
            set,
            hessian,
            solved: room.clone(),
            spare: room,
        })
    }

    /// Takes fault `number` as it is from now on: see [`FaultSchedule::apply_fault`].
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, of_the_solver(fault));
    }

    /// Writes the `plan` to follow, given the `unconstrained` one and where this tick starts, `given` = (x; r; d; v). While a
    /// fault of the solver is active, every plan goes to the solver.
    pub fn choose(
        &mut self,
        unconstrained: &DVector<f64>,
        given: &DVector<f64>,
        tick: u64,
        plan: &mut DVector<f64>,
    ) -> (SolveStatus, Account) {
        self.set.start(given);
        let fault = self.faults.on(tick).next().map(|fault| fault.effect);
        let mut account = Account::default();
        let inside = self.set.violation(unconstrained) <= 0.0 && self.set.excess(unconstrained) <= 0.0;
        let status = if inside && fault.is_none() {
            plan.copy_from(unconstrained);
            SolveStatus::Explicit
        } else if self.hurried {
            self.fall_back(unconstrained, Verdict::Failed, plan)
        } else {
            let Self { set, solver, solved, .. } = self;
            let (outcome, solve_ns) = runtime::timed(|| solver.solve(unconstrained, set, fault, solved));
            (account.iterations, account.solve_ns) = (outcome.iterations, solve_ns);
            if outcome.verdict == Verdict::Solved && set.violation(solved) <= MAX_VIOLATION {
                set.retract(solved);
                plan.copy_from(solved);
                SolveStatus::Solved
            } else {
                self.fall_back(unconstrained, outcome.verdict, plan)
            }
        };
        account.touching = self.set.touching(plan, MAX_VIOLATION);
        (status, account)
    }

    /// Writes the best plan inside the set that is known without a solution.
    fn fall_back(&mut self, unconstrained: &DVector<f64>, verdict: Verdict, plan: &mut DVector<f64>) -> SolveStatus {
        let Self { set, hessian, projection, solved, spare, .. } = self;
        for first in (0..plan.len()).step_by(INPUTS) {
            let wanted = unconstrained.fixed_rows::<INPUTS>(first).into_owned();
            plan.fixed_rows_mut::<INPUTS>(first).copy_from(&projection.nearest(&wanted).unwrap_or(wanted));
        }
        if verdict != Verdict::LimitReached {
            return SolveStatus::Fallback;
        }
        spare.copy_from(plan);
        set.approach(spare, solved);
        let mut cost = |plan: &DVector<f64>| {
            solved.copy_from(plan);
            *solved -= unconstrained;
            hessian.column_iter().zip(solved.iter()).map(|(column, miss)| miss * column.dot(solved)).sum::<f64>()
        };
        if cost(spare) < cost(plan) {
            plan.copy_from(spare);
        }
        SolveStatus::LimitReached
    }
}

fn of_the_solver(fault: &Fault) -> Option<FaultKind> {
    (fault.target == FaultTarget::Mpc).then_some(fault.kind)
}

#[cfg(test)]
mod tests;
