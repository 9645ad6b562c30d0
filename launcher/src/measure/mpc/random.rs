//! Random problems by the million: does the active-set solver ever fail, and is what it finds the optimum?
//!
//! A point is the optimum when nothing is left of the gradient that the limits it touches do not carry:
//!
//! ```text
//! H (x - c) = sum lambda_i a_i,   lambda_i >= 0 on the limits touched,   no limit violated
//! ```
//!
//! A soft limit carries `w e` for its excess `e`. The others' shares come from a least-squares fit, so that nothing of
//! the solver's own account is believed.

use airframe::active_set::random::Problem;
use airframe::active_set::{ActiveSet, Verdict};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Problems that share their matrices, as the ticks of one controller do.
const PER_SETUP: u64 = 50;
/// Of so many problems, one has its optimum checked.
const PER_CHECK: u64 = 97;
/// Iterations granted, as in a flight.
const MAX_ITERATIONS: u32 = 100;
/// A limit with no more than this to it counts as touched.
const TOUCHED: f64 = 1e-7;
/// The same problems every time.
const SEED: u64 = 20160;

/// How it went.
#[derive(Debug, Clone, Serialize)]
pub struct Random {
    /// Problems solved or not.
    pub problems: u64,
    /// Those not solved.
    pub failures: u64,
    /// The most iterations any took.
    pub most_iterations: u32,
    /// How many were allowed.
    pub iteration_bound: u32,
    /// Problems whose optimum was checked.
    pub checked: u64,
    /// The largest residual of the conditions above, as a share of the gradient, or in units of the limits.
    pub worst_residual: f64,
}

impl Random {
    /// Solves `problems` of them.
    pub fn solve(problems: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(SEED);
        let mut uniform = || generator.random::<f64>();
        let mut random = Self {
            problems,
            failures: 0,
            most_iterations: 0,
            iteration_bound: MAX_ITERATIONS,
            checked: 0,
            worst_residual: 0.0,
        };
        for first in (0..problems).step_by(PER_SETUP as usize) {
            let mut problem = Problem::draw(&mut uniform);
            let Problem { hessian, rows, softness, discs, .. } = &problem;
            let mut solver = ActiveSet::new(hessian, rows, softness, discs, MAX_ITERATIONS);
            for i in first..problems.min(first + PER_SETUP) {
                problem.redraw(&mut uniform);
                random.take(&mut solver, &problem, i % PER_CHECK == 0);
            }
        }
        random
    }

    fn take(&mut self, solver: &mut ActiveSet, problem: &Problem, check: bool) {
        let mut x = vec![0.0; problem.centre.len()];
        let outcome = solver.solve(&problem.centre, &problem.offsets, &mut x);
        self.most_iterations = self.most_iterations.max(outcome.iterations);
        if outcome.verdict != Verdict::Optimal {
            self.failures += 1;
        } else if check {
            self.checked += 1;
            self.worst_residual = self.worst_residual.max(residual(problem, &DVector::from_vec(x)));
        }
    }
}

/// By how much `x` misses being the optimum.
fn residual(problem: &Problem, x: &DVector<f64>) -> f64 {
    let Problem { hessian, rows, softness, discs, centre, offsets } = problem;
    let pull = hessian * (x - DVector::from_column_slice(centre));
    let mut left = pull.clone();
    let mut touched: Vec<DVector<f64>> = vec![];
    let mut violation = 0.0_f64;

    let slacks = rows * x + DVector::from_column_slice(&offsets[..rows.nrows()]);
    for ((slack, softness), row) in slacks.iter().zip(softness).zip(rows.row_iter()) {
        if *softness > 0.0 {
            left -= row.transpose() * ((-slack).max(0.0) / softness);
        } else {
            violation = violation.max(-slack);
            touched.extend((*slack < TOUCHED).then(|| row.transpose()));
        }
    }
    let pairs = discs * x + DVector::from_column_slice(&offsets[rows.nrows()..]);
    for (i, pair) in pairs.as_slice().chunks_exact(2).enumerate() {
        let length = pair[0].hypot(pair[1]);
        violation = violation.max(length - 1.0);
        let inward = discs.rows(2 * i, 2).transpose() * DVector::from_column_slice(pair) / -length;
        touched.extend((1.0 - length < TOUCHED).then_some(inward));
    }
    let scale = pull.norm().max(f64::MIN_POSITIVE);
    violation.max(carried(left, touched) / scale)
}

/// What the `touched` limits cannot carry of a gradient with shares that are not negative.
fn carried(gradient: DVector<f64>, mut touched: Vec<DVector<f64>>) -> f64 {
    loop {
        if touched.is_empty() {
            return gradient.norm();
        }
        let normals = DMatrix::from_columns(&touched);
        let shares = normals.clone().svd(true, true).solve(&gradient, 1e-12).expect("both bases were asked for");
        let (worst, least) = shares.argmin();
        if least >= 0.0 {
            return (normals * shares - gradient).norm();
        }
        touched.swap_remove(worst);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_optimum_has_no_residual_and_its_neighbour_has() {
        let problem = Problem {
            hessian: DMatrix::identity(2, 2),
            rows: DMatrix::from_row_slice(1, 2, &[-1.0, 0.0]),
            softness: vec![0.0],
            discs: DMatrix::zeros(0, 2),
            centre: vec![2.0, 0.5],
            offsets: vec![1.0], // x0 <= 1
        };
        assert!(residual(&problem, &DVector::from_vec(vec![1.0, 0.5])) < 1e-12);
        assert!(residual(&problem, &DVector::from_vec(vec![1.0, 0.6])) > 0.05, "the gradient is not carried");
        assert!(residual(&problem, &DVector::from_vec(vec![1.1, 0.5])) > 0.05, "a limit is violated");
        assert!(residual(&problem, &DVector::from_vec(vec![0.9, 0.5])) > 0.05, "no limit is touched");
    }

    #[test]
    fn random_problems_are_solved() {
        let random = Random::solve(1000);
        assert_eq!((random.failures, random.checked), (0, 11));
        assert!(random.worst_residual < 1e-6, "{random:?}");
        assert!(random.most_iterations <= random.iteration_bound);
    }
}
