//! Control allocation: forces and moments to rotor speeds and tilt (31)-(44).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`allocation`] | demand to rotor speeds and tilt | (31)-(32), (39)-(44) |
//!
//! The mixer never emits a NaN and never leaves the actuators' limits, whatever it is sent.

pub mod allocation;
mod process;

use airframe::{Actuation, Limits, MixingMatrix, Trim};
use contract::Scenario;
use contract::message::{Actuators, Controls, mixer_flags};
use nalgebra::Vector4;

pub use process::run;

/// The control allocation of one vehicle.
#[derive(Debug, Clone)]
pub struct Mixer {
    mixing: MixingMatrix,
    limits: Limits,
    trim: Actuation,
}

impl Mixer {
    /// The allocation of `scenario`; with `mixer.tilt_reaction` exact for a plant that has that moment.
    pub fn new(scenario: &Scenario) -> Self {
        let tilt_reaction = scenario.mixer.tilt_reaction;
        Self {
            mixing: MixingMatrix::new(&scenario.airframe, tilt_reaction),
            limits: scenario.limits(),
            trim: Trim::solve(&scenario.airframe, tilt_reaction).actuation,
        }
    }

    /// ACTUATORS for a demand: finite and inside the limits, with flags for what had to give.
    ///
    /// A demand that is not finite gets the trim command.
    pub fn step(&mut self, controls: &Controls) -> Actuators {
        if !controls.demand.iter().all(|value| value.is_finite()) {
            let command = self.limits.clip(&self.trim).into();
            return Actuators { command, flags: mixer_flags::BAD_INPUT, ..Actuators::default() };
        }
        let (wanted, negative_square) = allocation::allocate(&self.mixing, &Vector4::from(controls.demand));
        let command = self.limits.clip(&wanted);
        let mut flags = if negative_square { mixer_flags::NEGATIVE_SQUARE } else { 0 };
        for (rotor, (got, asked)) in command.rotor_speed.iter().zip(wanted.rotor_speed).enumerate() {
            if *got != asked {
                flags |= mixer_flags::ROTOR_SATURATED << rotor;
            }
        }
        if command.tilt_rad != wanted.tilt_rad {
            flags |= mixer_flags::TILT_SATURATED;
        }
        Actuators { command: command.into(), flags, ..Actuators::default() }
    }
}

#[cfg(test)]
mod tests;
