//! When to solve, and what to do when that fails: a plan that is always inside the set.
//!
//! 1. The unconstrained plan, when it is inside: one matrix-vector product, checked and not solved.
//! 2. The solver's, drawn back from the border by a hair.
//! 3. When it ran out of iterations or time: the way from the rest of the last plan towards where it stopped, as far as
//!    the set goes; or 4, if that costs less.
//! 4. When it found nothing: the way from the rest of the last plan towards the unconstrained optimum, as far as the set
//!    goes. The cost falls all along it, so this is never worse than the rest of the last plan.

use contract::Scenario;
use contract::message::SolveStatus;
use contract::scenario::{Fault, FaultTarget};
use nalgebra::{DMatrix, DVector};

use crate::condensed::Course;
use crate::constraints::PlanSet;
use crate::memory::Memory;
use crate::solver::{Solver, Verdict};

/// A solver's plan is believed when it leaves the set by no more than this, and then drawn inside. A limit counts as
/// touched when there is no more than this to it.
const NEAR: f64 = 1e-6;

/// The set of the plans, and the solver that keeps them inside.
pub struct Constrained {
    set: PlanSet,
    solver: Solver,
    hessian: DMatrix<f64>,
    faults: Vec<Fault>,
    plans: Plans,
}

/// Room for the plans of one tick, each 4Nu.
struct Plans {
    /// The solver's.
    solved: DVector<f64>,
    /// To fall back on.
    rest: DVector<f64>,
    /// Another.
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
            faults: scenario.fault.iter().filter(|fault| fault.target == FaultTarget::Mpc).cloned().collect(),
            set,
            hessian,
            plans: Plans { solved: room.clone(), rest: room.clone(), spare: room },
        })
    }

    /// The plan to follow, given the `unconstrained` one and where this tick starts, `given` = (x; r; d). While a fault
    /// strikes the solver, every plan goes to the solver.
    pub fn choose<'a>(
        &'a mut self,
        unconstrained: &'a DVector<f64>,
        given: &DVector<f64>,
        memory: &mut Memory,
        tick: u64,
    ) -> (&'a DVector<f64>, SolveStatus, Account) {
        self.set.start(given);
        let fault = self.faults.iter().find(|fault| fault.strikes(tick)).map(|fault| fault.kind);
        if fault.is_none() && self.set.violation(unconstrained) <= 0.0 && self.set.excess(unconstrained) <= 0.0 {
            let touching = self.set.touching(unconstrained, NEAR);
            return (unconstrained, SolveStatus::Explicit, Account { touching, ..Account::default() });
        }

        let Self { set, solver, hessian, plans, .. } = self;
        let (outcome, solve_ns) = contract::timed(|| solver.solve(unconstrained, set, fault, &mut plans.solved));
        let (plan, status) = if outcome.verdict == Verdict::Solved && set.violation(&plans.solved) <= NEAR {
            set.retract(&mut plans.solved);
            (&plans.solved, SolveStatus::Solved)
        } else {
            memory.fallbacks += 1;
            memory.rest_of_plan(tick, &mut plans.rest);
            plans.fall_back(set, hessian, unconstrained, outcome.verdict)
        };
        let touching = set.touching(plan, NEAR);
        (plan, status, Account { iterations: outcome.iterations, solve_ns, touching })
    }
}

impl Plans {
    /// The best plan inside the set that is known without a solution, from the rest of the last one.
    fn fall_back(
        &mut self,
        set: &PlanSet,
        hessian: &DMatrix<f64>,
        unconstrained: &DVector<f64>,
        verdict: Verdict,
    ) -> (&DVector<f64>, SolveStatus) {
        let Self { solved, rest, spare } = self;
        if set.violation(rest) > 0.0 {
            rest.fill(0.0); // hover, which is inside
        }
        spare.copy_from(rest);
        set.approach(rest, unconstrained);
        if verdict != Verdict::LimitReached {
            return (rest, SolveStatus::Fallback);
        }
        set.approach(spare, solved);
        let mut cost = |plan: &DVector<f64>| {
            solved.copy_from(plan);
            *solved -= unconstrained;
            hessian.column_iter().zip(solved.iter()).map(|(column, miss)| miss * column.dot(solved)).sum::<f64>()
        };
        let best = if cost(spare) < cost(rest) { spare } else { rest };
        (best, SolveStatus::LimitReached)
    }
}

#[cfg(test)]
mod tests;
