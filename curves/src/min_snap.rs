//! Curve through all waypoints, at rest only at the first and the last. Of all such curves that pass each waypoint at
//! its time, it has the smallest integral of squared snap (Mellinger and Kumar, ICRA 2011).
//!
//! Between neighbours the curve is of the seventh degree. The unknowns are velocity, acceleration and jerk at each
//! inner waypoint, as in the unconstrained form of Richter, Bry and Roy (ISRR 2013), which is better conditioned than a
//! form with coefficients. A leg of duration `h` costs
//!
//! ```text
//! J = h^-7 d' R d,   d = (p, h v, h2 a, h3 j) at its start, then at its end
//! ```
//!
//! with the symmetric matrix `R` of a leg of one second, `SNAP`. The gradient of the sum over all legs is zero where
//! the curve has continuous derivatives up to the sixth. These equations are positive definite and block tridiagonal
//! ([`tridiagonal`](crate::tridiagonal)). Each waypoint has its unknowns in units of the shorter of its two legs, so
//! that the blocks are of the size of `R`, whatever the durations are.

use nalgebra::{Matrix3, Vector3};

use crate::setpoint::Setpoint;
use crate::through::{Knot, Through};
use crate::tridiagonal::{WaypointRow, solve};

/// Integral of the squared snap of a leg of one second, as a form in position, velocity, acceleration and jerk at its
/// start and at its end.
#[rustfmt::skip]
const SNAP: [[f64; 8]; 8] = [
    [ 100_800.0,  50_400.0,  10_080.0,  840.0, -100_800.0,  50_400.0, -10_080.0,  840.0],
    [  50_400.0,  25_920.0,   5_400.0,  480.0,  -50_400.0,  24_480.0,  -4_680.0,  360.0],
    [  10_080.0,   5_400.0,   1_200.0,  120.0,  -10_080.0,   4_680.0,    -840.0,   60.0],
    [     840.0,     480.0,     120.0,   16.0,     -840.0,     360.0,     -60.0,    4.0],
    [-100_800.0, -50_400.0, -10_080.0, -840.0,  100_800.0, -50_400.0,  10_080.0, -840.0],
    [  50_400.0,  24_480.0,   4_680.0,  360.0,  -50_400.0,  25_920.0,  -5_400.0,  480.0],
    [ -10_080.0,  -4_680.0,    -840.0,  -60.0,   10_080.0,  -5_400.0,   1_200.0, -120.0],
    [     840.0,     360.0,      60.0,    4.0,     -840.0,     480.0,    -120.0,   16.0],
];
/// First row of [`SNAP`] for the start of a leg, and for its end.
const ENDS: [usize; 2] = [0, 4];

/// Solves the curve through `waypoints`, each with the time at which it is passed \[s\], increasing.
pub fn through(waypoints: &[(f64, Vector3<f64>)]) -> Through {
    let legs: Vec<Leg> = waypoints.windows(2).map(|ends| Leg::new(ends[0], ends[1])).collect();
    let units: Vec<Vector3<f64>> = legs.windows(2).map(|two| units(two[0].h.min(two[1].h))).collect();
    let row = |(i, unit): (usize, &Vector3<f64>)| {
        let (before, after) = (&legs[i], &legs[i + 1]);
        WaypointRow {
            on: before.block(1, 1, unit, unit) + after.block(0, 0, unit, unit),
            across: units.get(i + 1).map_or_else(Matrix3::zeros, |next| after.block(0, 1, unit, next)),
            right: before.right(1, unit) + after.right(0, unit),
        }
    };
    let rows: Vec<WaypointRow<3>> = units.iter().enumerate().map(row).collect();
    let solved = units.iter().zip(solve(&rows));
    let derivatives = solved.map(|(unit, solved)| [0, 1, 2].map(|row| solved.row(row).transpose() * unit[row]));
    Through::new(waypoints, derivatives, between)
}

/// Reference on the curve of the seventh degree between two waypoints.
fn between(from: &Knot, to: &Knot, t_s: f64) -> Setpoint {
    let h = to.at_s - from.at_s;
    let x = (t_s - from.at_s) / h;
    let way = to.position - from.position;
    let [v0, v1] = [from.velocity * h, to.velocity * h];
    let [a0, a1] = [from.acceleration * (h * h), to.acceleration * (h * h)];
    let [j0, j1] = [from.jerk * (h * h * h), to.jerk * (h * h * h)];
    let (c2, c3) = (a0 / 2.0, j0 / 6.0);
    let c4 = 35.0 * way - 20.0 * v0 - 15.0 * v1 - 5.0 * a0 + 2.5 * a1 - (4.0 * j0 + j1) / 6.0;
    let c5 = -84.0 * way + 45.0 * v0 + 39.0 * v1 + 10.0 * a0 - 7.0 * a1 + j0 + 0.5 * j1;
    let c6 = 70.0 * way - 36.0 * v0 - 34.0 * v1 - 7.5 * a0 + 6.5 * a1 - (4.0 * j0 + 3.0 * j1) / 6.0;
    let c7 = -20.0 * way + 10.0 * (v0 + v1) + 2.0 * (a0 - a1) + (j0 + j1) / 6.0;
    let position = from.position + x * (v0 + x * (c2 + x * (c3 + x * (c4 + x * (c5 + x * (c6 + x * c7))))));
    let velocity =
        v0 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * (5.0 * c5 + x * (6.0 * c6 + x * 7.0 * c7)))));
    let acceleration = 2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * (20.0 * c5 + x * (30.0 * c6 + x * 42.0 * c7))));
    Setpoint {
        position_m: position.into(),
        velocity_mps: (velocity / h).into(),
        acceleration_mps2: (acceleration / (h * h)).into(),
    }
}

/// Units of velocity, acceleration and jerk at a waypoint whose shorter leg takes `h`: h^2.5, h^1.5 and h^0.5.
fn units(h: f64) -> Vector3<f64> {
    let root = h.sqrt();
    Vector3::new(h * h * root, h * root, root)
}

/// Leg between two waypoints, as the equations need it.
struct Leg {
    /// Duration \[s\].
    h: f64,
    /// Displacement from start to end \[m\].
    way: Vector3<f64>,
}

impl Leg {
    fn new((from_s, from): (f64, Vector3<f64>), (until_s, to): (f64, Vector3<f64>)) -> Self {
        Self { h: until_s - from_s, way: to - from }
    }

    /// Coefficients of the derivatives at end `other` in the equations of end `own`: 0 is the start, 1 the end.
    fn block(&self, own: usize, other: usize, own_units: &Vector3<f64>, other_units: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::from_fn(|row, column| {
            let size = SNAP[ENDS[own] + row + 1][ENDS[other] + column + 1];
            size * own_units[row] * other_units[column] / self.power(5 - row - column)
        })
    }

    /// Right-hand side in the equations of end `own`, from the displacement.
    fn right(&self, own: usize, own_units: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::from_fn(|row, axis| {
            -SNAP[ENDS[own] + row + 1][ENDS[1]] * self.way[axis] * own_units[row] / self.power(6 - row)
        })
    }

    /// Duration to the power `n`.
    fn power(&self, n: usize) -> f64 {
        (0..n).fold(1.0, |power, _| power * self.h)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn curve(legs: &[(f64, [f64; 3])]) -> Through {
        let mut at_s = 0.0;
        let later = legs.iter().map(|(h, position)| {
            at_s += h;
            (at_s, Vector3::from(*position))
        });
        through(&std::iter::once((0.0, Vector3::zeros())).chain(later).collect::<Vec<_>>())
    }

    /// Integral of the squared snap, by Simpson's rule on second differences of the acceleration.
    fn cost(curve: &Through) -> f64 {
        let mut sum = 0.0;
        for ends in curve.knots.windows(2) {
            let h = ends[1].at_s - ends[0].at_s;
            let acceleration =
                |x: f64| Vector3::from(between(&ends[0], &ends[1], ends[0].at_s + x * h).acceleration_mps2);
            let step = 0.02; // the difference below is exact for a polynomial of the fifth degree
            let snap = |x: f64| {
                let [a, b, c, d, e] = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|i| acceleration(x + i * step));
                (16.0 * (b + d) - 30.0 * c - a - e) / (12.0 * step * step * h * h)
            };
            let points = 64;
            for i in 0..=points {
                let weight = if i == 0 || i == points {
                    1.0
                } else if i % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                sum += weight * snap(f64::from(i) / f64::from(points)).norm_squared() * h / (3.0 * f64::from(points));
            }
        }
        sum
    }

    fn legs() -> impl Strategy<Value = Vec<(f64, [f64; 3])>> {
        prop::collection::vec((0.3..4.0_f64, prop::array::uniform3(-20.0..20.0_f64)), 2..8)
    }

    #[test]
    fn one_leg_is_the_curve_of_least_snap_from_rest_to_rest() {
        let leg = curve(&[(2.0, [3.0, 0.0, -1.0])]);
        for i in 0..=20 {
            let x = f64::from(i) / 20.0;
            let s = x.powi(4) * (35.0 - 84.0 * x + 70.0 * x * x - 20.0 * x.powi(3));
            let position = leg.at(2.0 * x).position_m;
            assert!((position[0] - 3.0 * s).abs() < 1e-12 && (position[2] + s).abs() < 1e-12, "at {x}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

        #[test]
        fn any_other_curve_through_the_waypoints_has_more_snap(
            legs in legs(), which in any::<prop::sample::Index>(), by in prop::array::uniform3(-1.0..1.0_f64), order in 0..3_usize,
        ) {
            let best = curve(&legs);
            let least = cost(&best);
            let changed = |sign: f64| {
                let mut other = best.clone();
                let inner = 1 + which.index(other.knots.len() - 2);
                let knot = &mut other.knots[inner];
                let derivative = [&mut knot.velocity, &mut knot.acceleration, &mut knot.jerk];
                *derivative.into_iter().nth(order).unwrap() += Vector3::from(by) * sign;
                cost(&other)
            };
            let (more, less) = (changed(1.0) - least, changed(-1.0) - least);
            // At the minimum of a quadratic form a change costs the same in both directions, and more than zero.
            let rounding = 1e-7 * least;
            prop_assert!(more > -rounding && less > -rounding, "{} {}", more / least, less / least);
            prop_assert!((more - less).abs() < 1e-3 * (more + less) + rounding, "{more} {less} {least}");
        }

        #[test]
        fn legs_of_any_durations_give_a_finite_curve(
            durations in prop::collection::vec(-2.0..4.9_f64, 1..8), to in prop::array::uniform3(-200.0..200.0_f64),
        ) {
            let legs: Vec<_> = durations.iter().map(|decade| (10_f64.powf(*decade), to)).collect();
            let curve = curve(&legs);
            for ends in curve.knots.windows(2) {
                for share in [0.0, 0.3, 0.99] {
                    let here = curve.at(ends[0].at_s + share * (ends[1].at_s - ends[0].at_s));
                    let all = [here.position_m, here.velocity_mps, here.acceleration_mps2];
                    prop_assert!(all.as_flattened().iter().all(|x| x.is_finite()), "{:?}", here);
                }
            }
        }
    }
}
