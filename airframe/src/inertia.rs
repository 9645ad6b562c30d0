//! Check that a body can have a given inertia tensor.

/// Share of the trace below which a number cannot be told from zero because of rounding.
const ROUNDING: f64 = 1e-12;

/// Returns whether a body of positive mass can have the symmetric inertia tensor `j` \[kg m2\]; `false` for NaN.
///
/// The condition is that the largest principal moment is at most the sum of the other two; for a plate both are equal.
/// An equivalent condition needs no principal axes: for the matrix of second moments `P = 1/2 tr(J) I - J`, whose
/// principal values are the integrals of `x^2 dm` and so on, no principal minor is negative (Wensing, Kim and Slotine,
/// IEEE RA-L 3(1), 2018). `J` must also be invertible, which excludes a rod along an axis.
pub fn is_possible(j: [[f64; 3]; 3]) -> bool {
    let trace = j[0][0] + j[1][1] + j[2][2];
    let mut p = j.map(|row| row.map(|x| -x / trace));
    for (i, row) in p.iter_mut().enumerate() {
        row[i] += 0.5;
    }
    let pairs = [(0, 1), (0, 2), (1, 2)];
    let not_negative = |x: f64| x >= -ROUNDING;
    (0..3).all(|i| not_negative(p[i][i]))
        && pairs.iter().all(|&(i, k)| not_negative(p[i][i] * p[k][k] - p[i][k] * p[i][k]))
        && not_negative(determinant(&p))
        && determinant(&j.map(|row| row.map(|x| x / trace))) > ROUNDING
}

fn determinant([[a, b, c], [d, e, f], [g, h, i]]: &[[f64; 3]; 3]) -> f64 {
    a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const fn diagonal(xx: f64, yy: f64, zz: f64) -> [[f64; 3]; 3] {
        [[xx, 0.0, 0.0], [0.0, yy, 0.0], [0.0, 0.0, zz]]
    }

    #[test]
    fn no_principal_moment_exceeds_the_sum_of_the_other_two() {
        assert!(is_possible(diagonal(0.0239, 0.01271, 0.01273)), "Table I");
        assert!(is_possible(diagonal(0.1, 0.2, 0.3)), "a plate");
        assert!(!is_possible(diagonal(0.06, 0.01, 0.01)) && !is_possible(diagonal(0.1, 0.3001, 0.2)));
        // Each moment alone is possible, but the principal moments of the tensor are 0.03, 0.01 and 0.015.
        assert!(!is_possible([[0.02, 0.01, 0.0], [0.01, 0.02, 0.0], [0.0, 0.0, 0.015]]));
        assert!(is_possible([[0.02, 0.004, 0.0], [0.004, 0.02, 0.0], [0.0, 0.0, 0.015]]));
        assert!(!is_possible(diagonal(1e-20, 1.0, 1.0)), "a rod turns about itself by nothing");
    }

    proptest! {
        /// Every body is a cloud of points with mass, so no such cloud may be refused.
        #[test]
        fn every_cloud_of_masses_is_possible(
            points in prop::collection::vec((0.01..1.0_f64, prop::array::uniform3(-1.0..1.0_f64)), 4..20),
        ) {
            let mut j = [[0.0; 3]; 3];
            for (mass, r) in points {
                let square: f64 = r.iter().map(|x| x * x).sum();
                for i in 0..3 {
                    for k in 0..3 {
                        j[i][k] += mass * (if i == k { square } else { 0.0 } - r[i] * r[k]);
                    }
                }
            }
            prop_assert!(is_possible(j), "{:?}", j);
        }
    }
}
