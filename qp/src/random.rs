//! Random problems to test with.

use nalgebra::{DMatrix, DVector};

/// A problem with 0 inside its constraints, as [`ActiveSet`](super::ActiveSet) takes it.
#[derive(Debug, Clone)]
pub struct Problem {
    /// `H`, n x n, positive definite.
    pub hessian: DMatrix<f64>,
    /// Linear rows, m x n.
    pub rows: DMatrix<f64>,
    /// `1/w` of each row; 0 is hard.
    pub softness: Vec<f64>,
    /// Disc rows, 2k x n.
    pub discs: DMatrix<f64>,
    /// Unconstrained optimum, n.
    pub centre: Vec<f64>,
    /// Offsets, m + 2k.
    pub offsets: Vec<f64>,
}

impl Problem {
    /// Draws one: up to 20 variables, 40 rows, 5 discs, a condition number up to 1e7. `uniform` gives numbers in 0..1.
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

    /// Draws another centre and other offsets, as the next tick of a controller would bring.
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

    /// The largest slack that the centre changes, so that it can be scaled to leave the set by any measure.
    fn far(&self) -> f64 {
        let centre = DVector::from_column_slice(&self.centre);
        let (rows, discs) = (&self.rows * &centre, &self.discs * &centre);
        rows.iter().chain(&discs).fold(1e-9, |most, slack| most.max(slack.abs()))
    }
}

/// A matrix with a condition number up to 1e7 along random axes.
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

/// Rows in random directions, of lengths over two decades.
fn slopes(rows: usize, columns: usize, uniform: &mut impl FnMut() -> f64) -> DMatrix<f64> {
    let mut slopes = DMatrix::from_fn(rows, columns, |_, _| 2.0 * uniform() - 1.0);
    for mut row in slopes.row_iter_mut() {
        row *= 10_f64.powf(2.0 * uniform() - 1.0);
    }
    slopes
}

/// A whole number below `end`.
fn below(end: usize, uniform: &mut impl FnMut() -> f64) -> usize {
    (uniform() * end as f64) as usize
}
