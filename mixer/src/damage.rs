//! Damage that the mixer has detected, and that lasts to the end of the flight.

use bytemuck::{Pod, Zeroable};

/// Broken part of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BrokenPart {
    /// Rotor without thrust, 0 to 2.
    Rotor(usize),
    /// Tilt servo that is stuck at this angle \[rad\].
    Tilt(f64),
}

/// First damage of a flight, in the memory of the mixer: all zero for a sound vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Damage {
    /// 1 to 3 for a dead rotor, [`TILT`] for a stuck servo, else 0.
    part: u64,
    /// Angle of a stuck servo \[rad\], else 0.
    tilt_rad: f64,
}

/// Number of the servo in `part`, after the three rotors.
const TILT: u64 = 4;

impl Damage {
    /// Broken part; `None` for a sound vehicle.
    pub fn part(&self) -> Option<BrokenPart> {
        match self.part {
            rotor @ 1..TILT => Some(BrokenPart::Rotor(rotor as usize - 1)),
            TILT => Some(BrokenPart::Tilt(self.tilt_rad)),
            _ => None,
        }
    }
}

impl From<BrokenPart> for Damage {
    fn from(part: BrokenPart) -> Self {
        match part {
            BrokenPart::Rotor(rotor) => Self { part: rotor as u64 + 1, tilt_rad: 0.0 },
            BrokenPart::Tilt(tilt_rad) => Self { part: TILT, tilt_rad },
        }
    }
}
