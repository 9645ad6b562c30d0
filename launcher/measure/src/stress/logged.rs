//! Traces of the kills in the log of a flight, and the holes of the log.

use contract::Topic;
use contract::message::State;
use flight::event::{Event, What};
use flight::log::Log;
use serde::Serialize;

use super::plan::{Moment, Victim};
use crate::launched::{first_message_ns, milliseconds};

/// Kill of one process.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Kill {
    pub victim: Victim,
    pub epoch: u32,
    pub moment: Moment,
    #[serde(skip)]
    pub at_ns: u64,
    /// Time from the kill until the role was vacant \[ms\]; only for active processes killed at [`Moment::Flying`].
    pub noticed_ms: Option<f64>,
    /// Time from the kill to the first message of the next epoch \[ms\]; for a recorder, to the first sample after the
    /// next recorder took over. `None` if the successor was killed first, or if the log ends first.
    pub successor_ms: Option<f64>,
    /// `true` if a hole of the log may hide the successor's first message.
    #[serde(skip)]
    pub unseen: bool,
}

impl Kill {
    /// Makes a kill without a known successor.
    pub fn new(victim: Victim, epoch: u32, moment: Moment, at_ns: u64) -> Self {
        Self { victim, epoch, moment, at_ns, noticed_ms: None, successor_ms: None, unseen: false }
    }

    /// Adds the successor from the `log`, unless one of its `holes` may hide it.
    #[must_use]
    pub fn completed(self, log: &Log, holes: &[(u64, u64)]) -> Self {
        let first_ns = match self.victim {
            Victim::Recorder => taken_over_ns(log, self.epoch + 1),
            _ => first_message_ns(log, &self.victim.name(), self.epoch + 1),
        };
        let by_ns = first_ns.unwrap_or(u64::MAX);
        let unseen = holes.iter().any(|(from_ns, to_ns)| *from_ns < by_ns && *to_ns > self.at_ns);
        let successor_ms =
            first_ns.filter(|_| !unseen).map(|first_ns| milliseconds(first_ns.saturating_sub(self.at_ns)));
        Self { successor_ms, unseen, ..self }
    }
}

/// Returns the time of the first sample after the recorder `epoch` took over \[ns\].
fn taken_over_ns(log: &Log, epoch: u32) -> Option<u64> {
    let is_it = |event: &&Event| event.node == "recorder" && event.epoch == epoch && event.what == What::TookOver;
    let tick = log.events.iter().find(is_it)?.tick;
    log.states.iter().find(|state| state.stamp.tick >= tick).map(sent_ns)
}

/// Returns the time at which `state` was sent \[ns\].
pub fn sent_ns(state: &State) -> u64 {
    state.stamp.publish_ns[Topic::State as usize]
}

/// Returns the spans in which states are missing, in a flight that ended at `end_ns` \[ns\]. A recorder that joins also
/// gets the newest message sent before, which may be the first message after the gap, so a hole reaches to the second
/// message after the gap. A hole at the end of the log has no end, because a log that was cut lacks all later messages.
pub fn holes(log: &Log, end_ns: u64) -> Vec<(u64, u64)> {
    let of = |state: &State| (state.stamp.sequence, sent_ns(state));
    let mut known: Vec<(u64, u64)> = [(0, 0)].into_iter().chain(log.states.iter().map(of)).collect();
    let (last, last_ns) = known[known.len() - 1];
    known.extend((last_ns < end_ns).then_some((last + 2, u64::MAX)));
    let missing = known.windows(2).enumerate().filter(|(_, pair)| pair[1].0 != pair[0].0 + 1);
    missing.map(|(i, pair)| (pair[0].1, known.get(i + 2).unwrap_or(&pair[1]).1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Reference, Stamp};

    /// Makes a log of the states with the sequence numbers `numbers`; number n is sent at n times 10 ms.
    fn log(numbers: impl IntoIterator<Item = u64>) -> Log {
        let stamp = |sequence| Stamp { sequence, publish_ns: [sequence * 10_000_000, 0, 0, 0], ..Stamp::default() };
        let states = numbers.into_iter().map(|number| State { stamp: stamp(number), ..State::default() });
        Log { states: states.collect(), ..Log::default() }
    }

    fn killed(victim: Victim, at_ms: u64) -> Kill {
        Kill::new(victim, 1, Moment::Flying, at_ms * 1_000_000)
    }

    /// Spans in which states are missing \[ms\], in a flight of 20 states.
    fn holes_ms(log: &Log) -> Vec<(u64, u64)> {
        holes(log, 200_000_000).iter().map(|(from, to)| (from / 1_000_000, to / 1_000_000)).collect()
    }

    #[test]
    fn a_hole_is_found_at_the_start_in_the_middle_and_at_the_end() {
        assert_eq!(holes_ms(&log(1..=20)), []);
        assert_eq!(holes_ms(&log((1..=5).chain(9..=20))), [(50, 100)], "message 9 may have been sent before");
        assert_eq!(holes_ms(&log(3..=20)), [(0, 40)]);
        assert_eq!(holes_ms(&log(1..=15)), [(150, u64::MAX / 1_000_000)]);
    }

    #[test]
    fn a_recorder_is_back_with_the_first_sample_after_it_took_over() {
        let mut log = log(1..=20);
        log.states.iter_mut().for_each(|state| state.stamp.tick = state.stamp.sequence);
        log.events = vec![Event::new(14, "recorder", 2, What::Started), Event::new(15, "recorder", 2, What::TookOver)];
        let kill = killed(Victim::Recorder, 112);
        assert_eq!(kill.completed(&log, &[]).successor_ms, Some(38.0));
        assert_eq!(Kill { epoch: 2, ..kill }.completed(&log, &[]).successor_ms, None, "no successor");
    }

    #[test]
    fn a_successor_that_a_hole_may_hide_is_not_timed() {
        let mut log = log((1..=5).chain(11..=20));
        let stamp = Stamp { epoch: 2, publish_ns: [0, 121_000_000, 0, 0], ..Stamp::default() };
        log.references = vec![Reference { stamp, ..Reference::default() }];
        let completed = |at_ms| {
            let kill = killed(Victim::Guidance, at_ms).completed(&log, &holes(&log, 200_000_000));
            (kill.unseen, kill.successor_ms)
        };
        assert_eq!(completed(60), (true, None));
        assert_eq!(completed(120), (false, Some(1.0)));
    }
}
