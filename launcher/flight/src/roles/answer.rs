//! One answer of a node to one sample, as far as two processes of that node can be compared.
//!
//! The similarity of two processes is how alike their answers have been of late, number by number.
//!
//! A number's similarity is the cosine of the angle between its last values from the one and from the other, with values
//! forgotten by and by: 1 when they are the same up to a factor, 0 when they have nothing in common, -1 when one is the
//! opposite of the other. It tells a wrong sign while the values are still small, on standby.

use std::f64::consts::PI;

use airframe::angle;
use airframe::envelope::Envelope;
use contract::Scenario;
use contract::message::Message as _;
use contract::scenario::Mode;
use contract::topic::{NODES, Topic};

use crate::log::Record;

/// Reference of w that counts as the largest \[m/s\], unless the limit is lower.
const W_MPS: f64 = 5.0;

const NUMBERS: usize = 4;
/// Where the heading stands among the numbers of a reference.
const HEADING: usize = 3;
/// What a heading is a share of \[rad\].
const HEADING_RAD: f64 = PI;

#[derive(Debug, Clone, Copy, Default)]
pub struct Answer {
    pub tick: u64,
    pub epoch: u64,
    /// From the sample to the answer \[ns\].
    pub response_ns: u64,
    /// Whether it is whole, and its numbers can be true.
    pub usable: bool,
    /// Its numbers, each as a share of what is commonly the largest.
    pub shares: [f64; NUMBERS],
    /// Whether the last of them is a heading, which comes round.
    pub has_heading: bool,
}

/// What makes answers of one node comparable.
#[derive(Debug, Clone)]
pub struct Scale {
    /// The topic that the answers are on.
    pub topic: Topic,
    /// When its answer is due after the sample \[ns\].
    pub due_ns: u64,
    /// The largest common value of each number.
    largest: [f64; NUMBERS],
    /// Against the clock a response is what it took; otherwise how long faults held it up.
    pub clocked: bool,
}

impl Scale {
    /// For the publisher of `topic` in a run of `scenario`.
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

    /// The answer that `record` is; `None` for one of another node.
    pub fn read(&self, record: &Record) -> Option<Answer> {
        if record.topic() != self.topic {
            return None;
        }
        let stamp = record.stamp();
        let publish_ns = stamp.publish_ns[self.topic as usize];
        let response_ns = if self.clocked { publish_ns.saturating_sub(stamp.sample_ns) } else { stamp.held_ns };
        let (numbers, plausible) = match record {
            Record::State(_) => return None,
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
    /// Whether it can be used, and is not later than `due_ns` after the sample.
    pub fn is_good(&self, due_ns: u64) -> bool {
        self.usable && self.response_ns <= due_ns
    }

    /// How far another answer to the same sample is away: the largest difference of a number, as a share.
    pub fn difference(&self, other: &Self) -> f64 {
        self.shares_beside(other)
            .iter()
            .zip(other.shares)
            .map(|(mine, theirs)| (mine - theirs).abs())
            .fold(0.0, f64::max)
    }

    /// Its shares, the heading by whole turns as near to that of `other` as it gets.
    fn shares_beside(&self, other: &Self) -> [f64; NUMBERS] {
        let mut shares = self.shares;
        if self.has_heading {
            let [mine_rad, theirs_rad] = [self, other].map(|answer| answer.shares[HEADING] * HEADING_RAD);
            shares[HEADING] = angle::nearest(mine_rad, theirs_rad) / HEADING_RAD;
        }
        shares
    }
}

/// Share of what is remembered that stays from one answer to the next: about twenty answers count.
const STAYS: f64 = 0.95;
/// Answers before which nothing can be said.
const FEW: u32 = 10;
/// Root mean square below which a number says nothing, as a share of what is commonly its largest value: two laws that are
/// both good may differ in sign for a while where next to nothing is demanded.
const SILENCE: f64 = 0.02;

/// Two processes that answer to the same samples.
#[derive(Debug, Clone, Copy, Default)]
pub struct Similarity {
    answers: u32,
    weight: f64,
    mine: [f64; NUMBERS],
    theirs: [f64; NUMBERS],
    both: [f64; NUMBERS],
}

impl Similarity {
    /// Takes their answers to one sample in.
    pub fn note(&mut self, mine: &Answer, theirs: &Answer) {
        self.answers = self.answers.saturating_add(1);
        self.weight = STAYS * self.weight + 1.0;
        for (i, (m, t)) in mine.shares_beside(theirs).into_iter().zip(theirs.shares).enumerate() {
            self.mine[i] = STAYS * self.mine[i] + m * m;
            self.theirs[i] = STAYS * self.theirs[i] + t * t;
            self.both[i] = STAYS * self.both[i] + m * t;
        }
    }

    /// The similarity of the number that has the least of it; 1 when nothing can be said.
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

    /// The similarity after so many answers, of which the candidate makes `mine` of the old one's.
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
    fn the_opposite_is_told_while_it_is_small() {
        let swing = |t: f64| 0.04 * (0.3 * t).sin();
        assert!((similarity(30, swing, |x| -x) + 1.0).abs() < 1e-12);
        assert!((similarity(30, swing, |x| 3.0 * x) - 1.0).abs() < 1e-12, "a factor is no opposition");
        assert!((similarity(30, |_| 0.03, |x| -x) + 1.0).abs() < 1e-12, "of what stands still too");
    }

    #[test]
    fn two_headings_on_both_sides_of_the_turn_are_alike() {
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
    fn what_is_unlike_without_being_opposite_is_let_be() {
        let noise = |t: f64| 0.1 * (12.9898 * t).sin();
        assert!(similarity(200, noise, |x| (7e4 * x).sin()) > -0.5);
    }

    #[test]
    fn of_little_nothing_is_said() {
        assert_eq!(similarity(FEW - 1, |_| 0.1, |x| -x), 1.0, "few answers");
        assert_eq!(similarity(100, |_| 0.019, |x| -x), 1.0, "next to nothing");
        assert_eq!(similarity(100, |_| 0.1, |_| 0.0), 1.0, "one of them says nothing");
    }

    #[test]
    fn what_was_long_ago_is_forgotten() {
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
