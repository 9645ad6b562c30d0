//! The age at the actuator: how old the sample behind a command is when the command takes effect.
//!
//! Per command applied it is what the plant says. Per slot held it grows by a period for every slot without a new
//! command: a command that never came would otherwise leave no trace.

use contract::message::State;
use hdrhistogram::Histogram;

use super::node::LONGEST_STALL_SLOTS;
use crate::percentiles::histogram;

pub struct Age {
    /// One value for every command that took effect.
    pub per_command: Histogram<u64>,
    /// One value for every slot since the first command.
    pub per_slot: Histogram<u64>,
    holding: Holding,
}

impl Age {
    pub fn new(period_ns: u64) -> Self {
        Self { per_command: histogram(), per_slot: histogram(), holding: Holding::new(period_ns) }
    }

    pub fn observe(&mut self, state: &State) {
        if self.holding.is_new(state) {
            self.per_command.saturating_record(state.applied_age_ns);
        }
        self.holding.observe(state, |age_ns| self.per_slot.saturating_record(age_ns));
    }
}

/// The command in force, slot by slot; slot `k` lies between the samples `k` and `k + 1`.
#[derive(Debug, Clone)]
pub struct Holding {
    period_ns: u64,
    /// The newest sample seen, and the number of its message.
    newest: Option<(u64, u64)>,
    /// The command in force up to it; 0 is none.
    sequence: u64,
    age_ns: u64,
}

impl Holding {
    pub fn new(period_ns: u64) -> Self {
        Self { period_ns, newest: None, sequence: 0, age_ns: 0 }
    }

    /// Whether another command is in force at this sample than at the one before.
    pub fn is_new(&self, state: &State) -> bool {
        state.applied_sequence != self.sequence && state.applied_sequence > 0
    }

    /// Hands the age \[ns\] in each slot up to this sample to `each`, oldest first; a slot before the first command has
    /// none.
    ///
    /// After a stall of the plant the slot in which a command took effect follows from its age, as if it descended from
    /// the sample before the stall. One from an older sample took effect earlier than that: the age errs upwards. Slots
    /// whose samples were not seen have none.
    pub fn observe(&mut self, state: &State, mut each: impl FnMut(u64)) {
        let to = state.stamp.tick;
        let (newest, number) = self.newest.unwrap_or((to, state.stamp.sequence));
        let stalled = state.stamp.sequence.checked_sub(number) == Some(1);
        let from = newest.max(to.saturating_sub(if stalled { LONGEST_STALL_SLOTS } else { 1 }));
        self.age_ns = self.age_ns.saturating_add(from.saturating_sub(newest).saturating_mul(self.period_ns));
        let applied_in = if self.is_new(state) {
            from.saturating_add(state.applied_age_ns / self.period_ns).min(to.saturating_sub(1))
        } else {
            to
        };
        for slot in from..to {
            if slot == applied_in {
                self.sequence = state.applied_sequence;
                self.age_ns = state.applied_age_ns;
            } else {
                self.age_ns = self.age_ns.saturating_add(self.period_ns);
            }
            if self.sequence > 0 {
                each(self.age_ns);
            }
        }
        if self.newest.is_none() {
            (self.sequence, self.age_ns) = (state.applied_sequence, state.applied_age_ns);
        }
        self.newest = Some((to, state.stamp.sequence));
    }
}
