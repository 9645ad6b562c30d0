//! Samples of the plant: STATE, which the nodes receive, and TRUTH, which they do not, joined by tick.

use std::collections::VecDeque;

use contract::message::{Sample, State, Truth};
use runtime::limits::{HELD_MESSAGES, MAX_OBSERVER_DEPTH};

use crate::record::Record;

/// Largest number of messages that wait for the other message of their tick: more than the queues of an observer hold.
const MOST_WAITING: usize = 2 * MAX_OBSERVER_DEPTH;
/// Ticks after which a TRUTH is dropped: more than a fault can hold a STATE back.
const KEPT_TICKS: u64 = 2 * HELD_MESSAGES as u64;

/// Joins STATE and TRUTH, which may come in any order. If one of the two is lost, their tick has no sample.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    states: VecDeque<State>,
    truths: VecDeque<Truth>,
}

impl Samples {
    /// Adds a message; returns the sample that it completes, if any. The STATE of a tick may come only once.
    pub fn join(&mut self, record: &Record) -> Option<Sample> {
        let sample = match record {
            Record::State(state) => {
                let truth = self.truth(state.stamp.tick).copied();
                if truth.is_none() {
                    keep(&mut self.states, *state);
                }
                Sample { state: *state, truth: truth? }
            }
            Record::Truth(truth) => {
                keep(&mut self.truths, *truth);
                let at = self.states.iter().position(|state| state.stamp.tick == truth.tick)?;
                Sample { state: self.states.remove(at)?, truth: *truth }
            }
            _ => return None,
        };
        while self.truths.front().is_some_and(|first| first.tick.saturating_add(KEPT_TICKS) < sample.truth.tick) {
            self.truths.pop_front();
        }
        Some(sample)
    }

    /// Returns the TRUTH of `tick`, if it has come and was not dropped yet.
    pub fn truth(&self, tick: u64) -> Option<&Truth> {
        self.truths.iter().rev().find(|truth| truth.tick == tick)
    }
}

/// Adds `newest`, and drops the oldest if there are too many.
fn keep<T>(waiting: &mut VecDeque<T>, newest: T) {
    if waiting.len() == MOST_WAITING {
        waiting.pop_front();
    }
    waiting.push_back(newest);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(tick: u64) -> Record {
        let mut state = State::default();
        state.stamp.tick = tick;
        state.into()
    }

    fn truth(tick: u64) -> Record {
        Truth { tick, ..Truth::default() }.into()
    }

    /// Returns the ticks of the samples that `records` make.
    fn joined(records: &[Record]) -> Vec<u64> {
        let mut samples = Samples::default();
        let samples = records.iter().filter_map(|record| samples.join(record));
        samples.inspect(|sample| assert_eq!(sample.state.stamp.tick, sample.truth.tick)).map(|s| s.truth.tick).collect()
    }

    #[test]
    fn state_and_truth_of_a_tick_are_joined_in_any_order() {
        assert_eq!(joined(&[truth(0), state(0), state(1), truth(1)]), [0, 1]);
        assert_eq!(joined(&[truth(0), truth(1), truth(2), state(0), state(1), state(2)]), [0, 1, 2]);
        assert_eq!(joined(&[state(0), state(1), state(2), truth(0), truth(1), truth(2)]), [0, 1, 2]);
    }

    #[test]
    fn a_tick_of_which_one_is_lost_has_no_sample_and_holds_up_no_other() {
        assert_eq!(joined(&[truth(0), state(0), truth(1), truth(2), state(2)]), [0, 2], "STATE of tick 1 is lost");
        assert_eq!(joined(&[truth(0), state(0), state(1), truth(2), state(2)]), [0, 2], "TRUTH of tick 1 is lost");
    }

    #[test]
    fn unmatched_messages_take_bounded_memory() {
        let mut samples = Samples::default();
        for tick in 0..3 * MOST_WAITING as u64 {
            assert!(samples.join(&if tick.is_multiple_of(2) { state(tick) } else { truth(tick) }).is_none());
        }
        assert_eq!([samples.states.len(), samples.truths.len()], [MOST_WAITING; 2]);
        assert!(samples.join(&truth(3 * MOST_WAITING as u64 - 2)).is_some());
    }
}
