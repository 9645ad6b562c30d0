//! What the controller remembers from tick to tick. Everything else is fixed when it is built.

use airframe::Actuation;
use contract::snapshot::{Reader, Writer};
use nalgebra::{DVector, Vector4};

use crate::goal::Goal;

/// Node and version of the snapshots.
pub const LAYOUT: [u8; 8] = *b"attmpc 1";

/// The controller's whole memory: a controller that gets a copy of it continues the same flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Memory {
    /// The newest sample used; `None` before the first.
    pub tick: Option<u64>,
    /// The newest reference used.
    pub goal: Goal,
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
            goal: Goal::default(),
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

    /// Adds it to a snapshot.
    pub fn pack(&self, writer: &mut Writer) {
        let Goal { tick, w_mps, attitude_rad, rates_radps } = &self.goal;
        writer.optional(*tick);
        writer.numbers(&[*w_mps]);
        writer.numbers(attitude_rad);
        writer.numbers(rates_radps);
        writer.optional(self.tick);
        writer.numbers(&self.actuation.rotor_speed);
        writer.numbers(&[self.actuation.tilt_rad]);
        for vector in [&self.disturbance, &self.demand, &self.integral] {
            writer.numbers(vector.as_slice());
        }
        writer.word(self.fallbacks);
        writer.word(self.x.len() as u64);
        writer.numbers(self.x.as_slice());
    }

    /// From a snapshot; `None` where it is not that of a controller with `states` states.
    pub fn unpack(reader: &mut Reader, states: usize) -> Option<Self> {
        let mut memory = Self {
            goal: Goal {
                tick: reader.optional()?,
                w_mps: reader.number()?,
                attitude_rad: reader.numbers()?,
                rates_radps: reader.numbers()?,
            },
            tick: reader.optional()?,
            actuation: Actuation { rotor_speed: reader.numbers()?, tilt_rad: reader.number()? },
            disturbance: reader.numbers()?.into(),
            demand: reader.numbers()?.into(),
            integral: reader.numbers()?.into(),
            fallbacks: reader.word()?,
            x: DVector::zeros(states),
        };
        if reader.word()? != states as u64 {
            return None;
        }
        for x in memory.x.iter_mut() {
            *x = reader.number()?;
        }
        Some(memory)
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
