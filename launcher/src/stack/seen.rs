//! What the launcher has seen of the messages: a flight that it did not see whole has no figures that could be trusted.

use contract::Topic;
use contract::realtime::Board;
use contract::scenario::{Late, Mode, Scenario};

use crate::log::{Count, Record};

/// The messages of one flight, as far as they were seen.
#[derive(Default)]
pub struct Seen {
    count: Count,
    /// Those that are missing between others, by their numbers.
    missed: u64,
    /// Ticks of each topic up to the newest that was seen, counted from the first of the run.
    ticks: [u32; Topic::COUNT],
}

impl Seen {
    /// Takes one message in.
    pub fn observe(&mut self, record: &Record) {
        let Some(gap) = self.count.gap(record) else { return };
        self.missed = self.missed.saturating_add(gap);
        let ticks = &mut self.ticks[record.topic() as usize];
        *ticks = (*ticks).max(record.stamp().tick as u32 + 1);
    }

    /// What is missing of a flight of `scenario` that has ended, whose nodes have told the `board` how far they came.
    pub fn missing(&self, scenario: &Scenario, board: &Board) -> Option<String> {
        if self.missed > 0 {
            return Some(format!("{} messages were sent that the launcher did not see", self.missed));
        }
        let unseen = |topic: &Topic| {
            let office = board.office(*topic);
            let holder = office.holder();
            let some_are = holder > 0 && self.ticks[*topic as usize] < office.done(holder).get();
            some_are && sends_every_tick(scenario, *topic)
        };
        let topic = Topic::ALL.into_iter().find(unseen)?;
        Some(format!("the launcher did not see the last messages on topic '{}'", topic.name()))
    }
}

/// Whether the publisher of `topic` sends something for every tick that it says it has done.
fn sends_every_tick(scenario: &Scenario, topic: Topic) -> bool {
    // Against the clock a node may not send what is late, and those behind the plant are still at work when it leaves.
    let clocked = scenario.run.mode == Mode::Realtime;
    !clocked || topic == Topic::State && scenario.deadline_of(0).late != Late::Skip
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Message, Stamp, State};
    use contract::office::Staff;

    fn state(sequence: u64, tick: u64) -> Record {
        let stamp = Stamp { epoch: 1, sequence, tick, ..Stamp::default() };
        State { stamp, ..State::default() }.sealed().into()
    }

    /// What is missing of a flight in which the plant has sampled `sampled` ticks, and these states were seen.
    fn missing(sampled: u32, states: &[(u64, u64)]) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let board = Board::create(&folder.path().join("board")).unwrap();
        board.office(Topic::State).appoint(0, |_| Staff { holder: 1, shadow: 0 });
        board.office(Topic::State).done(1).set(sampled);
        let mut seen = Seen::default();
        for (sequence, tick) in states {
            seen.observe(&state(*sequence, *tick));
        }
        seen.missing(&Scenario::default(), &board)
    }

    #[test]
    fn nothing_is_missing_when_the_last_sample_was_seen_and_no_number_is_left_out() {
        assert_eq!(missing(3, &[(1, 0), (2, 1), (3, 2)]), None);
        assert_eq!(missing(9, &[(1, 0), (2, 8)]), None, "the plant has slipped");
        assert_eq!(missing(0, &[]), None, "nothing was flown");
    }

    #[test]
    fn what_was_not_seen_is_missed_wherever_it_was() {
        assert!(missing(3, &[]).unwrap().contains("the last messages on topic 'state'"));
        assert!(missing(3, &[(1, 0), (2, 1)]).unwrap().contains("the last messages"));
        assert!(missing(4, &[(1, 0), (4, 3)]).unwrap().contains("2 messages"));
        assert!(missing(2, &[(2, 1)]).unwrap().contains("1 messages"));
    }
}
