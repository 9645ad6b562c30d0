//! Comparison of the answers that two processes of a node give to the same samples.
//!
//! The similarity of two processes is that of the least similar number in their latest answers.
//!
//! The similarity of a number is the cosine of the angle between its last values from the one process and from the
//! other, where older values weigh less: 1 if they are the same up to a factor, 0 if they have nothing in common, -1 if
//! one is the opposite of the other. The cosine shows a wrong sign while the values are still small, on standby.

use std::f64::consts::PI;

use airframe::angle;
use airframe::envelope::Envelope;
use contract::message::Content as _;
use contract::topic::{NODES, Topic};
use settings::{Mode, Scenario};

use crate::record::Record;

/// Largest usual reference of w \[m/s\], unless the limit of the settings is lower.
const W_MPS: f64 = 5.0;

const NUMBERS: usize = 4;
/// Index of the heading among the numbers of a reference.
const HEADING: usize = 3;
/// Largest heading \[rad\].
const HEADING_RAD: f64 = PI;

#[derive(Debug, Clone, Copy, Default)]
pub struct Answer {
    pub tick: u64,
    pub epoch: u64,
    /// Time from the sample to the answer \[ns\]; see [`Scale::clocked`].
    pub response_ns: u64,
    /// `true` if the checksum of the answer fits and its numbers are plausible.
    pub usable: bool,
    /// Numbers of the answer, each as a share of its largest usual value.
    pub shares: [f64; NUMBERS],
    /// `true` if the last number is a heading, which wraps round.
    pub has_heading: bool,
}

/// Scale on which the answers of one node are compared.
#[derive(Debug, Clone)]
pub struct Scale {
    /// Topic of the answers.
    pub topic: Topic,
    /// Deadline of an answer after its sample \[ns\].
    pub due_ns: u64,
    /// Largest usual value of each number.
    largest: [f64; NUMBERS],
    /// `true` in real time: a response is the time since the sample. Otherwise it is the delay that faults added.
    pub clocked: bool,
}

impl Scale {
    /// Creates the scale of the publisher of `topic` in a run of `scenario`.
    pub fn new(scenario: &Scenario, topic: Topic) -> Self {
        let largest = match topic {
            Topic::State => [f64::INFINITY; NUMBERS], // plants are not compared
            Topic::Reference => {
                let angle_rad = scenario.guidance.angle_limit_deg.to_radians();
                [
                    scenario.guidance.climb_limit_mps.min(scenario.guidance.w_limit_mps).min(W_MPS),
                    angle_rad,
                    angle_rad,
                    HEADING_RAD,
                ]
            }
            Topic::Controls => {
                let envelope = Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits());
                let (low, high) = envelope.bounding_box();
                std::array::from_fn(|i| low[i].abs().max(high[i].abs()))
            }
            Topic::Actuators => {
                let limits = scenario.limits();
                let [o1, o2, o3] = limits.rotor_speed_max;
                [o1, o2, o3, limits.tilt_max_rad]
            }
        };
        let rank = NODES.iter().position(|node| *node == topic.publisher()).unwrap_or(0);
        let clocked = scenario.run.mode == Mode::Realtime;
        Self { topic, due_ns: scenario.deadline_of(rank).deadline_ns, largest, clocked }
    }

    /// Reads `record` as an answer; `None` for STATE and TRUTH, and for a message on another topic.
    pub fn read(&self, record: &Record) -> Option<Answer> {
        let (_, stamp) = record.stamped().filter(|(topic, _)| *topic == self.topic)?;
        let publish_ns = stamp.publish_ns[self.topic as usize];
        let response_ns = if self.clocked { publish_ns.saturating_sub(stamp.sample_ns) } else { stamp.held_ns };
        let (numbers, plausible) = match record {
            Record::State(_) | Record::Truth(_) => return None,
            Record::Reference(message) => {
                let [phi, theta, psi] = message.attitude_rad;
                ([message.w_mps, phi, theta, psi], message.plausible())
            }
            Record::Controls(message) => (message.demand, message.plausible()),
            Record::Actuators(message) => {
                let [o1, o2, o3] = message.command.rotor_speed;
                ([o1, o2, o3, message.command.tilt_rad], message.plausible())
            }
        };
        Some(Answer {
            tick: stamp.tick,
            epoch: stamp.epoch,
            response_ns,
            usable: plausible && record.is_intact(),
            shares: std::array::from_fn(|i| numbers[i] / self.largest[i]),
            has_heading: self.topic == Topic::Reference,
        })
    }
}

impl Answer {
    /// Returns whether the answer is usable and not later than `due_ns` after the sample.
    pub fn is_good(&self, due_ns: u64) -> bool {
        self.usable && self.response_ns <= due_ns
    }

    /// Returns the largest difference between a number of this answer and of another to the same sample, as a share.
    pub fn difference(&self, other: &Self) -> f64 {
        self.shares_beside(other)
            .iter()
            .zip(other.shares)
            .map(|(mine, theirs)| (mine - theirs).abs())
            .fold(0.0, f64::max)
    }

    /// Returns the shares, with the heading moved by whole turns as near to that of `other` as possible.
    fn shares_beside(&self, other: &Self) -> [f64; NUMBERS] {
        let mut shares = self.shares;
        if self.has_heading {
            let [mine_rad, theirs_rad] = [self, other].map(|answer| answer.shares[HEADING] * HEADING_RAD);
            shares[HEADING] = angle::nearest(mine_rad, theirs_rad) / HEADING_RAD;
        }
        shares
    }
}

/// Factor by which older answers lose weight with each new one: about twenty answers count.
const STAYS: f64 = 0.95;
/// Number of answers below which no similarity is computed.
const FEW: u32 = 10;
/// Root mean square below which a number is left out, as a share of its largest usual value: two good laws may differ
/// in sign for a while if next to nothing is demanded.
const SILENCE: f64 = 0.02;

/// Similarity of two processes that answer to the same samples.
#[derive(Debug, Clone, Copy, Default)]
pub struct Similarity {
    answers: u32,
    weight: f64,
    mine: [f64; NUMBERS],
    theirs: [f64; NUMBERS],
    both: [f64; NUMBERS],
}

impl Similarity {
    /// Adds the answers of both processes to one sample.
    pub fn note(&mut self, mine: &Answer, theirs: &Answer) {
        self.answers = self.answers.saturating_add(1);
        self.weight = STAYS * self.weight + 1.0;
        for (i, (m, t)) in mine.shares_beside(theirs).into_iter().zip(theirs.shares).enumerate() {
            self.mine[i] = STAYS * self.mine[i] + m * m;
            self.theirs[i] = STAYS * self.theirs[i] + t * t;
            self.both[i] = STAYS * self.both[i] + m * t;
        }
    }

    /// Returns the similarity of the least similar number; 1 if there are too few answers or all numbers are too small.
    pub fn least(&self) -> f64 {
        if self.answers < FEW {
            return 1.0;
        }
        let floor = SILENCE * SILENCE * self.weight;
        let says = |i: &usize| self.mine[*i] > floor && self.theirs[*i] > floor;
        let of = |i: usize| self.both[i] / (self.mine[i] * self.theirs[i]).sqrt();
        (0..NUMBERS).filter(says).map(of).fold(1.0, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the similarity after `answers` answers: the old process answers `theirs`, the candidate `mine(theirs)`.
    fn similarity(answers: u32, theirs: impl Fn(f64) -> f64, mine: impl Fn(f64) -> f64) -> f64 {
        let mut similarity = Similarity::default();
        for i in 0..answers {
            let value = theirs(f64::from(i));
            let answer = |share: f64| Answer { shares: [0.3, share, 0.0, 0.0], ..Answer::default() };
            similarity.note(&answer(mine(value)), &answer(value));
        }
        similarity.least()
    }

    #[test]
    fn opposite_answers_are_found_while_they_are_small() {
        let swing = |t: f64| 0.04 * (0.3 * t).sin();
        assert!((similarity(30, swing, |x| -x) + 1.0).abs() < 1e-12);
        assert!((similarity(30, swing, |x| 3.0 * x) - 1.0).abs() < 1e-12, "a factor is no opposition");
        assert!((similarity(30, |_| 0.03, |x| -x) + 1.0).abs() < 1e-12, "of what stands still too");
    }

    #[test]
    fn two_headings_on_both_sides_of_180_degrees_are_alike() {
        let heading =
            |deg: f64| Answer { shares: [0.0, 0.0, 0.0, deg / 180.0], has_heading: true, ..Answer::default() };
        assert!((heading(179.0).difference(&heading(-179.0)) - 2.0 / 180.0).abs() < 1e-12);
        let mut similarity = Similarity::default();
        (0..30).for_each(|_| similarity.note(&heading(179.0), &heading(-179.0)));
        assert!(similarity.least() > 0.999, "{}", similarity.least());
        let number = Answer { has_heading: false, ..heading(179.0) };
        assert!(number.difference(&heading(-179.0)) > 1.9, "other numbers do not come round");
    }

    #[test]
    fn answers_with_nothing_in_common_are_not_opposite() {
        let noise = |t: f64| 0.1 * (12.9898 * t).sin();
        assert!(similarity(200, noise, |x| (7e4 * x).sin()) > -0.5);
    }

    #[test]
    fn few_answers_and_small_values_count_as_alike() {
        assert_eq!(similarity(FEW - 1, |_| 0.1, |x| -x), 1.0, "few answers");
        assert_eq!(similarity(100, |_| 0.019, |x| -x), 1.0, "next to nothing");
        assert_eq!(similarity(100, |_| 0.1, |_| 0.0), 1.0, "one of them says nothing");
    }

    #[test]
    fn old_answers_are_forgotten() {
        let mut changed = 0;
        for turned in 1..40 {
            let mine = |t: f64| if t < 100.0 { 0.1 } else { -0.1 };
            let mut similarity = Similarity::default();
            for i in 0..100 + turned {
                let answer = |share: f64| Answer { shares: [share, 0.0, 0.0, 0.0], ..Answer::default() };
                similarity.note(&answer(mine(f64::from(i))), &answer(0.1));
            }
            if similarity.least() < -0.5 {
                changed = turned;
                break;
            }
        }
        assert!((20..30).contains(&changed), "told after {changed} answers");
    }
}
