//! Solution of the discrete algebraic Riccati equation by structured doubling.
//!
//! ```text
//! S = A' S A - A' S B (R + B' S B)^-1 B' S A + Q
//! ```
//!
//! Each pass doubles the number of stages in the solution, so that a dozen passes cover thousands of samples:
//!
//! ```text
//! W = I + G H,   A <- A W^-1 A,   G <- G + A W^-1 G A',   H <- H + A' H W^-1 A
//! ```
//!
//! starting with `A`, `G = B R^-1 B'` and `H = Q`; `H` converges to `S`.

use nalgebra::DMatrix;

/// Largest number of passes of the doubling; they cover 2^60 samples.
const PASSES: usize = 60;
/// Relative change of `H` at which the doubling has converged.
const TOLERANCE: f64 = 1e-15;

/// Computes the stabilising solution `S` for `x[k+1] = A x + B u` with stage cost `x'Qx + u'Ru`, n x n. `None` if `R`
/// is not positive definite, or if the doubling does not converge to finite numbers.
pub fn solve(a: &DMatrix<f64>, b: &DMatrix<f64>, q: &DMatrix<f64>, r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let identity = DMatrix::identity(a.nrows(), a.nrows());
    let cholesky = r.clone().cholesky()?;
    let mut a = a.clone();
    let mut g = b * cholesky.solve(&b.transpose());
    let mut h = q.clone();
    for _ in 0..PASSES {
        let w = (&identity + &g * &h).lu();
        let w_a = w.solve(&a)?;
        let w_g = w.solve(&g)?;
        let growth = a.transpose() * &h * &w_a;
        g += &a * w_g * a.transpose();
        a *= w_a;
        h += &growth;
        if growth.amax() <= TOLERANCE * h.amax() {
            let solution = (&h + h.transpose()) * 0.5;
            return solution.iter().all(|x| x.is_finite()).then_some(solution);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scalar_has_a_closed_form() {
        let one = DMatrix::from_element(1, 1, 1.0);
        let golden = f64::midpoint(1.0, 5.0_f64.sqrt()); // S^2 = S + 1
        assert!((solve(&one, &one, &one, &one).unwrap()[0] - golden).abs() < 1e-14);
    }

    #[test]
    fn without_dynamics_only_the_stage_counts() {
        let one = DMatrix::from_element(1, 1, 1.0);
        assert_eq!(solve(&DMatrix::zeros(1, 1), &one, &one, &one), Some(one));
    }
}
