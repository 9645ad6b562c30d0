//! Outputs that are still under way, and the delay after which they act.
//!
//! ```text
//!   sample k                                               the output of k acts
//!      |--- f ---|------ Ts ------|------ Ts ------| ... ------|
//!      in force    output of k-m    output of k-m+1     k-1            delay = m Ts + f
//! ```
//!
//! An output is a demand of attitude-mpc, with `attitude.delay_compensation = "measured"`, or a command of the mixer,
//! for the descent of a broken vehicle. STATE names the command in force and the age of that command: the time from the
//! sample that the command answers to its effect at the actuators. The delay is the mean age of the commands (`SHARE`),
//! at most [`MAX_DELAY`] samples, whatever STATE claims. The outputs for later samples than the one that the command in
//! force answers act one after the other. An output does not act if a newer command has overtaken it, or if its time
//! has passed because its message was lost; then the command in force stays.
//!
//! The motion is predicted to the instant at which the output of sample `k` acts. The modelled actuators follow each
//! command from the instant of its effect, which may lie between two samples.
//!
//! A process without a memory assumes that all its earlier outputs equal the output behind the command in force, and
//! that the delay is the first age that it sees. A restart of the mixer or the plant only changes the command in force.

use crate::actuation::Actuation;
use bytemuck::{Pod, Zeroable};

use crate::message::State;
use crate::snapshot::OptionalTick;

/// Longest delay \[samples\].
pub const MAX_DELAY: usize = 31;
/// Share of a new age in the mean.
const SHARE: f64 = 0.1;

/// Output of a process for one sample: four numbers whose meaning the process defines.
pub type DelayedOutput = [f64; 4];

/// Mean age at which the commands take effect.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct CommandAge {
    /// Mean \[ns\]; 0 before the first command.
    mean_ns: f64,
    /// Sequence number of the command in force; 0 before the first command.
    sequence: u64,
}

impl CommandAge {
    /// Updates the mean by the age of the command in force of `state`. Returns that age \[ns\], at most [`MAX_DELAY`]
    /// samples, if the command is new.
    pub fn observe(&mut self, state: &State, sample_ns: u64) -> Option<u64> {
        let before = std::mem::replace(&mut self.sequence, state.applied_sequence);
        (state.applied_sequence != before && state.applied_sequence != 0).then(|| {
            let age_ns = state.applied_age_ns.min(MAX_DELAY as u64 * sample_ns);
            let gap_ns = age_ns as f64 - self.mean_ns;
            self.mean_ns += if before == 0 { gap_ns } else { SHARE * gap_ns };
            age_ns
        })
    }

    /// Mean \[s\]; 0 before the first command.
    pub fn mean_s(&self) -> f64 {
        self.mean_ns * 1e-9
    }
}

/// Past outputs, and the effects of commands as reported by STATE.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Delay {
    /// Outputs for the newest sample used and the [`MAX_DELAY`] samples before it, the newest first.
    pub outputs: [DelayedOutput; MAX_DELAY + 1],
    /// Mean age at which a command takes effect.
    age: CommandAge,
    /// Sample that the command in force answers; none before the first command.
    answered: OptionalTick,
    /// Command in force at the newest sample used.
    pub command: Actuation,
}

/// Course of commands up to a sample: `before` for a part of the last period, then the command in force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch {
    /// Command in force at the previous sample.
    pub before: Actuation,
    /// Time from the previous sample to the switch \[ns\].
    pub after_ns: u64,
}

impl Delay {
    /// Creates the memory before any sample, with `command` in force.
    pub fn new(command: Actuation) -> Self {
        Self { command, ..Self::zeroed() }
    }

    /// Makes room for the output for the sample of `state`, which comes `samples` samples after the newest one used.
    /// The samples between the two get the newest output so far. If `samples` is `None`, there is no memory, and all
    /// earlier outputs become `in_force`, the output behind the command in force. Returns the switch to that command in
    /// the last period.
    pub fn observe(&mut self, state: &State, in_force: DelayedOutput, samples: Option<u64>, sample_ns: u64) -> Switch {
        let command = Actuation::from(state.command_in_force);
        if let Some(samples) = samples {
            let shift = samples.min(MAX_DELAY as u64) as usize;
            self.outputs.copy_within(..=MAX_DELAY - shift, shift);
            let held = self.outputs[shift];
            self.outputs[..shift].fill(held);
        } else {
            self.outputs[1..].fill(in_force);
            self.command = command;
        }
        let mut switch = Switch { before: command, after_ns: 0 };
        if let Some(age_ns) = self.age.observe(state, sample_ns) {
            switch = Switch { before: self.command, after_ns: age_ns % sample_ns };
            self.answered = match state.stamp.tick.checked_sub(1 + age_ns / sample_ns) {
                Some(tick) => OptionalTick::some(tick),
                None => self.answered,
            };
        }
        self.command = command;
        switch
    }

    /// Output for the earlier sample that the command in force at the sample `tick` answers; if that sample is unknown,
    /// the newest output before `tick`.
    pub fn answered(&self, tick: u64) -> DelayedOutput {
        let age = self.answered.get().map_or(1, |answered| tick.saturating_sub(answered).clamp(1, MAX_DELAY as u64));
        self.outputs[age as usize]
    }

    /// Delay in whole samples, and the rest \[ns\].
    pub fn samples(&self, sample_ns: u64) -> (usize, f64) {
        let whole = libm::floor(self.age.mean_ns / sample_ns as f64).clamp(0.0, MAX_DELAY as f64);
        (whole as usize, (self.age.mean_ns - whole * sample_ns as f64).clamp(0.0, sample_ns as f64))
    }

    /// Outputs that act from the sample `tick` until the output for `tick` acts, each with its duration \[ns\]:
    /// `in_force` for the rest of a sample, and then one output for each whole sample.
    pub fn course(
        &self,
        in_force: DelayedOutput,
        tick: u64,
        sample_ns: u64,
    ) -> impl Iterator<Item = (DelayedOutput, f64)> {
        let (whole, rest_ns) = self.samples(sample_ns);
        let under_way = (1..=whole).rev().scan(in_force, move |acting, age| {
            *acting = self.next(*acting, tick, age);
            Some((*acting, sample_ns as f64))
        });
        std::iter::once((in_force, rest_ns)).chain(under_way)
    }

    /// Output that acts after `acting`: that for the sample `tick - age`, or `acting` if that one is not under way.
    fn next(&self, acting: DelayedOutput, tick: u64, age: usize) -> DelayedOutput {
        let of = tick.checked_sub(age as u64);
        let is_under_way = of.is_some() && OptionalTick::get(self.answered) < of;
        if is_under_way { self.outputs[age.min(MAX_DELAY)] } else { acting }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE_NS: u64 = 10_000_000;

    /// Delay after the states `(tick, sequence, age_ns)`, each with its tick as the output, and the last switch.
    fn after(states: &[(u64, u64, u64)]) -> (Delay, Switch) {
        let mut delay = Delay::new(Actuation::default());
        let (mut last, mut switch) = (None, Switch { before: Actuation::default(), after_ns: 0 });
        for &(tick, sequence, age_ns) in states {
            let mut state = State::default();
            state.stamp.tick = tick;
            (state.applied_sequence, state.applied_age_ns) = (sequence, age_ns);
            switch = delay.observe(&state, [0.0; 4], last.map(|last| tick - last), SAMPLE_NS);
            delay.outputs[0] = [tick as f64; 4];
            last = Some(tick);
        }
        (delay, switch)
    }

    /// First number of each output of the course from `tick` on, with the duration of the output \[ms\].
    fn course(delay: &Delay, tick: u64) -> Vec<(f64, f64)> {
        delay.course([-1.0; 4], tick, SAMPLE_NS).map(|(output, ns)| (output[0], ns / 1e6)).collect()
    }

    #[test]
    fn outputs_act_in_order_after_the_rest_of_a_sample() {
        let states: Vec<_> = (10..20).map(|tick| (tick, tick - 3, 25_000_000)).collect();
        let (delay, switch) = after(&states);
        assert_eq!(switch.after_ns, 5_000_000);
        assert_eq!(course(&delay, 19), [(-1.0, 5.0), (17.0, 10.0), (18.0, 10.0)]);
    }

    #[test]
    fn a_command_that_stays_in_force_answers_the_same_sample() {
        // From tick 11 on the command that answers sample 8 stays in force.
        let states: Vec<_> = (4..30).map(|tick: u64| (tick, tick.min(11), 25_000_000)).collect();
        for flown in 1..=states.len() {
            let (delay, _) = after(&states[..flown]);
            let tick = 3 + flown as u64;
            let of = match tick {
                ..7 => 0, // the output behind the command in force at the first sample
                7..=11 => tick - 3,
                _ => 8_u64.max(tick.saturating_sub(MAX_DELAY as u64)),
            };
            assert_eq!(delay.answered(tick), [of as f64; 4], "tick {tick}");
        }
    }

    #[test]
    fn before_the_first_command_the_last_output_is_in_force() {
        let (delay, _) = after(&[(4, 0, 0), (5, 0, 0), (6, 0, 0)]);
        assert_eq!(delay.answered(6), [5.0; 4]);
    }

    #[test]
    fn without_a_delay_nothing_is_under_way() {
        let (delay, _) = after(&[(10, 1, 0), (11, 2, 0)]);
        assert_eq!(course(&delay, 11), [(-1.0, 0.0)]);
    }

    #[test]
    fn a_process_without_a_memory_takes_the_command_in_force_for_those_before() {
        let mut delay = Delay::new(Actuation::default());
        let mut state = State { applied_sequence: 7, applied_age_ns: 25_000_000, ..State::default() };
        state.stamp.tick = 700;
        delay.observe(&state, [-1.0; 4], None, SAMPLE_NS);
        assert_eq!(course(&delay, 700), [(-1.0, 5.0), (-1.0, 10.0), (-1.0, 10.0)]);
    }

    #[test]
    fn outputs_are_remembered_over_a_gap_and_across_a_mixer_that_counts_anew() {
        let gap = [(10, 5, 32_000_000), (14, 6, 32_000_000)];
        let (delay, switch) = after(&gap);
        assert_eq!(switch.after_ns, 2_000_000);
        assert_eq!([0, 1, 3, 4, 5].map(|age| delay.outputs[age][0]), [14.0, 10.0, 10.0, 10.0, 0.0], "held in the gap");
        // The command in force answers sample 10, at 100 ms, and took effect at 132 ms.
        assert_eq!([4, 3, 1].map(|age| delay.next([0.0; 4], 14, age)[0]), [0.0, 10.0, 10.0]);
        let anew = [&gap[..], &[(15, 1, 2_000_000)]].concat();
        let (delay, _) = after(&anew);
        assert_eq!([2, 1, 0].map(|age| delay.next([0.0; 4], 15, age)[0]), [0.0, 0.0, 15.0], "it answers sample 14");
        let (delay, _) = after(&[&anew[..], &[(400, 1, 2_000_000)]].concat());
        assert_eq!(delay.outputs[MAX_DELAY], [15.0; 4]);
    }
}
