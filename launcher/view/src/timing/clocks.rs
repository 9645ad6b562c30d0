//! Whether all processes read the same time. Where stamps contradict the order of things below, one process reads another
//! time than the rest, and figures across the two mean nothing.
//!
//! ```text
//! sample <= publish of the plant <= publish of guidance <= publish of attitude-mpc <= publish of the mixer
//! publish of the mixer <= arrival of the command at the plant, which is in the age that the plant tells
//! ```
//!
//! A clock that is off by less than a hop does not show. The wrong clock may also be that of a node before the one whose
//! message contradicts.

use contract::Topic;
use contract::message::Stamp;
use contract::scenario::Mode;

use flight::log::Record;

/// The order of things, watched message by message.
pub struct Clocks {
    /// Only in real time does the plant tell a measured age.
    realtime: bool,
    /// The newest command: tick, number, response \[ns\].
    command: (u64, u64, u64),
    /// Contradictions by the topic that shows them.
    pub contradictions: [u64; Topic::COUNT],
}

impl Clocks {
    pub fn new(mode: Mode) -> Self {
        Self { realtime: mode == Mode::Realtime, command: (0, 0, 0), contradictions: [0; Topic::COUNT] }
    }

    pub fn observe(&mut self, record: &Record) {
        let (own, stamp) = (record.topic() as usize, record.stamp());
        self.contradictions[own] += u64::from(!possible(record.topic(), stamp));
        match record {
            Record::Actuators(_) => {
                let response_ns = stamp.publish_ns[own].saturating_sub(stamp.sample_ns);
                self.command = (stamp.tick, stamp.sequence, response_ns);
            }
            Record::State(state) if self.realtime && state.applied_sequence > 0 => {
                let (tick, sequence, response_ns) = self.command;
                let answers = stamp.tick == tick + 1 && state.applied_sequence == sequence;
                if answers && state.applied_age_ns < response_ns {
                    self.contradictions[Topic::Actuators as usize] += 1;
                }
            }
            _ => {}
        }
    }

    /// For people: one line for each node whose messages contradict, none when the clocks agree.
    pub fn describe(&self) -> Vec<String> {
        let counted = Topic::ALL.iter().zip(self.contradictions).filter(|(_, count)| *count > 0);
        let tell = |(topic, count): (&Topic, u64)| {
            let node = topic.publisher();
            format!(
                "{count} messages of {node} contradict the times of others: times across processes are not to be trusted"
            )
        };
        counted.map(tell).collect()
    }
}

/// Whether a message of `topic` was sent after its sample, and after what it was made from.
pub fn possible(topic: Topic, stamp: &Stamp) -> bool {
    let (own, before) = (stamp.publish_ns[topic as usize], &stamp.publish_ns[..topic as usize]);
    own >= stamp.sample_ns && before.iter().all(|input| own >= *input)
}
