//! What the log of a flight has of its kills, and the holes in it.

use contract::Topic;
use contract::message::State;
use flight::log::Log;
use serde::Serialize;

use super::plan::{Moment, Victim};
use crate::killer::{first_message_ns, milliseconds};

/// One process killed.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Kill {
    pub victim: Victim,
    pub epoch: u32,
    pub moment: Moment,
    #[serde(skip)]
    pub at_ns: u64,
    /// Until the first message of the next epoch, or the first that it recorded \[ms\]; `None` when that was killed before, or
    /// the log ends before.
    pub successor_ms: Option<f64>,
    /// Whether the log has a hole where that message may have been.
    #[serde(skip)]
    pub unseen: bool,
    /// A recorder: time of the flight that it had not written to disk \[ms\]; `None` when the log does not show since when it
    /// recorded.
    pub lost_ms: Option<f64>,
}

impl Kill {
    /// Nothing is known yet of what followed.
    pub fn new(victim: Victim, epoch: u32, moment: Moment, at_ns: u64) -> Self {
        Self { victim, epoch, moment, at_ns, successor_ms: None, unseen: false, lost_ms: None }
    }

    /// Adds what the `log` with these `holes` shows; recorders were killed at `deaths_ns`.
    #[must_use]
    pub fn completed(self, log: &Log, holes: &[(u64, u64)], deaths_ns: &[u64]) -> Self {
        let ms = |from_ns: u64, to_ns: u64| milliseconds(to_ns.saturating_sub(from_ns));
        if self.victim != Victim::Recorder {
            let first_ns = first_message_ns(log, &self.victim.name(), self.epoch + 1);
            let by_ns = first_ns.unwrap_or(u64::MAX);
            let unseen = holes.iter().any(|(from_ns, to_ns)| *from_ns < by_ns && *to_ns > self.at_ns);
            let successor_ms = first_ns.filter(|_| !unseen).map(|first_ns| ms(self.at_ns, first_ns));
            return Self { successor_ms, unseen, ..self };
        }
        let after = log.states.partition_point(|state| sent_ns(state) <= self.at_ns);
        let (earlier, later) = deaths_ns.split_at(deaths_ns.partition_point(|at_ns| *at_ns < self.at_ns));
        let first_ns = log.states.get(after).map(sent_ns);
        let first_ns = first_ns.filter(|first_ns| later.iter().skip(1).all(|death_ns| death_ns > first_ns));
        // Before the death of its predecessor it had nothing to lose.
        let safe_ns = |from_ns: u64| Some(from_ns).filter(|from_ns| *from_ns > 0).max(earlier.last().copied());
        let hole = holes.iter().rfind(|hole| contains(hole, self.at_ns));
        let lost_ms = hole.map_or(Some(0.0), |(from_ns, _)| Some(ms(safe_ns(*from_ns)?, self.at_ns)));
        Self { successor_ms: first_ns.map(|first_ns| ms(self.at_ns, first_ns)), lost_ms, ..self }
    }
}

/// When a state was sent \[ns\].
pub fn sent_ns(state: &State) -> u64 {
    state.stamp.publish_ns[Topic::State as usize]
}

/// The times between which states of the flight that ended at `end_ns` are missing. A recorder that joins is sent the
/// newest message from before as well, so a hole reaches to the message after the one that ends it. The last one has no
/// end: a recorder that is killed while it closes the log has lost the same messages.
pub fn holes(log: &Log, end_ns: u64) -> Vec<(u64, u64)> {
    let of = |state: &State| (state.stamp.sequence, sent_ns(state));
    let mut known: Vec<(u64, u64)> = [(0, 0)].into_iter().chain(log.states.iter().map(of)).collect();
    let (last, last_ns) = known[known.len() - 1];
    known.extend((last_ns < end_ns).then_some((last + 2, u64::MAX)));
    let missing = known.windows(2).enumerate().filter(|(_, pair)| pair[1].0 != pair[0].0 + 1);
    missing.map(|(i, pair)| (pair[0].1, known.get(i + 2).unwrap_or(&pair[1]).1)).collect()
}

/// Whether `at_ns` lies in `hole`.
pub fn contains(hole: &(u64, u64), at_ns: u64) -> bool {
    (hole.0..=hole.1).contains(&at_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Reference, Stamp};

    /// The log with the states of these sequence numbers, number n sent at n times 10 ms.
    fn log(numbers: impl IntoIterator<Item = u64>) -> Log {
        let stamp = |sequence| Stamp { sequence, publish_ns: [sequence * 10_000_000, 0, 0, 0], ..Stamp::default() };
        let states = numbers.into_iter().map(|number| State { stamp: stamp(number), ..State::default() });
        Log { states: states.collect(), ..Log::default() }
    }

    fn killed(victim: Victim, at_ms: u64) -> Kill {
        Kill::new(victim, 1, Moment::Flying, at_ms * 1_000_000)
    }

    /// From when to when states are missing \[ms\] in a flight of 20 of them.
    fn holes_ms(log: &Log) -> Vec<(u64, u64)> {
        holes(log, 200_000_000).iter().map(|(from, to)| (from / 1_000_000, to / 1_000_000)).collect()
    }

    #[test]
    fn a_hole_is_found_wherever_it_is() {
        assert_eq!(holes_ms(&log(1..=20)), []);
        assert_eq!(holes_ms(&log((1..=5).chain(9..=20))), [(50, 100)], "message 9 may have been sent before");
        assert_eq!(holes_ms(&log(3..=20)), [(0, 40)]);
        assert_eq!(holes_ms(&log(1..=15)), [(150, u64::MAX / 1_000_000)]);
    }

    #[test]
    fn a_recorder_loses_what_it_had_not_written_to_disk() {
        let deaths_ns = [112_000_000, 151_000_000];
        let completed = |log: &Log, at_ms| {
            let kill = killed(Victim::Recorder, at_ms).completed(log, &holes(log, 200_000_000), &deaths_ns);
            (kill.lost_ms, kill.successor_ms)
        };
        let once = log((1..=5).chain(11..=20));
        assert_eq!(completed(&once, 112), (Some(62.0), Some(8.0)));
        assert_eq!(completed(&once, 151), (Some(0.0), Some(9.0)));
        let twice = log((1..=5).chain(16..=20));
        assert_eq!(completed(&twice, 112), (Some(62.0), None), "the next one had nothing when it was killed");
        assert_eq!(completed(&twice, 151), (Some(39.0), Some(9.0)));
        assert_eq!(completed(&log(16..=20), 112), (None, None), "the log does not show when it began");
    }

    #[test]
    fn a_successor_in_a_hole_is_not_seen() {
        let mut log = log((1..=5).chain(11..=20));
        let stamp = Stamp { epoch: 2, publish_ns: [0, 121_000_000, 0, 0], ..Stamp::default() };
        log.references = vec![Reference { stamp, ..Reference::default() }];
        let completed = |at_ms| {
            let kill = killed(Victim::Guidance, at_ms).completed(&log, &holes(&log, 200_000_000), &[]);
            (kill.unseen, kill.successor_ms)
        };
        assert_eq!(completed(60), (true, None));
        assert_eq!(completed(120), (false, Some(1.0)));
    }
}
