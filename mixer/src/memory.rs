//! What the mixer remembers from tick to tick. Everything else is fixed when it is built.

use bytemuck::{Pod, Zeroable};
use contract::message::Kinematics;
use contract::snapshot::{Layout, OptionalTick};
use nalgebra::Vector4;

use crate::landing::Landing;
use crate::rotors::Evidence;

/// The mixer's whole memory: a mixer that gets a copy of it continues the same flight.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Memory {
    /// Tick of the newest usable demand.
    pub demand_tick: OptionalTick,
    /// That demand: col, lon, lat, ped \[N, N m, N m, N m\].
    pub demand: Vector4<f64>,
    /// The disturbance estimate that came with it, same axes and units.
    pub disturbance: Vector4<f64>,
    /// Tick of the newest usable state.
    pub state_tick: OptionalTick,
    /// What was measured then.
    pub measured: Kinematics,
    /// Whether the rotors follow.
    pub evidence: Evidence,
    /// 1 once a rotor is known to be dead, which ends the flight: no thrust any more; else 0.
    pub terminated: u64,
    /// What is known of the ground.
    pub landing: Landing,
}

impl Layout for Memory {
    const NAME: [u8; 8] = *b"mixer  4";
}
