//! Speeds of the rotors and angle of the tilt servo.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Speeds of the three rotors and angle of the tilt servo, commanded or actual.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, Pod, Zeroable)]
#[repr(C)]
pub struct Actuation {
    /// `Omega_1..3` \[rotor speed unit\].
    pub rotor_speed: [f64; 3],
    /// Tilt of rotor 1 about the body x axis, mu \[rad\], positive for thrust along body y.
    pub tilt_rad: f64,
}

impl Actuation {
    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.rotor_speed.iter().all(|omega| omega.is_finite()) && self.tilt_rad.is_finite()
    }
}
