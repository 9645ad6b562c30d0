//! The trial of a newcomer: in the shadow, in office, and what becomes of it.
//!
//! ```text
//! in the shadow --hand over--> in office --> kept
//!       \--> rejected              \--> returned: the old one has the office back
//! ```
//!
//! A tick counts against the newcomer when its answer is missing, not usable, late, too far from the old one's, or the
//! opposite of it ([`super::accord`]): both answer to the same inputs, whoever of them is heard. Nobody takes or keeps the
//! office on a tick that counts against it. In office the vehicle itself is watched too. All of it is judged
//! from messages alone, so that a trial ends the same way whoever turns the ring.

use std::collections::VecDeque;

use contract::Scenario;
use contract::message::State;
use contract::scenario::{Swap, SwapBounds, SwapTicks};
use contract::topic::Topic;
use guidance::Trajectory;

use super::accord::Accord;
use super::answer::{Answer, Scale};
use crate::log::Record;

/// Answers that are remembered until they are judged: against the clock the launcher may look late.
const REMEMBERED: usize = 512;

/// A newcomer under trial.
pub struct Trial {
    /// Who it is.
    pub newcomer: u32,
    /// Who was there before.
    pub old: u32,
    /// Whether it has the office.
    pub in_office: bool,
    bounds: SwapBounds,
    ticks: SwapTicks,
    scale: Scale,
    trajectory: Trajectory,
    sample_s: f64,
    answers: VecDeque<Answer>,
    /// The next tick to judge.
    next: u64,
    accord: Accord,
    /// Ticks in a row that count against it.
    bad_ticks: u64,
    /// What the vehicle did that it may not do.
    strayed: Option<String>,
    seen: Seen,
}

/// What the trial has shown so far.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    ticks: u64,
    difference: f64,
    response_ns: u64,
}

/// What becomes of a newcomer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ruling {
    /// It takes the office.
    HandOver,
    /// It has the office for good.
    Keep,
    /// It goes, from the shadow.
    Reject,
    /// It goes, from the office, which the old one has back.
    Return,
}

impl Trial {
    /// Of `newcomer` for the office of `old` on `topic`, on the given ticks of a run of `scenario`.
    pub fn new(scenario: &Scenario, swap: &Swap, topic: Topic, ticks: SwapTicks, (old, newcomer): (u32, u32)) -> Self {
        Self {
            newcomer,
            old,
            in_office: false,
            bounds: swap.bounds,
            ticks,
            scale: Scale::new(scenario, topic),
            trajectory: Trajectory::new(&scenario.mission),
            sample_s: scenario.sample_s(),
            answers: VecDeque::with_capacity(REMEMBERED),
            next: ticks.from,
            accord: Accord::default(),
            bad_ticks: 0,
            strayed: None,
            seen: Seen::default(),
        }
    }

    /// Takes one message in.
    pub fn observe(&mut self, record: &Record) {
        if record.stamp().is_struck() {
            return; // what was meant; what came of it is another message
        }
        match record {
            Record::State(state) if self.in_office => self.watch(state),
            _ => self.remember(record),
        }
    }

    /// What becomes of the newcomer before `tick` begins, and why: all messages of the ticks before are known.
    pub fn rule(&mut self, tick: u64) -> Option<(Ruling, String)> {
        let ending = if self.in_office { Ruling::Return } else { Ruling::Reject };
        while self.next < tick {
            let judged = self.next;
            self.next += 1;
            let Some(complaint) = self.complaint(judged) else {
                self.bad_ticks = 0;
                continue;
            };
            self.bad_ticks += 1;
            if self.bad_ticks >= self.bounds.ticks {
                return Some((ending, complaint));
            }
        }
        if let Some(why) = self.strayed.take() {
            return Some((Ruling::Return, why));
        }
        match self.in_office {
            _ if self.bad_ticks > 0 => None,
            false if tick >= self.ticks.hand_over => Some((Ruling::HandOver, self.describe())),
            true if tick >= self.ticks.until => Some((Ruling::Keep, self.describe())),
            _ => None,
        }
    }

    /// What it has shown, for people.
    pub fn describe(&self) -> String {
        let Seen { ticks, difference, response_ns } = self.seen;
        format!(
            "{ticks} answers, at most {:.2} % of the range from the old one's, ready within {:.2} ms",
            difference * 100.0,
            response_ns as f64 / 1e6
        )
    }

    fn remember(&mut self, record: &Record) {
        let Some(answer) = self.scale.read(record) else { return };
        let known = answer.epoch == u64::from(self.newcomer) || answer.epoch == u64::from(self.old);
        if known && answer.tick >= self.next {
            if self.answers.len() == REMEMBERED {
                self.answers.pop_front();
            }
            self.answers.push_back(answer);
        }
    }

    /// What speaks against the newcomer on `tick`.
    fn complaint(&mut self, tick: u64) -> Option<String> {
        let of = |epoch: u32| self.answers.iter().rfind(|a| a.tick == tick && a.epoch == u64::from(epoch)).copied();
        let (mine, theirs) = (of(self.newcomer), of(self.old).filter(|theirs| theirs.usable));
        self.answers.retain(|answer| answer.tick > tick);
        let at = format!("at {:.2} s", tick as f64 * self.sample_s);
        let Some(mine) = mine else { return Some(format!("no answer {at}")) };
        if !mine.usable {
            return Some(format!("an answer {at} that cannot be used"));
        }
        let (difference, accord) = theirs.map_or((0.0, 1.0), |theirs| {
            self.accord.note(&mine, &theirs);
            (mine.difference(&theirs), self.accord.least())
        });
        self.seen = Seen {
            ticks: self.seen.ticks + 1,
            difference: self.seen.difference.max(difference),
            response_ns: self.seen.response_ns.max(mine.response_ns),
        };
        let ms = |ns: u64| ns as f64 / 1e6;
        if mine.response_ns > self.scale.due_ns {
            return Some(format!("late {at}: {:.2} ms, due at {:.2} ms", ms(mine.response_ns), ms(self.scale.due_ns)));
        }
        if difference > self.bounds.difference {
            let (percent, limit) = (difference * 100.0, self.bounds.difference * 100.0);
            return Some(format!("{percent:.1} % of the range from the old one's answer {at}, limit {limit:.1} %"));
        }
        let limit = self.bounds.accord;
        (accord < limit)
            .then(|| format!("the opposite of the old one's answers {at}: accord {accord:.2}, limit {limit}"))
    }

    /// The vehicle under the newcomer.
    fn watch(&mut self, state: &State) {
        let [phi, theta, _] = state.actual.attitude_rad;
        let tilt_deg = (phi.cos() * theta.cos()).clamp(-1.0, 1.0).acos().to_degrees();
        let time_s = state.stamp.tick as f64 * self.sample_s;
        let wanted = self.trajectory.at(time_s).position_m;
        let error_m = wanted.iter().zip(state.actual.position_m).map(|(w, p)| (w - p) * (w - p)).sum::<f64>().sqrt();
        let (tilt_limit, error_limit) = (self.bounds.tilt_deg, self.bounds.error_m);
        if tilt_deg > tilt_limit {
            self.strayed = Some(format!("the vehicle tilted {tilt_deg:.1} deg at {time_s:.2} s, limit {tilt_limit}"));
        } else if error_m > error_limit {
            self.strayed = Some(format!("the vehicle was {error_m:.2} m off at {time_s:.2} s, limit {error_limit}"));
        }
    }
}
