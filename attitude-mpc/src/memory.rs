//! State of the controller from tick to tick. All other fields of the controller are fixed at construction, or are
//! buffers.

use airframe::linear::LAGGED;
use bytemuck::{Pod, Zeroable};
use contract::actuation::Actuation;
use contract::delay::Delay;
use contract::snapshot::{MemoryLayout, OptionalTick};
use nalgebra::{DVectorView, SVector, Vector4};

use crate::disturbance::FIRST_GAIN;
use crate::goal::Goal;

/// Number of states of the largest model, which has the actuator lag.
pub const MAX_STATES: usize = LAGGED;
/// Largest number of discs in a warm start, one for each of 20 moves; also a quarter of its largest number of
/// constraints. A solver whose working set is larger starts its next solve without a warm start, as a process that
/// takes over does.
pub const MAX_DISCS: usize = 20;

/// Memory of the controller without its solver.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct AttitudeMemory {
    /// Tick of the newest sample used.
    pub tick: OptionalTick,
    /// Newest reference used.
    pub goal: Goal,
    /// Number of states of the model, n.
    pub states: u64,
    /// State `x` of the newest sample used: the first n elements.
    pub x: SVector<f64, MAX_STATES>,
    /// Modelled positions of the actuators at the newest sample used.
    pub actuation: Actuation,
    /// Disturbance estimate `d` \[N, N m, N m, N m\].
    pub disturbance: Vector4<f64>,
    /// Gain of the next update of `disturbance`.
    pub gain: f64,
    /// Demands published, the last one first, and their delay.
    pub delay: Delay,
    /// Integrals of the errors of the laws `pid` and `geometric`: of w \[m\], theta, phi, psi \[rad s\].
    pub integral: Vector4<f64>,
    /// Filter of the law `indi`.
    pub stage: FilterStage,
    /// Number of ticks so far whose plan is a fallback or the result of a solve that reached a limit.
    pub fallbacks: u64,
}

/// Memory of the filter of the law `indi`, except the disturbance, which is the second stage of the filter.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FilterStage {
    /// Tick of the sample that the next sample is compared with; none before the first sample under the law.
    pub tick: OptionalTick,
    /// Vertical speed at the sample of `tick`, down positive \[m/s\].
    pub sink_mps: f64,
    /// Effect of the actuators at the sample of `tick`: acceleration down \[m/s2\] and moments lon, lat, ped \[N m\].
    pub produced: Vector4<f64>,
    /// Output of the first low-pass on col, lon, lat, ped \[N, N m, N m, N m\].
    pub first: Vector4<f64>,
}

/// Constraints that the next solve starts from, as stored in a snapshot.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct WarmStart {
    /// Number of constraints.
    pub count: u64,
    /// Indices of the constraints, counted over the linear rows and then the discs, in the order in which they joined
    /// the working set; four indices to a word.
    pub places: [[u16; 4]; MAX_DISCS],
    /// Cosine and sine of the angle at which a disc is touched, for the discs in the order of `places`.
    pub towards: [[f64; 2]; MAX_DISCS],
}

/// Contents of a snapshot: a controller that restores a copy continues the same flight.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Whole {
    /// Memory of the controller.
    pub memory: AttitudeMemory,
    /// Memory of the solver.
    pub warm_start: WarmStart,
}

impl MemoryLayout for Whole {
    const NAME: [u8; 8] = *b"attmpc 7";
}

impl AttitudeMemory {
    /// Starts without any sample: `states` states at hover, actuators at `trim`.
    pub fn new(states: usize, trim: Actuation) -> Self {
        Self { states: states as u64, actuation: trim, delay: Delay::new(trim), gain: FIRST_GAIN, ..Self::zeroed() }
    }

    /// Resets the disturbance with its gain, the integrals and the filter.
    pub fn forget(&mut self) {
        (self.disturbance, self.gain) = (Vector4::zeros(), FIRST_GAIN);
        (self.integral, self.stage) = (Vector4::zeros(), FilterStage::zeroed());
    }

    /// Demand published last \[N, N m, N m, N m\].
    pub fn demand(&self) -> Vector4<f64> {
        self.delay.outputs[0].into()
    }

    /// State of the newest sample used.
    pub fn state(&self) -> DVectorView<'_, f64> {
        let states = (self.states as usize).min(MAX_STATES);
        DVectorView::from_slice(&self.x.as_slice()[..states], states)
    }

    /// Number of samples from the newest one used to `tick`: 1 without gaps and at the first sample, 0 for old ticks.
    pub fn samples_until(&self, tick: u64) -> u64 {
        self.tick.get().map_or(1, |last| tick.saturating_sub(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_in_samples() {
        let mut memory = AttitudeMemory::new(7, Actuation::default());
        assert_eq!(memory.samples_until(500), 1);
        memory.tick = OptionalTick::some(500);
        assert_eq!([500, 501, 504, 3].map(|tick| memory.samples_until(tick)), [0, 1, 4, 0]);
    }
}
