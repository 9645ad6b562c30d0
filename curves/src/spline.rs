//! Curve through all waypoints, at rest only at the first and the last. Of all such curves that pass each waypoint at
//! its time, it has the smallest integral of squared jerk.
//!
//! Between neighbours the curve is a quintic, with continuous derivatives up to the fourth (Flash and Hogan, 1985, for
//! one waypoint between the ends). The unknowns are velocity `v` and acceleration `a` at each inner waypoint. `h` and
//! `d` are the duration and the displacement of the leg before the waypoint, `k` and `e` of the leg after it.
//! Continuity of the fourth and of the third derivative is
//!
//! ```text
//! 168/h3 v- + 24/h2 a- + 192 (1/h3 + 1/k3) v + 36 (1/k2 - 1/h2) a + 168/k3 v+ - 24/k2 a+ = 360 (d/h4 + e/k4)
//! -24/h2 v- -  3/h  a- +  36 (1/k2 - 1/h2) v +  9 (1/h + 1/k)   a +  24/k2 v+ -  3/k  a+ =  60 (e/k3 - d/h3)
//! ```
//!
//! The system is symmetric, positive definite and block tridiagonal ([`tridiagonal`](crate::tridiagonal)).

use nalgebra::{Matrix2, Matrix2x3, Vector3};

use crate::setpoint::Setpoint;
use crate::through::{Knot, Through};
use crate::tridiagonal::{WaypointRow, solve};

/// Solves the curve through `waypoints`, each with the time at which it is passed \[s\], increasing.
pub fn through(waypoints: &[(f64, Vector3<f64>)]) -> Through {
    let row = |three: &[(f64, Vector3<f64>)]| {
        let (before, after) = (Leg::new(three[0], three[1]), Leg::new(three[1], three[2]));
        let right = Matrix2x3::from_rows(&[
            (360.0 * (before.way / before.h[3] + after.way / after.h[3])).transpose(),
            (60.0 * (after.way / after.h[2] - before.way / before.h[2])).transpose(),
        ]);
        WaypointRow { on: before.at_end() + after.at_start(), across: after.across(), right }
    };
    let rows: Vec<WaypointRow<2>> = waypoints.windows(3).map(row).collect();
    let solved = solve(&rows).into_iter();
    let derivatives = solved.map(|solved| [solved.row(0).transpose(), solved.row(1).transpose(), Vector3::zeros()]);
    Through::new(waypoints, derivatives, between)
}

/// Reference on the quintic between two waypoints.
fn between(from: &Knot, to: &Knot, t_s: f64) -> Setpoint {
    let h = to.at_s - from.at_s;
    let x = (t_s - from.at_s) / h;
    let way = to.position - from.position;
    let [v0, v1] = [from.velocity * h, to.velocity * h];
    let [a0, a1] = [from.acceleration * (h * h), to.acceleration * (h * h)];
    let c2 = a0 / 2.0;
    let c3 = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
    let c4 = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
    let c5 = 6.0 * way - 3.0 * (v0 + v1) - 0.5 * (a0 - a1);
    Setpoint {
        position_m: (from.position + x * (v0 + x * (c2 + x * (c3 + x * (c4 + x * c5))))).into(),
        velocity_mps: ((v0 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) / h).into(),
        acceleration_mps2: ((2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))) / (h * h)).into(),
    }
}

/// Leg between two waypoints, as the equations need it.
struct Leg {
    /// Duration and its powers up to the fourth \[s\].
    h: [f64; 4],
    /// Displacement from start to end \[m\].
    way: Vector3<f64>,
}

impl Leg {
    fn new((from_s, from): (f64, Vector3<f64>), (until_s, to): (f64, Vector3<f64>)) -> Self {
        let h = until_s - from_s;
        Self { h: [h, h * h, h * h * h, h * h * h * h], way: to - from }
    }

    /// Coefficients of v and a at the end of the leg in the equations of the waypoint there.
    fn at_end(&self) -> Matrix2<f64> {
        let [h, h2, h3, _] = self.h;
        Matrix2::new(192.0 / h3, -36.0 / h2, -36.0 / h2, 9.0 / h)
    }

    /// Coefficients of v and a at the start of the leg in the equations of the waypoint there.
    fn at_start(&self) -> Matrix2<f64> {
        let [k, k2, k3, _] = self.h;
        Matrix2::new(192.0 / k3, 36.0 / k2, 36.0 / k2, 9.0 / k)
    }

    /// Coefficients of v and a at the end in the equations of the start; transposed, the coefficients at the start in
    /// the equations of the end.
    fn across(&self) -> Matrix2<f64> {
        let [k, k2, k3, _] = self.h;
        Matrix2::new(168.0 / k3, -24.0 / k2, 24.0 / k2, -3.0 / k)
    }
}
