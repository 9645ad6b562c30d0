//! Random problems, to test the solver with and to measure it on.

use nalgebra::{DMatrix, DVector};

/// A problem as [`ActiveSet`](super::ActiveSet) takes it, with `x = 0` inside all its constraints.
#[derive(Debug, Clone)]
pub struct Problem {
    /// `H`, n x n.
    pub hessian: DMatrix<f64>,
    /// Linear rows, m x n.
    pub rows: DMatrix<f64>,
    /// `1/w` of each, m; 0 is hard.
    pub softness: Vec<f64>,
    /// Rows of the discs, 2k x n.
    pub discs: DMatrix<f64>,
    /// The unconstrained optimum, n.
    pub centre: Vec<f64>,
    /// The slacks at `x = 0`, m + 2k.
    pub offsets: Vec<f64>,
}

impl Problem {
    /// Draws a problem: 1 to 20 variables, up to 40 rows and 5 discs, a condition number up to 1e7, an optimum that
    /// leaves the constraints by up to a hundred times their size. `uniform` gives numbers between 0 and 1.
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

    /// Draws another centre and other offsets: the next tick of a controller.
    pub fn redraw(&mut self, uniform: &mut impl FnMut() -> f64) {
        let m = self.rows.nrows();
        for (offset, row) in self.offsets.iter_mut().zip(self.rows.row_iter()) {
            *offset = row.norm() * uniform();
        }
        for pair in self.offsets[m..].chunks_exact_mut(2) {
            let (radius, (sin, cos)) = (0.99 * uniform(), (std::f64::consts::TAU * uniform()).sin_cos());
            pair.copy_from_slice(&[radius * cos, radius * sin]);
        }
        let way = DVector::from_fn(self.centre.len(), |_, _| 2.0 * uniform() - 1.0);
        let change = (&self.rows * &way).amax().max((&self.discs * &way).amax());
        let far = 10_f64.powf(4.0 * uniform() - 2.0);
        self.centre.copy_from_slice((way * (far / if change > 0.0 { change } else { 1.0 })).as_slice());
    }
}

/// A matrix with its eigenvalues over up to seven decades, along random axes.
fn hessian(n: usize, uniform: &mut impl FnMut() -> f64) -> DMatrix<f64> {
    let mut axes = DMatrix::identity(n, n);
    for _ in 0..n {
        let normal = DVector::from_fn(n, |_, _| uniform() - 0.5);
        let reflected = normal.tr_mul(&axes) * (2.0 / normal.norm_squared());
        axes -= &normal * reflected;
    }
    let decades = 7.0 * uniform();
    let eigenvalues = DVector::from_fn(n, |_, _| 10_f64.powf(decades * (uniform() - 0.5)));
    let hessian = axes.tr_mul(&(DMatrix::from_diagonal(&eigenvalues) * &axes));
    (&hessian + hessian.transpose()) * 0.5
}

/// Rows in random directions, of lengths over two decades.
fn slopes(rows: usize, columns: usize, uniform: &mut impl FnMut() -> f64) -> DMatrix<f64> {
    let mut slopes = DMatrix::from_fn(rows, columns, |_, _| 2.0 * uniform() - 1.0);
    slopes.row_iter_mut().for_each(|mut row| row *= 10_f64.powf(2.0 * uniform() - 1.0));
    slopes
}

/// A whole number below `end`.
fn below(end: usize, uniform: &mut impl FnMut() -> f64) -> usize {
    (uniform() * end as f64) as usize
}
