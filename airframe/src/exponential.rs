//! Exponential of a matrix by scaling and squaring, from the series of the matrix halved until it is small:
//!
//! ```text
//! e^A = (e^(A / 2^s))^(2^s),      e^X = I + X (I + X/2 (I + X/3 (...)))      for |X| <= 1/2 in the 1-norm
//! ```
//!
//! nalgebra's exponential comes with matrix kernels that are chosen by processor and differ in their last bits.

use nalgebra::SMatrix;

/// Number of terms of the series: the first omitted term is below `2^-55` of the sum.
const TERMS: u32 = 14;

/// Computes `e^a`, without allocation. The result is not finite if an element of `a` is not finite, or on overflow.
pub fn exponential<const N: usize>(a: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let norm = a.column_iter().map(|column| column.abs().sum()).fold(0.0, f64::max);
    let halvings = libm::frexp(2.0 * norm).1.max(0);
    let small = a * libm::ldexp(1.0, -halvings);
    let identity = SMatrix::identity();
    let series = (1..=TERMS).rev().fold(identity, |sum, term| identity + small * sum / f64::from(term));
    (0..halvings).fold(series, |power, _| power * power)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Matrix3};

    use super::*;

    #[test]
    fn the_exponential_of_a_diagonal_matrix_is_elementwise() {
        for scale in [0.0, 1e-3, 0.5, 0.51, 3.0, 300.0] {
            let diagonal = nalgebra::Vector3::new(-scale, 0.3 * scale, -0.01);
            let expected = diagonal.map(f64::exp);
            let found = exponential(&Matrix3::from_diagonal(&diagonal));
            assert!((found.diagonal() - expected).component_div(&expected).amax() < 1e-13, "{scale}: {found}");
            assert_eq!(found - Matrix3::from_diagonal(&found.diagonal()), Matrix3::zeros());
        }
    }

    #[test]
    fn a_skew_matrix_gives_a_rotation_and_a_nilpotent_one_two_terms() {
        for angle in [0.1_f64, 2.0, 20.0] {
            let (sin, cos) = angle.sin_cos();
            let turn = exponential(&Matrix2::new(0.0, -angle, angle, 0.0));
            assert!((turn - Matrix2::new(cos, -sin, sin, cos)).amax() < 1e-13, "{angle}: {turn}");
        }
        assert_eq!(exponential(&Matrix2::new(0.0, 7.0, 0.0, 0.0)), Matrix2::new(1.0, 7.0, 0.0, 1.0));
    }

    #[test]
    fn elements_that_are_huge_or_not_finite_give_no_finite_matrix() {
        for element in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
            assert!(!exponential(&Matrix2::repeat(element)).iter().all(|x| x.is_finite()));
        }
    }
}
