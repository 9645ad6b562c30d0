//! The age at the actuator: how old the sample behind a command is when the command takes effect.
//!
//! For each command applied, the plant reports the age. For each slot held, the age grows by a period for every
//! slot without a new command; without this count, a command that never came would leave no trace. Slot `k` lies
//! between the samples `k` and `k + 1`.

use contract::message::State;
use hdrhistogram::Histogram;

use super::node::LONGEST_STALL_SLOTS;
use crate::percentiles::histogram;

pub struct Age {
    /// One value for every command that took effect.
    pub per_command: Histogram<u64>,
    /// One value for every slot since the first command.
    pub per_slot: Histogram<u64>,
    period_ns: u64,
    /// Tick of the newest sample seen, and the sequence number of its message.
    newest: Option<(u64, u64)>,
    /// Sequence number of the command in force up to that sample, 0 for none, and its age then \[ns\].
    in_force: (u64, u64),
}

impl Age {
    pub fn new(period_ns: u64) -> Self {
        Self { per_command: histogram(), per_slot: histogram(), period_ns, newest: None, in_force: (0, 0) }
    }

    /// Takes in a sample; returns the age \[ns\] in each slot up to it, oldest first, except for slots before any
    /// command.
    ///
    /// After a stall of the plant, the slot in which a command took effect is computed from the command's age, as if
    /// the command came from the sample before the stall. A command from an older sample took effect earlier, so the
    /// ages are then too large. Slots whose samples were not seen have no age.
    pub fn observe(&mut self, state: &State) -> Vec<u64> {
        let applied = (state.applied_sequence, state.applied_age_ns);
        let is_new = applied.0 != self.in_force.0 && applied.0 > 0;
        if is_new {
            self.per_command.saturating_record(applied.1);
        }
        let to = state.stamp.tick;
        let (newest, number) = self.newest.unwrap_or((to, state.stamp.sequence));
        let stalled = state.stamp.sequence.checked_sub(number) == Some(1);
        let from = newest.max(to.saturating_sub(if stalled { LONGEST_STALL_SLOTS } else { 1 }));
        let (mut sequence, mut age_ns) = self.in_force;
        age_ns = age_ns.saturating_add(from.saturating_sub(newest).saturating_mul(self.period_ns));
        let applied_in = from.saturating_add(applied.1 / self.period_ns).min(to.saturating_sub(1));
        let mut ages_ns = vec![];
        for slot in from..to {
            (sequence, age_ns) =
                if is_new && slot == applied_in { applied } else { (sequence, age_ns.saturating_add(self.period_ns)) };
            if sequence > 0 {
                self.per_slot.saturating_record(age_ns);
                ages_ns.push(age_ns);
            }
        }
        self.in_force = if self.newest.is_none() { applied } else { (sequence, age_ns) };
        self.newest = Some((to, state.stamp.sequence));
        ages_ns
    }
}
