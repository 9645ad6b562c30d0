//! Random problems by the million: does the active-set solver ever fail, and is what it finds the optimum?
//!
//! For a sample of them the answer is checked from the outside. Let `x` touch rows with slopes `a_i` and slacks `s_i`, and
//! discs with slopes `D_k` and points `p_k`. Whatever the shares `lambda_i >= 0` and `mu_k`, the optimum is cheaper than `x`
//! by no more than
//!
//! ```text
//! 1/2 r'H^-1 r + sum lambda_i |s_i| + sum (|mu_k| - mu_k p_k),   r = g - sum lambda_i a_i + sum D_k'mu_k
//! ```
//!
//! where `g` is the gradient of the cost at `x`. The shares come from a least-squares fit: nothing of the solver's own
//! account is believed.

use nalgebra::{DMatrix, DVector};
use qp::random::Problem;
use qp::{ActiveSet, Verdict};
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
/// A disc carries what is outward. It is given a little room across, for a solver's tangent is never quite at the point.
const ACROSS: f64 = 1e-4;
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
    /// The most by which the optimum can be cheaper than one, as a share of its objective `1/2 x'H x - c'H x`.
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

/// The limits that a point touches.
#[derive(Default)]
struct Touched {
    /// Slope and slack of each row.
    rows: Vec<(DVector<f64>, f64)>,
    /// Slopes of each disc, outward and across, and how far the point is from its middle.
    discs: Vec<([DVector<f64>; 2], f64)>,
}

/// By how much the optimum can be cheaper than `x`, as a share of its objective, and by how much `x` leaves the limits.
fn examine(problem: &Problem, x: &DVector<f64>) -> (f64, f64) {
    let Problem { hessian, rows, softness, discs, centre, offsets } = problem;
    let centre = DVector::from_column_slice(centre);
    let mut gradient = hessian * (x - &centre);
    let (mut touched, mut violation) = (Touched::default(), 0.0_f64);

    let slacks = rows * x + DVector::from_column_slice(&offsets[..rows.nrows()]);
    for ((slack, softness), row) in slacks.iter().zip(softness).zip(rows.row_iter()) {
        if *softness > 0.0 {
            gradient -= row.transpose() * ((-slack).max(0.0) / softness); // the price of its excess
        } else {
            violation = violation.max(-slack);
            touched.rows.extend((*slack < TOUCHED).then(|| (row.transpose(), slack.abs())));
        }
    }
    let points = discs * x + DVector::from_column_slice(&offsets[rows.nrows()..]);
    for (first, point) in (0..).step_by(2).zip(points.as_slice().chunks_exact(2)) {
        let length = point[0].hypot(point[1]);
        violation = violation.max(length - 1.0);
        if 1.0 - length < TOUCHED {
            let [side, ahead] = [0, 1].map(|i| discs.row(first + i).transpose());
            let [cos, sin] = [point[0] / length, point[1] / length];
            touched.discs.push(([&side * cos + &ahead * sin, (ahead * cos - side * sin) * ACROSS], length));
        }
    }
    let objective = (hessian * x).dot(&(x * 0.5 - centre));
    (gap(hessian, &gradient, touched) / objective.abs(), violation)
}

/// The bound above, for the shares that fit best.
fn gap(hessian: &DMatrix<f64>, gradient: &DVector<f64>, mut touched: Touched) -> f64 {
    let factor = hessian.clone().cholesky().expect("the matrix was drawn positive definite").unpack();
    let scaled = |of: &DMatrix<f64>| factor.solve_lower_triangular(of).expect("its factor has no zero on the diagonal");
    let pull = scaled(&DMatrix::from_columns(std::slice::from_ref(gradient)));
    loop {
        let Touched { rows, discs } = &touched;
        let of_rows = rows.iter().map(|(slope, _)| slope.clone());
        let of_discs = discs.iter().flat_map(|(slopes, _)| slopes).map(|slope| -slope);
        let slopes: Vec<DVector<f64>> = of_rows.chain(of_discs).collect();
        if slopes.is_empty() {
            return 0.5 * pull.norm_squared();
        }
        let slopes = scaled(&DMatrix::from_columns(&slopes));
        let shares = slopes.clone().svd(true, true).solve(&pull, 1e-12).expect("both bases were asked for");
        let negative = (0..rows.len()).filter(|row| shares[*row] < 0.0);
        if let Some(worst) = negative.min_by(|a, b| shares[*a].total_cmp(&shares[*b])) {
            touched.rows.swap_remove(worst);
            continue;
        }
        let by_rows: f64 = rows.iter().zip(&shares).map(|((_, slack), share)| share * slack).sum();
        let by_discs = discs.iter().enumerate().map(|(k, (_, length))| {
            let [outward, across] = [0, 1].map(|i| shares[rows.len() + 2 * k + i]);
            outward.hypot(across * ACROSS) - outward * length
        });
        return 0.5 * (pull - &slopes * &shares).norm_squared() + by_rows + by_discs.map(f64::abs).sum::<f64>();
    }
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
    fn a_point_on_a_disc_is_the_optimum_when_the_pull_is_outward() {
        let problem = Problem {
            hessian: DMatrix::identity(2, 2),
            rows: DMatrix::zeros(0, 2),
            softness: vec![],
            discs: DMatrix::identity(2, 2),
            centre: vec![3.0, 4.0],
            offsets: vec![0.0, 0.0],
        };
        let gap = |x0: f64, x1: f64| examine(&problem, &DVector::from_vec(vec![x0, x1])).0;
        assert!(gap(0.6, 0.8) < 1e-14);
        assert!(gap(0.8, 0.6) > 0.02, "on the disc, but elsewhere: {}", gap(0.8, 0.6));
        assert!(gap(-0.6, -0.8) > 1.0, "on the far side: {}", gap(-0.6, -0.8));
    }

    #[test]
    fn random_problems_are_solved() {
        let random = Random::solve(1000);
        assert_eq!((random.failures, random.checked), (0, 11));
        assert!(random.worst_gap < 1e-6 && random.worst_violation < 1e-8, "{random:?}");
        assert!(random.most_iterations <= random.iteration_bound);
    }
}
