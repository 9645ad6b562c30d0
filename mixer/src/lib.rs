//! Control allocation: forces and moments to rotor speeds and tilt (31)-(44).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`allocation`] | demand to rotor speeds and tilt | (31)-(32), (39)-(44) |
//!
//! With `mixer.projection` a demand the actuators cannot produce becomes the nearest one they can
//! ([`airframe::projection`]) before it is allocated.
//!
//! The mixer never emits a NaN and never leaves the actuators' limits, whatever it is sent.

pub mod allocation;
mod process;

use airframe::envelope::Envelope;
use airframe::projection::Projection;
use airframe::{Actuation, DemandSet, Limits, MixingMatrix, Trim};
use contract::Scenario;
use contract::message::{Actuators, Controls, mixer_flags};
use nalgebra::Vector4;

pub use process::run;

/// The control allocation of one vehicle.
pub struct Mixer {
    mixing: MixingMatrix,
    limits: Limits,
    trim: Actuation,
    /// The safety net, where the scenario asks for it.
    projection: Option<Projection>,
}

impl Mixer {
    /// The allocation of `scenario`; with `mixer.tilt_reaction` exact for a plant that has that moment.
    pub fn new(scenario: &Scenario) -> Self {
        let tilt_reaction = scenario.mixer.tilt_reaction;
        Self {
            mixing: MixingMatrix::new(&scenario.airframe, tilt_reaction),
            limits: scenario.limits(),
            trim: Trim::solve(&scenario.airframe, tilt_reaction).actuation,
            projection: scenario.mixer.projection.then(|| {
                let envelope = Envelope::new(&scenario.airframe, tilt_reaction, scenario.limits());
                Projection::new(DemandSet::exact(&envelope))
            }),
        }
    }

    /// ACTUATORS for a demand: finite and inside the limits, with flags for what had to give.
    ///
    /// A demand that is not finite gets the trim command. With the projection nothing is left for the limits to clip.
    pub fn step(&mut self, controls: &Controls) -> Actuators {
        let demand = Vector4::from(controls.demand);
        if !demand.iter().all(|value| value.is_finite()) {
            let command = self.limits.clip(&self.trim).into();
            return Actuators { command, flags: mixer_flags::BAD_INPUT, ..Actuators::default() };
        }
        let nearest = self.projection.as_mut().and_then(|projection| projection.nearest(&demand));
        let (wanted, negative_square) = allocation::allocate(&self.mixing, &nearest.unwrap_or(demand));
        let command = self.limits.clip(&wanted);
        let mut flags = if nearest.is_some() { mixer_flags::PROJECTED } else { 0 };
        if negative_square {
            flags |= mixer_flags::NEGATIVE_SQUARE;
        }
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
