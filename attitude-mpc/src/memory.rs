//! What the controller remembers from tick to tick. Everything else is fixed when it is built.

use airframe::Actuation;
use nalgebra::{DVector, Vector4};

/// The controller's whole memory: a controller that gets a copy of it continues the same flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Memory {
    /// The newest sample used; `None` before the first.
    pub tick: Option<u64>,
    /// The state `x` of that sample, n.
    pub x: DVector<f64>,
    /// Where the controller believes the actuators were at that sample.
    pub actuation: Actuation,
    /// The estimate `d` \[N, N m, N m, N m\].
    pub disturbance: Vector4<f64>,
    /// The demand published last \[N, N m, N m, N m\].
    pub demand: Vector4<f64>,
    /// Integrals of the PID's errors: of w \[m\], theta, phi, psi \[rad s\].
    pub integral: Vector4<f64>,
    /// Ticks so far on which a solve failed.
    pub fallbacks: u64,
}

impl Memory {
    /// Nothing seen yet: `states` states at hover, actuators at their `trim`.
    pub fn new(states: usize, trim: Actuation) -> Self {
        Self {
            tick: None,
            x: DVector::zeros(states),
            actuation: trim,
            disturbance: Vector4::zeros(),
            demand: Vector4::zeros(),
            integral: Vector4::zeros(),
            fallbacks: 0,
        }
    }

    /// Samples from the newest one used to `tick`: 1 in a flight without gaps, and at the first sample.
    pub fn samples_until(&self, tick: u64) -> u64 {
        self.tick.map_or(1, |last| tick.saturating_sub(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_in_samples() {
        let mut memory = Memory::new(7, Actuation::default());
        assert_eq!(memory.samples_until(500), 1);
        memory.tick = Some(500);
        assert_eq!([500, 501, 504, 3].map(|tick| memory.samples_until(tick)), [0, 1, 4, 0]);
    }
}
