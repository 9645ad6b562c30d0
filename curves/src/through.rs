//! Curve through waypoints, of least jerk ([`spline`](crate::spline)) or of least snap ([`min_snap`](crate::min_snap)).

use nalgebra::Vector3;

use crate::setpoint::Setpoint;

/// Waypoint, with the time and the derivatives of the curve there. A curve of least jerk does not use `jerk`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Knot {
    /// Time at which the curve passes the waypoint \[s\].
    pub at_s: f64,
    /// Position \[m\].
    pub position: Vector3<f64>,
    /// Velocity \[m/s\].
    pub velocity: Vector3<f64>,
    /// Acceleration \[m/s2\].
    pub acceleration: Vector3<f64>,
    /// Jerk \[m/s3\].
    pub jerk: Vector3<f64>,
}

/// Curve through all waypoints, at rest only at the first and the last.
#[derive(Debug, Clone)]
pub struct Through {
    pub(crate) knots: Vec<Knot>,
    between: fn(&Knot, &Knot, f64) -> Setpoint,
}

impl Through {
    /// Makes the curve that `between` computes from each waypoint to the next. It passes each waypoint at its time
    /// \[s\] with the `derivatives` there, from the velocity on. The derivatives at the first and the last waypoint are
    /// zero, and not given.
    pub fn new(
        waypoints: &[(f64, Vector3<f64>)],
        derivatives: impl Iterator<Item = [Vector3<f64>; 3]>,
        between: fn(&Knot, &Knot, f64) -> Setpoint,
    ) -> Self {
        let knot = |&(at_s, position): &(f64, _)| Knot { at_s, position, ..Knot::default() };
        let mut knots: Vec<Knot> = waypoints.iter().map(knot).collect();
        for (knot, derivatives) in knots.iter_mut().skip(1).zip(derivatives) {
            [knot.velocity, knot.acceleration, knot.jerk] = derivatives;
        }
        Self { knots, between }
    }

    /// Times of the waypoints \[s\].
    pub fn times_s(&self) -> impl Iterator<Item = f64> {
        self.knots.iter().map(|knot| knot.at_s)
    }

    /// Reference at `t_s`; at rest before the first waypoint and after the last.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let place = |knot: &Knot| (knot.at_s, knot.position.into());
        Setpoint::along(&self.knots, place, t_s, |from, to| (self.between)(from, to, t_s))
    }
}
