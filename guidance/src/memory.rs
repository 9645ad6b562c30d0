//! What the controller remembers from tick to tick. Everything else is fixed when it is built.

use bytemuck::{Pod, Zeroable};
use contract::message::Reference;
use contract::snapshot::{Layout, OptionalTick};
use nalgebra::Vector3;

use crate::observer::Observer;

/// The controller's whole memory: a controller that gets a copy of it continues the same flight.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Memory {
    /// Tick of the newest state answered.
    pub tick: OptionalTick,
    /// 1 when the last step had no state to use, else 0.
    pub silent: u64,
    /// 1 when the thrust was cut since the newest state answered, else 0.
    pub cut: u64,
    /// Tick of the first state after the last silence to come back from.
    pub back: OptionalTick,
    /// Position error of the newest state answered, NED \[m\].
    pub error_m: Vector3<f64>,
    /// Integral of the position error, NED \[m s\].
    pub integral_ms: Vector3<f64>,
    /// The disturbance observer.
    pub observer: Observer,
    /// The last answer, without a stamp.
    pub reference: Reference,
}

impl Layout for Memory {
    const NAME: [u8; 8] = *b"guidanc4";
}
