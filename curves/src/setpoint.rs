//! Reference at one instant.

/// Reference at one instant, NED.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Setpoint {
    /// Position \[m\].
    pub position_m: [f64; 3],
    /// Velocity \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Acceleration \[m/s2\].
    pub acceleration_mps2: [f64; 3],
}

impl Setpoint {
    /// Reference at `t_s` on a curve through `knots`. `place` returns the time and the position of a knot, and
    /// `between` the reference between two knots. Before the first and after the last knot the reference is at rest.
    pub fn along<K>(
        knots: &[K],
        place: impl Fn(&K) -> (f64, [f64; 3]),
        t_s: f64,
        between: impl Fn(&K, &K) -> Self,
    ) -> Self {
        let rest = |knot: Option<&K>| Self::at_rest(knot.map_or([0.0; 3], |knot| place(knot).1));
        match knots.iter().position(|knot| place(knot).0 > t_s) {
            None => rest(knots.last()),
            Some(0) => rest(knots.first()),
            Some(next) => between(&knots[next - 1], &knots[next]),
        }
    }

    /// Reference at rest at `position_m`.
    pub fn at_rest(position_m: [f64; 3]) -> Self {
        Self { position_m, ..Self::default() }
    }
}
