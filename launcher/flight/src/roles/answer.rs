//! One answer of a node to one sample, as far as two processes of that node can be compared.

use std::f64::consts::PI;

use airframe::envelope::Envelope;
use contract::Scenario;
use contract::message::Plausible;
use contract::scenario::Mode;
use contract::topic::{NODES, Topic};

use crate::log::Record;

/// Reference of w that counts as the largest \[m/s\], unless the limit is lower.
const W_MPS: f64 = 5.0;

pub const NUMBERS: usize = 4;

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
                [scenario.guidance.w_limit_mps.min(W_MPS), angle_rad, angle_rad, PI]
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
        self.shares.iter().zip(other.shares).map(|(mine, theirs)| (mine - theirs).abs()).fold(0.0, f64::max)
    }
}
