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
    /// Reference at rest at `position_m`.
    pub fn at_rest(position_m: [f64; 3]) -> Self {
        Self { position_m, ..Self::default() }
    }
}
