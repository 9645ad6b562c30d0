//! Gain of the linear-quadratic regulator: u = -K x minimises the sum of x'Qx + u'Ru for the model.

use crate::model::{A, B, INPUTS as M, STATES as N};

/// Matrix of `R` rows and `C` columns.
pub type Matrix<const R: usize, const C: usize> = [[f64; C]; R];

fn product<const R: usize, const K: usize, const C: usize>(a: &Matrix<R, K>, b: &Matrix<K, C>) -> Matrix<R, C> {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..K).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed<const R: usize, const C: usize>(a: &Matrix<R, C>) -> Matrix<C, R> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn diagonal<const S: usize>(of: &[f64; S]) -> Matrix<S, S> {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { of[i] } else { 0.0 }))
}

fn sum<const R: usize, const C: usize>(a: &Matrix<R, C>, scale: f64, b: &Matrix<R, C>) -> Matrix<R, C> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + scale * b[i][j]))
}

/// Solves `s x = y` for a symmetric and positive definite `s`.
fn solved(mut s: Matrix<M, M>, mut y: Matrix<M, N>) -> Matrix<M, N> {
    for i in 0..M {
        let (pivot, solution) = (s[i], y[i]);
        for row in (0..M).filter(|row| *row != i) {
            let factor = s[row][i] / pivot[i];
            (0..M).for_each(|k| s[row][k] -= factor * pivot[k]);
            (0..N).for_each(|k| y[row][k] -= factor * solution[k]);
        }
    }
    std::array::from_fn(|i| y[i].map(|value| value / s[i][i]))
}

/// Computes K for the diagonals of Q and R by the Riccati iteration; `None` if the iteration does not converge.
pub fn lqr(q: &[f64; N], r: &[f64; M]) -> Option<Matrix<M, N>> {
    let (q, r) = (diagonal(q), diagonal(r));
    let mut p = q;
    for _ in 0..5000 {
        let bp = product(&transposed(&B), &p);
        let gain = solved(sum(&r, 1.0, &product(&bp, &B)), product(&bp, &A));
        let closed = sum(&A, -1.0, &product(&B, &gain));
        let next = sum(&q, 1.0, &product(&product(&transposed(&A), &p), &closed));
        let change = sum(&next, -1.0, &p).as_flattened().iter().fold(0.0, |most: f64, by| most.max(by.abs()));
        p = next;
        if change < 1e-9 * p[0][0] {
            return Some(gain);
        }
    }
    None
}
