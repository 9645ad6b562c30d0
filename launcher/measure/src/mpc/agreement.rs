//! Whether both solvers find the same optimum.
//!
//! A plan that leaves the set is handed to both. Their objectives are compared as a share of the problem's own,
//!
//! ```text
//! 1/2 U'H U + f'U + 1/2 w sum e^2,   f = -H U*
//! ```
//!
//! where `U*` is the unconstrained plan and `e` the excess of the predicted states over their soft limits.

use attitude_mpc::constraints::PlanSet;
use attitude_mpc::solver::{self, Verdict};
use contract::scenario::Solver;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::matrices::{Problem, Problems};
use super::problems::Sequence;

/// How far the solvers agree.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Agreement {
    /// Problems that went to both.
    pub problems: usize,
    /// Of those, how many one of them did not solve.
    pub unsolved: usize,
    /// The largest difference of the objectives, as a share of them.
    pub worst_difference: f64,
}

impl Agreement {
    /// Takes in the problems of one sequence.
    pub fn compare(&mut self, sequence: &Sequence, problems: &Problems) {
        let Some(set) = &problems.set else { return };
        let mut sets = [(); 2].map(|()| set.clone());
        let mut solvers = [Solver::Clarabel, Solver::ActiveSet]
            .map(|choice| solver::Solver::new(&sequence.scenario_for(choice), &problems.hessian, set));
        let mut plan = DVector::zeros(problems.hessian.nrows());
        for Problem { given, centre, .. } in &problems.ticks {
            for set in &mut sets {
                set.start(given);
            }
            if sets[0].violation(centre) <= 0.0 && sets[0].excess(centre) <= 0.0 {
                continue;
            }
            self.problems += 1;
            let mut solve = |i: usize| {
                let outcome = solvers[i].solve(centre, &mut sets[i], None, &mut plan);
                (outcome.verdict == Verdict::Solved).then(|| objective(&problems.hessian, &sets[i], centre, &plan))
            };
            if let (Some(theirs), Some(ours)) = (solve(0), solve(1)) {
                self.worst_difference = self.worst_difference.max((ours - theirs).abs() / theirs.abs());
            } else {
                self.unsolved += 1;
            }
        }
    }
}

/// The objective of `plan`, without the constant that makes the unconstrained optimum cost nothing.
fn objective(hessian: &DMatrix<f64>, set: &PlanSet, centre: &DVector<f64>, plan: &DVector<f64>) -> f64 {
    let excess = set.states.as_ref().map_or(0.0, |states| {
        let reached = &states.drift + &states.forced * plan;
        0.5 * states.penalty * reached.iter().map(|y| (y.abs() - 1.0).max(0.0).powi(2)).sum::<f64>()
    });
    (hessian * plan).dot(&(plan * 0.5 - centre)) + excess
}
