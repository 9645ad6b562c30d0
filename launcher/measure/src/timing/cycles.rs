//! One turn of the ring after another, put together from the stamps of its messages.
//!
//! ```text
//! age at the actuator   the command takes effect - the sample it descends from
//! sense to act          age - sum of the four nodes' executions (publish - start)
//! hop                   start - publication of the message it waited for
//! miss                  no ACTUATORS for the slot, or later than the period after its sample
//! ```

use contract::message::Stamp;
use contract::topic::{NODES, Topic};

use flight::log::Record;

/// Slots at the start of a run that are left out \[ns\]: caches are cold and pages still come in.
pub const WARM_UP_NS: u64 = 100_000_000;

const PLANT: usize = Topic::State as usize;
const MIXER: usize = Topic::Actuators as usize;

/// One slot of the plant's clock; what did not happen is 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cycle {
    /// The instant the sample stands for \[ns\].
    pub sample_ns: u64,
    /// When each node was due \[ns\].
    pub release_ns: [u64; NODES.len()],
    /// When each began \[ns\].
    pub start_ns: [u64; NODES.len()],
    /// When each sent \[ns\].
    pub publish_ns: [u64; NODES.len()],
    /// From the sample to the effect of the command \[ns\].
    pub age_ns: u64,
}

/// The slots of a run, gathered message by message.
#[derive(Debug)]
pub struct Cycles {
    period_ns: u64,
    slots: Vec<Cycle>,
    /// Slot of each ACTUATORS message, by sequence number.
    slot_of: Vec<usize>,
}

impl Cycles {
    /// None yet of `ticks` slots of `period_ns`.
    pub fn new(period_ns: u64, ticks: u64) -> Self {
        let n = ticks as usize + 1;
        Self { period_ns, slots: vec![Cycle::default(); n], slot_of: vec![usize::MAX; n + 1] }
    }

    /// Takes one message in.
    pub fn observe(&mut self, record: &Record) {
        let stamp = record.stamp();
        self.note(stamp, record.topic());
        if let Record::State(state) = record
            && let Some(slot) = self.slot_of.get(state.applied_sequence as usize)
            && let Some(cycle) = self.slots.get_mut(*slot)
        {
            cycle.age_ns = state.applied_age_ns;
        }
    }

    fn note(&mut self, stamp: &Stamp, topic: Topic) {
        let (slot, node) = (stamp.tick as usize, topic as usize);
        if let Some(cycle) = self.slots.get_mut(slot) {
            cycle.sample_ns = stamp.sample_ns;
            cycle.release_ns[node] = stamp.release_ns;
            cycle.start_ns[node] = stamp.start_ns;
            cycle.publish_ns[node] = stamp.publish_ns[node];
        }
        if topic == Topic::Actuators
            && let Some(of) = self.slot_of.get_mut(stamp.sequence as usize)
        {
            *of = slot;
        }
    }

    /// The slots that count: after the warm-up, without the last, whose command nobody waits for.
    pub fn counted(&self) -> &[Cycle] {
        let last = self.slots.iter().rposition(|cycle| cycle.sample_ns > 0).unwrap_or(0);
        &self.slots[self.warm_up().min(last)..last]
    }

    /// Ages at the actuator \[ns\].
    pub fn ages_ns(&self) -> Vec<u64> {
        self.applied().map(|cycle| cycle.age_ns).collect()
    }

    /// Times from sense to act, without what the nodes did \[ns\].
    pub fn sense_to_act_ns(&self) -> Vec<u64> {
        self.applied().map(|cycle| cycle.age_ns.saturating_sub(cycle.execution_ns())).collect()
    }

    /// From publication to start, for the three nodes that wait for a message \[ns\].
    pub fn hops_ns(&self) -> Vec<u64> {
        let hops = |cycle: &Cycle| [1, 2, 3].map(|node| cycle.start_ns[node].saturating_sub(cycle.release_ns[node]));
        self.applied().flat_map(hops).collect()
    }

    /// From the release to the plant's start \[ns\].
    pub fn jitters_ns(&self) -> Vec<u64> {
        self.applied().map(|cycle| cycle.start_ns[PLANT].saturating_sub(cycle.sample_ns)).collect()
    }

    /// Sum of the four nodes' executions \[ns\].
    pub fn executions_ns(&self) -> Vec<u64> {
        self.applied().map(Cycle::execution_ns).collect()
    }

    /// For each slot that counts, whether it was missed, and the time it covers if so \[ns\].
    pub fn misses(&self) -> Vec<Option<(u64, u64)>> {
        let Some((first, t0)) = self.slots.iter().enumerate().find(|(_, cycle)| cycle.sample_ns > 0) else {
            return vec![];
        };
        // A slot that was slept through has no message; where it lay follows from the clock.
        let lay_at = |slot: usize| t0.sample_ns + (slot - first) as u64 * self.period_ns;
        let missed = |(i, cycle): (usize, &Cycle)| {
            let sample_ns = lay_at(self.warm_up() + i);
            let in_time = cycle.publish_ns[MIXER] > 0 && cycle.publish_ns[MIXER] <= sample_ns + self.period_ns;
            (!in_time).then_some((sample_ns, sample_ns + self.period_ns))
        };
        self.counted().iter().enumerate().map(missed).collect()
    }

    fn warm_up(&self) -> usize {
        WARM_UP_NS.div_ceil(self.period_ns) as usize
    }

    fn applied(&self) -> impl Iterator<Item = &Cycle> {
        self.counted().iter().filter(|cycle| cycle.age_ns > 0)
    }
}

impl Cycle {
    fn execution_ns(&self) -> u64 {
        self.publish_ns
            .iter()
            .zip(self.start_ns)
            .map(|(publish_ns, start_ns)| publish_ns.saturating_sub(start_ns))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Actuators, Controls, Message, Reference, State};

    const PERIOD_NS: u64 = 50_000_000; // two slots of warm-up

    fn sent<M: Message + Into<Record>>(mut message: M, tick: u64, release_ns: u64) -> Record {
        let sample_ns = 1_000 + tick * PERIOD_NS;
        let stamp = Stamp { tick, sample_ns, release_ns, start_ns: release_ns + 10, ..Stamp::default() };
        *message.stamp_mut() = stamp.published(M::TOPIC, tick + 1, release_ns + 30);
        message.into()
    }

    /// Slot `tick`: every node begins 10 ns after its release and works 20 ns; the command of the slot before took
    /// effect `age_ns` after its sample.
    fn turn(cycles: &mut Cycles, tick: u64, late_ns: u64, age_ns: u64) {
        let at = 1_000 + tick * PERIOD_NS;
        let state = State { applied_sequence: tick, applied_age_ns: age_ns, ..State::default() };
        cycles.observe(&sent(state, tick, at));
        cycles.observe(&sent(Reference::default(), tick, at + 30));
        cycles.observe(&sent(Controls::default(), tick, at + 60));
        cycles.observe(&sent(Actuators::default(), tick, at + 90 + late_ns));
    }

    #[test]
    fn a_turn_is_put_together() {
        let mut cycles = Cycles::new(PERIOD_NS, 5);
        (0..5).for_each(|tick| turn(&mut cycles, tick, 0, 500 + tick));
        assert_eq!(cycles.counted().len(), 2, "without the warm-up and the last");
        assert_eq!(cycles.ages_ns(), [503, 504], "told by the slot after");
        assert_eq!(cycles.sense_to_act_ns(), [503 - 80, 504 - 80]);
        assert_eq!(cycles.hops_ns(), [10; 6]);
        assert_eq!(cycles.jitters_ns(), [10; 2]);
        assert_eq!(cycles.misses(), [None; 2]);
    }

    #[test]
    fn late_and_skipped_slots_are_misses() {
        let mut cycles = Cycles::new(PERIOD_NS, 6);
        for tick in [0, 1, 2, 3, 5, 6] {
            turn(&mut cycles, tick, if tick == 3 { PERIOD_NS } else { 0 }, 500);
        }
        let covers = |tick: u64| Some((1_000 + tick * PERIOD_NS, 1_000 + (tick + 1) * PERIOD_NS));
        assert_eq!(cycles.misses(), [None, covers(3), covers(4), None]);
    }
}
