//! Random problems, and the quality of a point, computed independently of the solver.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{DMatrix, DVector};

use crate::ActiveSet;

/// Slack up to which a limit counts as touched.
const TOUCHED: f64 = 1e-7;
/// Tolerance of the angle of a disc's multiplier, because a tangent is never exactly at the point.
const ACROSS: f64 = 1e-4;

/// Problem with 0 inside its constraints, in the form of [`ActiveSet`].
#[derive(Debug, Clone)]
pub struct Problem {
    /// Hessian `H`, n x n, positive definite.
    pub hessian: DMatrix<f64>,
    /// Linear rows, m x n.
    pub rows: DMatrix<f64>,
    /// Softness `1/w` of each row; 0 is hard.
    pub softness: Vec<f64>,
    /// Disc rows, 2k x n.
    pub discs: DMatrix<f64>,
    /// Unconstrained optimum, n.
    pub centre: Vec<f64>,
    /// Offsets, m + 2k.
    pub offsets: Vec<f64>,
}

impl Problem {
    /// Draws a problem: up to 20 variables, 40 rows, 5 discs, a condition number up to 1e7; `uniform` draws from 0..1.
    pub fn draw(uniform: &mut impl FnMut() -> f64) -> Self {
        let n = 1 + below(20, uniform);
        let (m, k) = (below(41, uniform), below(6, uniform));
        let softness = (0..m).map(|_| if uniform() < 0.3 { 10_f64.powf(-4.0 * uniform()) } else { 0.0 }).collect();
        let mut problem = Self {
            hessian: hessian(n, uniform),
            rows: slopes(m, n, uniform),
            softness,
            discs: slopes(2 * k, n, uniform),
            centre: vec![0.0; n],
            offsets: vec![0.0; m + 2 * k],
        };
        problem.redraw(uniform);
        problem
    }

    /// Draws another centre and other offsets, as for the next tick of a controller.
    pub fn redraw(&mut self, uniform: &mut impl FnMut() -> f64) {
        let m = self.rows.nrows();
        self.centre.fill_with(|| 2.0 * uniform() - 1.0);
        for (offset, row) in self.offsets.iter_mut().zip(self.rows.row_iter()) {
            *offset = row.norm() * uniform();
        }
        for pair in self.offsets[m..].chunks_exact_mut(2) {
            let (radius, angle) = (0.99 * uniform(), std::f64::consts::TAU * uniform());
            pair.copy_from_slice(&[radius * angle.cos(), radius * angle.sin()]);
        }
        let far = self.far() / 10_f64.powf(4.0 * uniform() - 2.0);
        self.centre.iter_mut().for_each(|c| *c /= far);
    }

    /// Builds a solver of this set-up with at most `steps`.
    pub fn solver(&self, steps: u32) -> ActiveSet {
        ActiveSet::new(&self.hessian, &self.rows, &self.softness, &self.discs, steps)
    }

    /// Largest violation of the hard rows and the discs by `x`.
    pub fn violation(&self, x: &[f64]) -> f64 {
        let (rows, discs) = self.slacks(x);
        let hard = rows.iter().zip(&self.softness).filter(|(_, softness)| **softness == 0.0).map(|(slack, _)| -slack);
        let outside = discs.as_slice().chunks_exact(2).map(|pair| pair[0].hypot(pair[1]) - 1.0);
        hard.chain(outside).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Cost of `x`, that of the soft rows' excesses included.
    pub fn cost(&self, x: &[f64]) -> f64 {
        let miss = DVector::from_column_slice(x) - DVector::from_column_slice(&self.centre);
        let (rows, _) = self.slacks(x);
        let excess =
            |(slack, softness): (&f64, &f64)| if *softness > 0.0 { slack.min(0.0).powi(2) / softness } else { 0.0 };
        0.5 * (&self.hessian * &miss).dot(&miss) + 0.5 * rows.iter().zip(&self.softness).map(excess).sum::<f64>()
    }

    /// Upper bound on the cost of `x` above the optimum. Let `x` touch rows with slopes `a_i` and slacks `s_i`, and
    /// discs with slopes `D_k` at points `p_k`. For any `lambda_i >= 0` and `mu_k` the optimum costs less by at most
    ///
    /// ```text
    /// 1/2 r'H^-1 r + sum lambda_i |s_i| + sum (|mu_k| - mu_k p_k),   r = g - sum lambda_i a_i + sum D_k'mu_k
    /// ```
    ///
    /// where `g` is the gradient of the cost at `x`. `lambda` and `mu` are a least-squares fit; the solver's
    /// multipliers are not used.
    pub fn gap(&self, x: &[f64]) -> f64 {
        let (slacks, points) = self.slacks(x);
        let mut gradient = &self.hessian * (DVector::from_column_slice(x) - DVector::from_column_slice(&self.centre));
        let (mut rows, mut discs) = (vec![], vec![]);
        for ((slack, softness), row) in slacks.iter().zip(&self.softness).zip(self.rows.row_iter()) {
            if *softness > 0.0 {
                gradient -= row.transpose() * ((-slack).max(0.0) / softness); // gradient of the cost of the excess
            } else if *slack < TOUCHED {
                rows.push((row.transpose(), slack.abs()));
            }
        }
        for (first, point) in (0..).step_by(2).zip(points.as_slice().chunks_exact(2)) {
            let length = point[0].hypot(point[1]);
            if 1.0 - length < TOUCHED {
                let [side, ahead] = [0, 1].map(|i| self.discs.row(first + i).transpose());
                let [cos, sin] = [point[0] / length, point[1] / length];
                discs.push(([&side * cos + &ahead * sin, (ahead * cos - side * sin) * ACROSS], length));
            }
        }
        let factor = self.hessian.clone().cholesky().expect("the matrix was drawn positive definite").unpack();
        let scaled =
            |of: &DMatrix<f64>| factor.solve_lower_triangular(of).expect("its factor has no zero on the diagonal");
        let pull = scaled(&DMatrix::from_columns(&[gradient]));
        loop {
            let of_rows = rows.iter().map(|(slope, _)| slope.clone());
            let slopes: Vec<DVector<f64>> =
                of_rows.chain(discs.iter().flat_map(|(slopes, _)| slopes).map(|s| -s)).collect();
            if slopes.is_empty() {
                return 0.5 * pull.norm_squared();
            }
            let slopes = scaled(&DMatrix::from_columns(&slopes));
            let shares = slopes.clone().svd(true, true).solve(&pull, 1e-12).expect("both bases were asked for");
            let negative = (0..rows.len()).filter(|row| shares[*row] < 0.0);
            if let Some(worst) = negative.min_by(|a, b| shares[*a].total_cmp(&shares[*b])) {
                rows.swap_remove(worst);
                continue;
            }
            let by_rows: f64 = rows.iter().zip(&shares).map(|((_, slack), share)| share * slack).sum();
            let by_discs = discs.iter().enumerate().map(|(k, (_, length))| {
                let [outward, across] = [0, 1].map(|i| shares[rows.len() + 2 * k + i]);
                (outward.hypot(across * ACROSS) - outward * length).abs()
            });
            return 0.5 * (pull - &slopes * &shares).norm_squared() + by_rows + by_discs.sum::<f64>();
        }
    }

    /// Computes the optimum by Clarabel, an interior-point method; `None` if it does not converge. Variables are `x`
    /// and one excess for each row, which only soft rows use.
    pub fn by_clarabel(&self) -> Option<Vec<f64>> {
        let (n, m, k) = (self.centre.len(), self.rows.nrows(), self.discs.nrows() / 2);
        let mut quadratic = DMatrix::identity(n + m, n + m);
        quadratic.view_mut((0, 0), (n, n)).copy_from(&self.hessian);
        let mut linear = -&self.hessian * DVector::from_column_slice(&self.centre);
        linear.resize_vertically_mut(n + m, 0.0);
        let (mut rows, mut right) = (DMatrix::zeros(m + 3 * k, n + m), vec![0.0; m + 3 * k]);
        rows.view_mut((0, 0), (m, n)).copy_from(&-&self.rows);
        right[..m].copy_from_slice(&self.offsets[..m]);
        for (row, softness) in self.softness.iter().enumerate() {
            rows[(row, n + row)] = -softness.sqrt(); // the variable is the excess times the root of its weight
        }
        for disc in 0..k {
            let (first, pair) = (m + 3 * disc, m + 2 * disc);
            rows.view_mut((first + 1, 0), (2, n)).copy_from(&-self.discs.rows(2 * disc, 2));
            right[first] = 1.0;
            right[first + 1..first + 3].copy_from_slice(&self.offsets[pair..pair + 2]);
        }
        let mut cones = vec![SupportedConeT::NonnegativeConeT(m)];
        cones.extend(vec![SupportedConeT::SecondOrderConeT(3); k]);
        let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
        let (quadratic, rows) = (sparse(&quadratic.upper_triangle()), sparse(&rows));
        let mut solver = DefaultSolver::new(&quadratic, linear.as_slice(), &rows, &right, &cones, settings).ok()?;
        solver.solve();
        (solver.solution.status == SolverStatus::Solved).then(|| solver.solution.x[..n].to_vec())
    }

    /// Values of the linear rows at `x`, and of the rows of the discs.
    fn slacks(&self, x: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let x = DVector::from_column_slice(x);
        let (rows, discs) = self.offsets.split_at(self.rows.nrows());
        let at = |offsets: &[f64], slopes: &DMatrix<f64>| DVector::from_column_slice(offsets) + slopes * &x;
        (at(rows, &self.rows), at(discs, &self.discs))
    }

    /// Largest change of a slack from 0 to the centre; the centre is scaled by it to violate limits by a given amount.
    fn far(&self) -> f64 {
        let centre = DVector::from_column_slice(&self.centre);
        let (rows, discs) = (&self.rows * &centre, &self.discs * &centre);
        rows.iter().chain(&discs).fold(1e-9, |most, slack| most.max(slack.abs()))
    }
}

/// Draws a matrix with a condition number up to 1e7 along random axes.
fn hessian(n: usize, uniform: &mut impl FnMut() -> f64) -> DMatrix<f64> {
    let decades = 7.0 * uniform();
    let mut axes = DMatrix::identity(n, n);
    for _ in 0..n {
        let mirror = DVector::from_fn(n, |_, _| uniform() - 0.5);
        let along = mirror.tr_mul(&axes) * (2.0 / mirror.norm_squared());
        axes -= &mirror * along;
    }
    let spectrum = DVector::from_fn(n, |_, _| 10_f64.powf(decades * (uniform() - 0.5)));
    let hessian = axes.tr_mul(&(DMatrix::from_diagonal(&spectrum) * &axes));
    (&hessian + hessian.transpose()) * 0.5
}

/// Draws rows in random directions, with lengths over two decades.
fn slopes(rows: usize, columns: usize, uniform: &mut impl FnMut() -> f64) -> DMatrix<f64> {
    let mut slopes = DMatrix::from_fn(rows, columns, |_, _| 2.0 * uniform() - 1.0);
    for mut row in slopes.row_iter_mut() {
        row *= 10_f64.powf(2.0 * uniform() - 1.0);
    }
    slopes
}

/// Draws an integer below `end`.
fn below(end: usize, uniform: &mut impl FnMut() -> f64) -> usize {
    (uniform() * end as f64) as usize
}

fn sparse(matrix: &DMatrix<f64>) -> CscMatrix<f64> {
    let rows: Vec<Vec<f64>> = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    CscMatrix::from(&rows)
}

/// Returns a generator of numbers in 0..1 from a seed.
pub fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}
