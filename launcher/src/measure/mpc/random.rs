//! Random problems by the million: does the active-set solver ever fail, and is what it finds the optimum?
//!
//! For a sample of them the answer is checked from the outside. With `a_i` the slopes of the limits that `x` touches, `s_i`
//! what is left to each, and whatever `lambda_i >= 0`, the cost of `x` is above the optimum's by no more than
//!
//! ```text
//! 1/2 r'H^-1 r + sum lambda_i |s_i|,   r = H (x - c) + soft - sum lambda_i a_i
//! ```
//!
//! where `soft` is the pull of the soft limits, `w e` along each slope for its excess `e`. The shares `lambda_i` come from
//! a least-squares fit: nothing of the solver's own account is believed.

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
    /// The most that one can cost above the optimum, as a share of its objective `1/2 x'H x - c'H x`.
    pub worst_gap: f64,
    /// The most by which one leaves a limit, in units of the limits.
    pub worst_violation: f64,
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
            worst_gap: 0.0,
            worst_violation: 0.0,
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
            let (gap, violation) = examine(problem, &DVector::from_vec(x));
            self.worst_gap = self.worst_gap.max(gap);
            self.worst_violation = self.worst_violation.max(violation);
        }
    }
}

/// A limit that is touched: its slope, and what is left to it.
type Touched = (DVector<f64>, f64);

/// By how much `x` can cost more than the optimum, as a share of its objective, and by how much it leaves the limits.
fn examine(problem: &Problem, x: &DVector<f64>) -> (f64, f64) {
    let Problem { hessian, rows, softness, discs, centre, offsets } = problem;
    let centre = DVector::from_column_slice(centre);
    let mut gradient = hessian * (x - &centre);
    let mut touched: Vec<Touched> = vec![];
    let mut violation = 0.0_f64;

    let slacks = rows * x + DVector::from_column_slice(&offsets[..rows.nrows()]);
    for ((slack, softness), row) in slacks.iter().zip(softness).zip(rows.row_iter()) {
        if *softness > 0.0 {
            gradient -= row.transpose() * ((-slack).max(0.0) / softness);
        } else {
            violation = violation.max(-slack);
            touched.extend((*slack < TOUCHED).then(|| (row.transpose(), slack.abs())));
        }
    }
    let pairs = discs * x + DVector::from_column_slice(&offsets[rows.nrows()..]);
    for (i, pair) in pairs.as_slice().chunks_exact(2).enumerate() {
        let length = pair[0].hypot(pair[1]);
        violation = violation.max(length - 1.0);
        let inward = discs.rows(2 * i, 2).transpose() * DVector::from_column_slice(pair) / -length;
        touched.extend((1.0 - length < TOUCHED).then_some((inward, (1.0 - length).abs())));
    }
    let objective = (hessian * x).dot(&(x * 0.5 - centre));
    (gap(hessian, &gradient, touched) / objective.abs(), violation)
}

/// The bound above, for the best shares that are not negative.
fn gap(hessian: &DMatrix<f64>, gradient: &DVector<f64>, mut touched: Vec<Touched>) -> f64 {
    let factor = hessian.clone().cholesky().expect("the matrix was drawn positive definite");
    let cost = |left: DVector<f64>| 0.5 * left.dot(&factor.solve(&left));
    while !touched.is_empty() {
        let slopes: Vec<DVector<f64>> = touched.iter().map(|(slope, _)| slope.clone()).collect();
        let slopes = DMatrix::from_columns(&slopes);
        let shares = slopes.clone().svd(true, true).solve(gradient, 1e-12).expect("both bases were asked for");
        let (worst, least) = shares.argmin();
        if least >= 0.0 {
            let left: f64 = shares.iter().zip(&touched).map(|(share, (_, slack))| share * slack).sum();
            return cost(gradient - slopes * shares) + left;
        }
        touched.swap_remove(worst);
    }
    cost(gradient.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_optimum_has_no_gap_and_its_neighbour_has() {
        let problem = Problem {
            hessian: DMatrix::identity(2, 2),
            rows: DMatrix::from_row_slice(1, 2, &[-1.0, 0.0]),
            softness: vec![0.0],
            discs: DMatrix::zeros(0, 2),
            centre: vec![2.0, 0.5],
            offsets: vec![1.0], // x0 <= 1
        };
        let of = |x0, x1| examine(&problem, &DVector::from_vec(vec![x0, x1]));
        assert_eq!(of(1.0, 0.5), (0.0, 0.0));
        // Objectives are -1.625 at the optimum, and by 0.005 and 0.105 more at the neighbours.
        assert!((of(1.0, 0.6).0 - 0.005 / 1.62).abs() < 1e-12);
        assert!(of(0.9, 0.5).0 > 0.105 / 1.52, "no limit is touched");
        assert!((of(1.1, 0.5).1 - 0.1).abs() < 1e-12, "a limit is violated");
    }

    #[test]
    fn random_problems_are_solved() {
        let random = Random::solve(1000);
        assert_eq!((random.failures, random.checked), (0, 11));
        assert!(random.worst_gap < 1e-6 && random.worst_violation < 1e-8, "{random:?}");
        assert!(random.most_iterations <= random.iteration_bound);
    }
}
