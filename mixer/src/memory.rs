//! State of the mixer from tick to tick. All other fields of the mixer are fixed at construction, or are buffers.

use bytemuck::{Pod, Zeroable};
use contract::delay::Delay;
use contract::message::Kinematics;
use contract::snapshot::{MemoryLayout, OptionalTick};
use nalgebra::Vector4;

use crate::damage::Damage;
use crate::landing::LandDetector;
use crate::rotors::RotorEvidence;

/// Whole memory of the mixer: a mixer that restores a copy continues the same flight.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MixerMemory {
    /// Tick of the newest usable demand.
    pub demand_tick: OptionalTick,
    /// Newest usable demand: col, lon, lat, ped \[N, N m, N m, N m\].
    pub demand: Vector4<f64>,
    /// Newest finite disturbance estimate of the controller, in the same axes and units.
    pub disturbance: Vector4<f64>,
    /// Tick of the newest usable state.
    pub state_tick: OptionalTick,
    /// Measurements of the newest usable state.
    pub measured: Kinematics,
    /// Evidence on dead rotors and a stuck tilt servo.
    pub evidence: RotorEvidence,
    /// First damage, which lasts.
    pub damage: Damage,
    /// State of the land detector.
    pub landing: LandDetector,
    /// Commands sent, and their delay.
    pub delay: Delay,
}

impl MemoryLayout for MixerMemory {
    const NAME: [u8; 8] = *b"mixer  9";
}
