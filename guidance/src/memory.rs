//! State of the controller from tick to tick. All other fields of the controller are fixed at construction.

use bytemuck::{Pod, Zeroable};
use contract::delay::CommandAge;
use contract::message::Reference;
use contract::snapshot::{MemoryLayout, OptionalTick};
use nalgebra::Vector3;

use crate::observer::DisturbanceObserver;
use crate::takeoff::TakeOff;

/// Whole memory of the controller: a controller that restores a copy continues the same flight.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct GuidanceMemory {
    /// Tick of the newest state answered.
    pub tick: OptionalTick,
    /// 1 if the last step had no usable state, else 0.
    pub silent: u64,
    /// 1 if the thrust was cut since the newest state answered, else 0.
    pub cut: u64,
    /// Tick of the first state after the last silence.
    pub back: OptionalTick,
    /// Position error of the newest state answered, NED \[m\].
    pub error_m: Vector3<f64>,
    /// Integral of the position error, NED \[m s\].
    pub integral_ms: Vector3<f64>,
    /// Disturbance observer.
    pub observer: DisturbanceObserver,
    /// Age of the commands.
    pub age: CommandAge,
    /// State of the take-off.
    pub take_off: TakeOff,
    /// Last answer, without a stamp.
    pub reference: Reference,
}

impl MemoryLayout for GuidanceMemory {
    const NAME: [u8; 8] = *b"guidanc7";
}
