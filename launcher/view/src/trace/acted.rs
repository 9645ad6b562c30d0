//! When each command took effect, from what later STATE messages say of it.

use std::collections::HashMap;

use contract::Topic;
use contract::message::Actuators;
use contract::scenario::Mode;

use flight::log::{Log, counted};

/// A command that was in force at a sample.
#[derive(Debug, Clone, Copy)]
pub struct Acted<'a> {
    /// The command.
    pub command: &'a Actuators,
    /// When it took effect \[ns\].
    pub from_ns: u64,
    /// When the next one did, or the log's last sample \[ns\].
    pub until_ns: u64,
    /// Its age then: the time since the sample it was computed from \[ns\].
    pub age_ns: u64,
}

/// Every command that was in force at a sample, in the order of taking effect.
///
/// In lockstep the age is simulated time, which the clock knows nothing of: there a command acts once it is published.
pub fn acted(log: &Log, mode: Mode) -> Vec<Acted<'_>> {
    let mut acted: Vec<Acted> = vec![];
    // A restarted mixer numbers its messages from 1 again: the newest of a number is meant.
    let mut sent = HashMap::new();
    let mut commands = counted(&log.actuators).map(|(command, _)| command).peekable();
    let mut in_force = 0;
    for (state, _) in counted(&log.states) {
        while let Some(command) = commands.next_if(|command| command.stamp.tick < state.stamp.tick) {
            sent.insert(command.stamp.sequence, command);
        }
        if state.applied_sequence == in_force {
            continue;
        }
        in_force = state.applied_sequence;
        let Some(&command) = sent.get(&in_force) else { continue };
        let stamp = &command.stamp;
        let age_ns = state.applied_age_ns;
        let from_ns = match mode {
            Mode::Realtime => stamp.sample_ns.saturating_add(age_ns),
            Mode::Lockstep | Mode::Inprocess => stamp.publish_ns[Topic::Actuators as usize],
        };
        if let Some(before) = acted.last_mut() {
            before.until_ns = from_ns;
        }
        let until_ns = log.states.last().map_or(from_ns, |last| last.stamp.sample_ns.max(from_ns));
        acted.push(Acted { command, from_ns, until_ns, age_ns });
    }
    acted
}
