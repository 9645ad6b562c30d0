//! What the controller remembers from tick to tick. Everything else is fixed when it is built.

use airframe::Actuation;
use airframe::linear::{INPUTS, STATES};
use bytemuck::{Pod, Zeroable};
use contract::snapshot::{Layout, OptionalTick};
use nalgebra::{SVector, Vector4};

use crate::goal::Goal;

/// States of the largest model, the one with the actuator lag.
pub const MAX_STATES: usize = STATES + INPUTS;
/// Constraints to start from that a snapshot has room for. A solver that holds more starts from none.
pub const MAX_HELD: usize = 29;

/// The controller's memory without that of its solver.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Memory {
    /// The newest sample used.
    pub tick: OptionalTick,
    /// The newest reference used.
    pub goal: Goal,
    /// Number of states of the model, n.
    pub states: u64,
    /// The state `x` of the newest sample used: the first n.
    pub x: SVector<f64, MAX_STATES>,
    /// The modelled positions of the actuators at that sample.
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

/// The constraints that the next solve starts from, as a snapshot has them: the first `count` of `held`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct WarmStart {
    /// How many there are.
    pub count: u64,
    /// In the order in which they joined.
    pub held: [Held; MAX_HELD],
}

/// One constraint held as an equation.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Held {
    /// Index among all constraints: the linear rows, then the discs.
    pub place: u64,
    /// Cosine and sine of the angle at which a disc is touched; 0 for a row.
    pub towards: [f64; 2],
}

/// The contents of a snapshot: a controller that gets a copy of it continues the same flight.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Whole {
    /// The controller's memory.
    pub memory: Memory,
    /// Its solver's memory.
    pub warm_start: WarmStart,
}

impl Layout for Whole {
    const NAME: [u8; 8] = *b"attmpc 2";
}

impl Memory {
    /// Nothing seen yet: `states` states at hover, actuators at their `trim`.
    pub fn new(states: usize, trim: Actuation) -> Self {
        Self { states: states as u64, actuation: trim, ..Self::zeroed() }
    }

    /// Samples from the newest one used to `tick`: 1 in a flight without gaps, and at the first sample.
    pub fn samples_until(&self, tick: u64) -> u64 {
        self.tick.get().map_or(1, |last| tick.saturating_sub(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_in_samples() {
        let mut memory = Memory::new(7, Actuation::default());
        assert_eq!(memory.samples_until(500), 1);
        memory.tick = OptionalTick::some(500);
        assert_eq!([500, 501, 504, 3].map(|tick| memory.samples_until(tick)), [0, 1, 4, 0]);
    }
}
