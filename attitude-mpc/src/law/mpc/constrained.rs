//! Choice of a plan that is always inside the set:
//!
//! 1. The unconstrained plan if it is inside: one matrix-vector product and a check. If the bound of
//!    [`clearance`](crate::law::mpc::clearance) shows that the plan is inside, only its first move is computed.
//! 2. Else the solver's plan, drawn slightly inside the border.
//! 3. If the solver fails: the unconstrained plan, every move projected into the set as the mixer does.
//! 4. If the solver ran out of iterations or time: plan 3 moved towards the last iterate as far as the set allows, if
//!    the moved plan costs less.

use airframe::linear::INPUTS;
use airframe::projection::Projection;
use contract::message::SolveStatus;
use nalgebra::{DMatrix, DVector};
use settings::fault_schedule::FaultSchedule;
use settings::{Fault, FaultKind, FaultTarget, Scenario};

use crate::law::attitude_law::PlanEffort;
use crate::law::mpc::clearance::Clearance;
use crate::law::mpc::condensed::Condensed;
use crate::law::mpc::constraints::PlanSet;
use crate::law::mpc::solver::{SolveVerdict, Solver};

/// Largest violation of the set with which a solver's plan is accepted and drawn inside; also the largest slack of a
/// limit that counts as touched. Both are in the units of the slacks.
const MAX_VIOLATION: f64 = 1e-6;

/// Set of the plans, and the solver that finds the best plan in it.
pub struct Constrained {
    set: PlanSet,
    /// Bound on the plans of the hover model.
    clearance: Clearance,
    /// Solver of the constrained problem.
    pub solver: Solver,
    hessian: DMatrix<f64>,
    faults: FaultSchedule<FaultKind>,
    projection: Projection,
    /// `true` if the solver is not to be used: see [`Core::hurry`](runtime::node::Core::hurry).
    pub hurried: bool,
    /// Plan of the solver, 4Nu.
    solved: DVector<f64>,
    /// Buffer for another plan, 4Nu.
    spare: DVector<f64>,
}

impl Constrained {
    /// Sets up a scenario's constraints on the problem of the hover model; `None` if the scenario has none.
    pub fn new(scenario: &Scenario, problem: &Condensed, roll_trim_rad: f64) -> Option<Self> {
        let Condensed { hessian, gain, course } = problem;
        let set = PlanSet::new(scenario, course, roll_trim_rad)?;
        let room = DVector::zeros(hessian.nrows());
        Some(Self {
            clearance: Clearance::new(gain, &set.moves),
            solver: Solver::new(scenario, hessian, &set),
            faults: FaultSchedule::new(scenario, |_, fault| of_the_solver(fault)),
            hurried: false,
            projection: Projection::new(set.moves.clone(), &scenario.mixer.projection_weights),
            set,
            hessian: hessian.clone(),
            solved: room.clone(),
            spare: room,
        })
    }

    /// Updates fault `number` as in [`FaultSchedule::apply_fault`]; ignores faults of other targets.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, of_the_solver(fault));
    }

    /// Returns whether the unconstrained plan of the hover model for `given` = (x; r; d; v) and the `changes` of r is
    /// followed at `tick` because no limit is near it; `false` if only the whole plan can show this.
    pub fn is_clear(&self, given: &DVector<f64>, changes: &DVector<f64>, tick: u64) -> bool {
        self.set.states.is_none() && self.faults.on(tick).next().is_none() && self.clearance.is_clear(given, changes)
    }

    /// Writes the `plan` to follow for the `unconstrained` plan and the start of this tick, `given` = (x; r; d; v).
    /// While a fault of the solver is active, the solver also gets an unconstrained plan that is inside the set, unless
    /// `hurried`.
    pub fn choose(
        &mut self,
        unconstrained: &DVector<f64>,
        given: &DVector<f64>,
        tick: u64,
        plan: &mut DVector<f64>,
    ) -> (SolveStatus, PlanEffort) {
        self.set.start(given);
        let fault = self.faults.on(tick).next().map(|fault| fault.effect);
        let mut account = PlanEffort::default();
        let inside = self.set.violation(unconstrained) <= 0.0 && self.set.excess(unconstrained) <= 0.0;
        let status = if inside && fault.is_none() {
            plan.copy_from(unconstrained);
            SolveStatus::Explicit
        } else if self.hurried {
            self.fall_back(unconstrained, SolveVerdict::Failed, plan)
        } else {
            let Self { set, solver, solved, .. } = self;
            let (outcome, solve_ns) = runtime::timed(|| solver.solve(unconstrained, set, fault, solved));
            (account.iterations, account.solve_ns) = (outcome.iterations, solve_ns);
            if outcome.verdict == SolveVerdict::Solved && set.violation(solved) <= MAX_VIOLATION {
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

    /// Writes a plan inside the set without a solution: item 3 of the module's list, or item 4 if `verdict` is
    /// `LimitReached`.
    fn fall_back(
        &mut self,
        unconstrained: &DVector<f64>,
        verdict: SolveVerdict,
        plan: &mut DVector<f64>,
    ) -> SolveStatus {
        let Self { set, hessian, projection, solved, spare, .. } = self;
        for first in (0..plan.len()).step_by(INPUTS) {
            let wanted = unconstrained.fixed_rows::<INPUTS>(first).into_owned();
            plan.fixed_rows_mut::<INPUTS>(first).copy_from(&projection.nearest(&wanted).unwrap_or(wanted));
        }
        if verdict != SolveVerdict::LimitReached {
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
