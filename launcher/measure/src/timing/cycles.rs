//! Cycles of the ring, put together from the stamps of their messages.
//!
//! ```text
//! age at the actuator   time the command takes effect - time of the sample it was computed from
//! sense to act          age - sum of the four nodes' executions (publish - start)
//! hop                   start - publication of the message that the node waited for
//! miss                  no ACTUATORS for the slot, or ACTUATORS more than a period after the slot's sample
//! ```

use contract::message::Stamp;
use contract::topic::{NODES, Topic};
use flight::log::Record;
use outcome::ticks::{Tick, Ticks};
use settings::Scenario;

/// Time at the start of a run that is left out \[ns\], because caches are cold and pages are still loaded.
pub const WARM_UP_NS: u64 = 100_000_000;

const MIXER: usize = Topic::Actuators as usize;

/// One slot of the plant's clock, with the stamps of its messages by topic; all 0 for an absent message.
type Slot = Tick<[Stamp; NODES.len()]>;

/// Slots of a run, collected message by message.
pub struct Cycles {
    period_ns: u64,
    slots: Ticks<[Stamp; NODES.len()]>,
}

impl Cycles {
    /// Prepares to collect the messages of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        Self { period_ns: scenario.sample_ns(), slots: Ticks::new(scenario) }
    }

    pub fn observe(&mut self, record: &Record) {
        if let Some((topic, stamp)) = record.stamped() {
            self.slots.observe(record, |of| of[topic as usize] = *stamp);
        }
    }

    /// Returns the slots that count, with or without messages: all after the warm-up except the last, whose command has
    /// no time to take effect.
    pub fn counted(&self) -> Vec<Slot> {
        let mut slots = vec![];
        self.slots.clone().tell(0, |slot| slots.push(*slot));
        slots.pop();
        slots.split_off((WARM_UP_NS.div_ceil(self.period_ns) as usize).min(slots.len()))
    }

    /// Returns the ages at the actuator \[ns\].
    pub fn ages_ns(&self) -> Vec<u64> {
        self.applied().filter_map(|slot| slot.age_ns).collect()
    }

    /// Returns the times from sense to act, without the executions of the nodes \[ns\].
    pub fn sense_to_act_ns(&self) -> Vec<u64> {
        self.applied().filter_map(|slot| Some(slot.age_ns?.saturating_sub(execution_ns(&slot)))).collect()
    }

    /// Returns the times from publication to start, for the three nodes that wait for a message \[ns\].
    pub fn hops_ns(&self) -> Vec<u64> {
        let hops = |slot: Slot| {
            Topic::OF_CONTROLLERS.map(|topic| {
                let stamp = &slot.of[topic as usize];
                stamp.start_ns.saturating_sub(stamp.release_ns)
            })
        };
        self.applied().flat_map(hops).collect()
    }

    /// Returns the sums of the four nodes' executions \[ns\].
    pub fn executions_ns(&self) -> Vec<u64> {
        self.applied().map(|slot| execution_ns(&slot)).collect()
    }

    /// Returns, for each slot that counts, the start and end of the slot if it was missed \[ns\], else `None`.
    pub fn misses(&self) -> Vec<Option<(u64, u64)>> {
        let Some(first) = self.slots.by_number.values().next() else { return vec![] };
        // A slot that the plant slept through has no message; its time follows from the plant's clock.
        let lay_at = |slot: &Slot| first.sample_ns + (slot.number - first.number) * self.period_ns;
        let missed = |slot: Slot| {
            let (sample_ns, publish_ns) = (lay_at(&slot), slot.of[MIXER].publish_ns[MIXER]);
            let in_time = publish_ns > 0 && publish_ns <= sample_ns + self.period_ns;
            (!in_time).then_some((sample_ns, sample_ns + self.period_ns))
        };
        self.counted().into_iter().map(missed).collect()
    }

    fn applied(&self) -> impl Iterator<Item = Slot> {
        self.counted().into_iter().filter(|slot| slot.age_ns.is_some())
    }
}

fn execution_ns(slot: &Slot) -> u64 {
    let executions = slot.of.iter().enumerate();
    executions.map(|(node, stamp)| stamp.publish_ns[node].saturating_sub(stamp.start_ns)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Actuators, Controls, Message, Reference, State};

    const PERIOD_NS: u64 = 50_000_000; // the warm-up takes two slots

    fn cycles(ticks: u64) -> Cycles {
        let mut scenario = Scenario::default();
        scenario.run.rate_hz = 20;
        scenario.run.duration_s = ticks as f64 / 20.0;
        Cycles::new(&scenario)
    }

    fn sent<M: Message + Into<Record>>(mut message: M, tick: u64, release_ns: u64) -> Record {
        let sample_ns = 1_000 + tick * PERIOD_NS;
        let stamp = Stamp { tick, sample_ns, release_ns, start_ns: release_ns + 10, ..Stamp::default() };
        *message.stamp_mut() = stamp.published(M::TOPIC, tick + 1, release_ns + 30);
        message.into()
    }

    /// Makes the messages of slot `tick`: every node begins 10 ns after its release and works 20 ns, and the mixer is
    /// released `late_ns` late. The command of the previous slot took effect `age_ns` after that slot's sample.
    fn turn(cycles: &mut Cycles, tick: u64, late_ns: u64, age_ns: u64) {
        let at = 1_000 + tick * PERIOD_NS;
        let state = State { applied_sequence: tick, applied_age_ns: age_ns, ..State::default() };
        cycles.observe(&sent(state, tick, at));
        cycles.observe(&sent(Reference::default(), tick, at + 30));
        cycles.observe(&sent(Controls::default(), tick, at + 60));
        cycles.observe(&sent(Actuators::default(), tick, at + 90 + late_ns));
    }

    #[test]
    fn the_times_of_a_cycle_follow_from_its_stamps() {
        let mut cycles = cycles(5);
        (0..5).for_each(|tick| turn(&mut cycles, tick, 0, 500 + tick));
        assert_eq!(cycles.counted().len(), 2, "without the warm-up and the last");
        assert_eq!(cycles.ages_ns(), [503, 504], "told by the slot after");
        assert_eq!(cycles.sense_to_act_ns(), [503 - 80, 504 - 80]);
        assert_eq!(cycles.hops_ns(), [10; 6]);
        assert_eq!(cycles.misses(), [None; 2]);
    }

    #[test]
    fn late_and_skipped_slots_are_misses() {
        let mut cycles = cycles(6);
        for tick in [0, 1, 2, 3, 5, 6] {
            turn(&mut cycles, tick, if tick == 3 { PERIOD_NS } else { 0 }, 500);
        }
        let covers = |tick: u64| Some((1_000 + tick * PERIOD_NS, 1_000 + (tick + 1) * PERIOD_NS));
        assert_eq!(cycles.misses(), [None, covers(3), covers(4), None]);
    }
}
