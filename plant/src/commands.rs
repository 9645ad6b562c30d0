//! Time line of commands: determines the command in force at each instant.
//!
//! ```text
//! sample      arrival        arrival + delay + jitter
//!   |------------|----------------------|----------------> in force until a newer command acts
//! ```
//!
//! All times are integer nanoseconds since the start of the run, so that delays that are multiples of the integration
//! step end exactly at a step.
//!
//! A command in force longer than [`CUT_NS`] is cut: the rotors stop, also below idle, and the tilt stays as commanded.
//! A new command ends the cut.

use std::collections::VecDeque;

use bytemuck::{Pod, Zeroable};
use contract::actuation::Actuation;
use contract::message::{Actuators, Stamp};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use settings::Scenario;

use crate::memory::Tape;
use crate::random::Stream;

/// Largest number of commands per sample that wait on the time line; further commands are lost like dropped commands.
const WAITING_PER_SAMPLE: u64 = 4;

/// Longest time that a command stays in force without a successor \[ns\].
///
/// A motor controller without commands stops its motor, so that a vehicle without control comes down and does not fly
/// away. Half a second is longer than any gap that the stack must bridge, and longer than a vehicle survives without
/// control.
pub const CUT_NS: u64 = 500_000_000;

/// Command on the time line.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Command {
    /// Commanded positions.
    pub actuation: Actuation,
    /// Sequence number of the command's message; 0 for the trim command of the start.
    pub sequence: u64,
    /// Number of samples up to the sample that the command answers; 0 for the trim command. The order compares
    /// `samples` before `sequence`, because a process that takes over counts its messages from 1.
    samples: u64,
    /// Time at which the command takes effect \[ns\].
    effect_ns: u64,
    /// Time from the sample that the command was computed from to the effect \[ns\].
    pub age_ns: u64,
}

impl Command {
    /// Sort key: the greater of two belongs to the newer command.
    fn order(&self) -> (u64, u64) {
        (self.samples, self.sequence)
    }
}

/// Command in force, and the commands under way.
#[derive(Debug, Clone)]
pub struct CommandLine {
    in_force: Command,
    /// `true` if the motor controllers cut the command: the rotors stop, also below their idle speed.
    is_cut: bool,
    /// Commands under way, increasing in effect time and in order: the later of two is always the newer.
    waiting: VecDeque<Command>,
    capacity: usize,
    sample_ns: u64,
    delay_ns: u64,
    jitter_ns: u64,
    drop_probability: f64,
    drops: ChaCha8Rng,
    jitter: ChaCha8Rng,
}

impl CommandLine {
    /// Builds the time line of `scenario`, with `trim` in force.
    pub fn new(scenario: &Scenario, trim: Actuation) -> Self {
        let run = &scenario.run;
        let nanoseconds = |ms: f64| (ms * 1e6).round() as u64;
        let (delay_ns, jitter_ns) = (nanoseconds(run.command_delay_ms), nanoseconds(run.command_jitter_ms));
        let samples_on_the_way = 2 + (delay_ns + jitter_ns) / scenario.sample_ns();
        let capacity = (WAITING_PER_SAMPLE * samples_on_the_way) as usize;
        Self {
            in_force: Command { actuation: trim, ..Command::default() },
            is_cut: false,
            waiting: VecDeque::with_capacity(capacity),
            capacity,
            sample_ns: scenario.sample_ns(),
            delay_ns,
            jitter_ns,
            drop_probability: run.command_drop_probability,
            drops: Stream::Drops.open(run.seed),
            jitter: Stream::Jitter.open(run.seed),
        }
    }

    /// Writes or reads the commands and the random streams.
    pub fn remember(&mut self, tape: &mut Tape) {
        tape.value(&mut self.in_force);
        tape.flag(&mut self.is_cut);
        tape.queue(&mut self.waiting, self.capacity, Tape::value);
        tape.random(&mut self.drops);
        tape.random(&mut self.jitter);
    }

    /// Receives a command at `arrival_ns`. A command has no effect if it is lost, not finite, an answer to a future
    /// sample, or overtaken by a newer command.
    pub fn receive(&mut self, actuators: &Actuators, arrival_ns: u64) {
        // Loss and jitter are drawn for every command, so that the jitter does not depend on earlier losses.
        let lost = self.draw_loss();
        let effect_ns = arrival_ns.saturating_add(self.delay_ns).saturating_add(self.draw_jitter_ns());
        let Stamp { tick, sequence, .. } = actuators.stamp;
        let sample_ns = tick.saturating_mul(self.sample_ns);
        let age_ns = effect_ns.saturating_sub(sample_ns);
        let actuation = Actuation::from(actuators.command);
        if !lost && actuation.is_finite() && sample_ns <= arrival_ns {
            let samples = tick.saturating_add(1);
            self.insert(Command { actuation, sequence, samples, effect_ns, age_ns });
        }
    }

    /// Puts into force the commands that take effect up to and including `now_ns`, and cuts a command that has been in
    /// force for too long.
    pub fn switch(&mut self, now_ns: u64) {
        while let Some(next) = self.waiting.front().filter(|c| c.effect_ns <= now_ns) {
            (self.in_force, self.is_cut) = (*next, false);
            self.waiting.pop_front();
        }
        if self.cut_ns() <= now_ns {
            self.in_force.actuation.rotor_speed = [0.0; 3];
            self.is_cut = true;
        }
    }

    /// Command in force since the last [`switch`](Self::switch); a cut command has rotor speeds of 0.
    pub fn in_force(&self) -> &Command {
        &self.in_force
    }

    /// Time at which the next command takes effect or the present command is cut \[ns\]; `u64::MAX` if neither will
    /// happen.
    pub fn next_switch_ns(&self) -> u64 {
        let cut_ns = if self.is_cut { u64::MAX } else { self.cut_ns() };
        self.waiting.front().map_or(cut_ns, |c| c.effect_ns.min(cut_ns))
    }

    fn cut_ns(&self) -> u64 {
        self.in_force.effect_ns.saturating_add(CUT_NS)
    }

    fn insert(&mut self, new: Command) {
        let overtaken = |c: &Command| c.effect_ns <= new.effect_ns && c.order() >= new.order();
        if new.order() <= self.in_force.order() || self.waiting.iter().any(overtaken) {
            return;
        }
        // Remove older commands that would take effect later.
        self.waiting.retain(|c| c.effect_ns < new.effect_ns || c.order() > new.order());
        if self.waiting.len() < self.capacity {
            let place = self.waiting.partition_point(|c| c.effect_ns < new.effect_ns);
            self.waiting.insert(place, new);
        }
    }

    fn draw_loss(&mut self) -> bool {
        self.drop_probability > 0.0 && self.drops.random::<f64>() < self.drop_probability
    }

    fn draw_jitter_ns(&mut self) -> u64 {
        if self.jitter_ns == 0 { 0 } else { (self.jitter.random::<f64>() * self.jitter_ns as f64) as u64 }
    }
}

#[cfg(test)]
mod tests;
