//! The constrained problem, solved by Clarabel, an interior-point solver that takes the cone natively.
//!
//! Only the linear term depends on the tick, so the solver is set up once and told a new one each time. With the
//! unconstrained optimum `U*` it needs nothing else:
//!
//! ```text
//! minimise 1/2 U'H U - (H U*)'U   over the moves U inside the set
//! ```
//!
//! `H` has a condition number of millions. The solver sees `V = D U` with `D = diag(H)^(1/2)`, and rows of length one.
//! That leaves nothing to do for its own equilibration and its iterative refinement: both are off, which halves its time.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus, SupportedConeT,
};
use nalgebra::{DMatrix, DVector, DVectorViewMut};

use crate::constraints::{MoveSet, Row};

/// Iterations granted to the solver. Problems of this size take 8 to 20.
pub const MAX_ITERATIONS: u32 = 50;
/// Gap and feasibility asked of the solver: what is left of the first move is below 1 mN.
const TOLERANCE: f64 = 1e-9;

/// The solver of one set-up.
pub struct ConicSolver {
    clarabel: DefaultSolver<f64>,
    /// `-D^-1 H`: from `U*` to the linear term.
    linear: DMatrix<f64>,
    /// The linear term, `q` of Clarabel.
    q: Vec<f64>,
    /// `D`, as a vector.
    scale: DVector<f64>,
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Outcome {
    /// Whether the solver claims an optimum.
    pub solved: bool,
    /// Iterations it took.
    pub iterations: u64,
    /// Time it took \[ns\].
    pub solve_ns: u64,
}

impl ConicSolver {
    /// Sets up the problem with the Hessian `H` (4Nu x 4Nu), every move inside `set`.
    ///
    /// # Panics
    /// When Clarabel refuses the set-up; with finite matrices of matching sizes it has no reason to.
    pub fn new(hessian: &DMatrix<f64>, set: &MoveSet, max_iterations: u32) -> Self {
        let scale = hessian.diagonal().map(f64::sqrt);
        let mut linear = -hessian;
        linear.row_iter_mut().zip(scale.iter()).for_each(|(mut row, d)| row /= *d);

        let q = vec![0.0; scale.len()];
        let p = scaled_hessian(hessian, &scale);
        let (a, b, cones) = rows(set, &scale);
        let mut clarabel = DefaultSolver::new(&p, &q, &a, &b, &cones, settings(max_iterations))
            .expect("matrices and cones are built to match");
        clarabel.solve(); // the first solve fetches memory that later ones reuse: not in flight
        Self { clarabel, linear, q, scale }
    }

    /// Finds the best plan inside the set, nearest to the `unconstrained` one as the cost measures it. Writes `plan`
    /// when solved, and leaves it alone otherwise.
    pub fn solve(&mut self, unconstrained: &DVector<f64>, plan: &mut DVector<f64>) -> Outcome {
        let n = self.q.len();
        DVectorViewMut::from_slice(&mut self.q, n).gemv(1.0, &self.linear, unconstrained, 0.0);
        let updated = self.clarabel.update_q(&self.q).is_ok();
        self.clarabel.solve();

        let solution = &self.clarabel.solution;
        let solved = updated && matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        if solved {
            plan.copy_from_slice(&solution.x);
            plan.component_div_assign(&self.scale);
        }
        Outcome { solved, iterations: u64::from(solution.iterations), solve_ns: (solution.solve_time * 1e9) as u64 }
    }
}

fn settings(max_iter: u32) -> DefaultSettings<f64> {
    DefaultSettings {
        max_iter,
        verbose: false,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        equilibrate_enable: false,
        iterative_refinement_enable: false,
        direct_solve_method: "qdldl".into(),
        presolve_enable: false, // it would refuse the new linear term of each tick
        ..DefaultSettings::default()
    }
}

/// `D^-1 H D^-1`, its upper triangle.
fn scaled_hessian(hessian: &DMatrix<f64>, scale: &DVector<f64>) -> CscMatrix<f64> {
    let mut p = Triplets::default();
    for column in 0..scale.len() {
        for row in 0..=column {
            p.push(row, column, hessian[(row, column)] / (scale[row] * scale[column]));
        }
    }
    p.into_matrix(scale.len(), scale.len())
}

/// The slacks `s = b - A V` of every move, and the cones they are in: all linear rows first, then the cones.
fn rows(set: &MoveSet, scale: &DVector<f64>) -> (CscMatrix<f64>, Vec<f64>, Vec<SupportedConeT<f64>>) {
    let (mut a, mut b) = (Triplets::default(), Vec::new());
    let mut append = |first: usize, group: &[Row]| {
        let slope = |row: &Row| row.slope.component_div(&scale.fixed_rows::<4>(first));
        // Rows of one cone must keep their proportions, so a group is normalised as a whole.
        let length = group.iter().map(|row| slope(row).norm()).fold(0.0, f64::max);
        for row in group {
            let slope = slope(row) / length;
            (0..4).for_each(|axis| a.push(b.len(), first + axis, -slope[axis]));
            b.push(row.offset / length);
        }
    };
    let mut cones = Vec::new();
    for first in (0..scale.len()).step_by(4) {
        set.linear.iter().for_each(|row| append(first, std::slice::from_ref(row)));
    }
    cones.push(NonnegativeConeT(set.linear.len() * scale.len() / 4));
    if let Some(cone) = &set.cone {
        for first in (0..scale.len()).step_by(4) {
            append(first, cone);
            cones.push(SecondOrderConeT(3));
        }
    }
    (a.into_matrix(b.len(), scale.len()), b, cones)
}

/// A sparse matrix in the making; zeros are left out.
#[derive(Default)]
struct Triplets {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Triplets {
    fn push(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.rows.push(row);
            self.columns.push(column);
            self.values.push(value);
        }
    }

    fn into_matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values)
    }
}

#[cfg(test)]
mod tests;
