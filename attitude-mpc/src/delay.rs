//! Demands that are still under way, and the delay after which they act: `mpc.delay_compensation = "measured"`.
//!
//! ```text
//!   sample k                                               the demand of k acts
//!      |--- f ---|------ Ts ------|------ Ts ------| ... ------|
//!      in force    demand of k-m    demand of k-m+1     k-1            delay = m Ts + f
//! ```
//!
//! STATE tells which command is in force, and the age at which it took effect: the time from the sample that it answers
//! to its effect at the actuators. The delay is that age, averaged over the commands (`SHARE`) and at most
//! [`MAX_DELAY`] samples, whatever STATE claims. The demands of this controller that no command in force has answered
//! yet act one after the other; a demand that a newer command has overtaken, or whose time has passed because its
//! message was lost, does not act, and the command in force goes on.
//!
//! The state is predicted to the end of this course, when the demand of sample `k` acts. The modelled actuators follow
//! each command from its effect on, also between two samples.
//!
//! A controller without a memory takes the command in force for all of its earlier demands, and the first age it sees
//! for the delay. A mixer or a plant that begins anew only changes the command in force.

use airframe::Actuation;
use bytemuck::{Pod, Zeroable};
use contract::message::State;
use contract::snapshot::OptionalTick;
use nalgebra::Vector4;

/// Longest delay \[samples\].
pub const MAX_DELAY: usize = 16;
/// Share of a new age in the mean.
const SHARE: f64 = 0.1;

/// Demands of the past, and what STATE told of those that have acted.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Delay {
    /// Demands of the newest sample used and of those before it, the newest first \[N, N m, N m, N m\].
    pub demands: [Vector4<f64>; MAX_DELAY + 1],
    /// Mean age at which a command takes effect \[ns\]; 0 before the first.
    age_ns: f64,
    /// Sample that the command in force answers; none before the first.
    answered: OptionalTick,
    /// Sequence number of the command in force; 0 before the first.
    sequence: u64,
    /// Command in force up to the newest sample used.
    command: Actuation,
}

/// Course of commands up to a sample: `before` for a part of the last period, then the command in force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch {
    /// Command in force at the sample before.
    pub before: Actuation,
    /// Time from the sample before to the switch \[ns\].
    pub after_ns: u64,
}

impl Delay {
    /// Starts before any sample, with `command` in force.
    pub fn new(command: Actuation) -> Self {
        Self { command, ..Self::zeroed() }
    }

    /// Makes room for the demand of the sample of `state`, `samples` after the newest one used: the demands between
    /// were those of before. Without a newest one the demands of before are taken for `input`, that of the command in
    /// force. Returns when in the last period that command took effect.
    pub fn observe(&mut self, state: &State, input: Vector4<f64>, samples: Option<u64>, sample_ns: u64) -> Switch {
        let command = Actuation::from(state.command_in_force);
        if let Some(samples) = samples {
            let shift = samples.min(MAX_DELAY as u64) as usize;
            self.demands.copy_within(..=MAX_DELAY - shift, shift);
            let held = self.demands[shift];
            self.demands[..shift].fill(held);
        } else {
            self.demands[1..].fill(input);
            self.command = command;
        }
        let mut switch = Switch { before: command, after_ns: 0 };
        if state.applied_sequence != self.sequence && state.applied_sequence != 0 {
            let age_ns = state.applied_age_ns.min(MAX_DELAY as u64 * sample_ns);
            switch = Switch { before: self.command, after_ns: age_ns % sample_ns };
            self.answered = match state.stamp.tick.checked_sub(1 + age_ns / sample_ns) {
                Some(tick) => OptionalTick::some(tick),
                None => self.answered,
            };
            let gap_ns = age_ns as f64 - self.age_ns;
            self.age_ns += if self.sequence == 0 { gap_ns } else { SHARE * gap_ns };
        }
        (self.sequence, self.command) = (state.applied_sequence, command);
        switch
    }

    /// Delay: its whole samples, and the rest \[ns\].
    pub fn samples(&self, sample_ns: u64) -> (usize, f64) {
        let whole = libm::floor(self.age_ns / sample_ns as f64).clamp(0.0, MAX_DELAY as f64);
        (whole as usize, (self.age_ns - whole * sample_ns as f64).clamp(0.0, sample_ns as f64))
    }

    /// Demand that begins to act in place of `input`, `age` samples after its own, at the sample `tick`.
    pub fn next(&self, input: Vector4<f64>, tick: u64, age: usize) -> Vector4<f64> {
        let of = tick.checked_sub(age as u64);
        let is_under_way = of.is_some() && OptionalTick::get(self.answered) < of;
        if is_under_way { self.demands[age.min(MAX_DELAY)] } else { input }
    }
}
