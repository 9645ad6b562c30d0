//! Trial of a candidate, on standby and then active.
//!
//! ```text
//! on standby --hand over--> active --> kept
//!       \--> rejected              \--> returned: the old one is active again
//! ```
//!
//! A tick counts against the candidate if its answer is missing, not usable, late, too far from the answer of the old
//! process, or the opposite of it (`answer.rs`): both answer to the same inputs, whichever of them is active. A
//! candidate is neither handed the role nor kept while the last judged tick is against it. A tick that the plant has
//! skipped does not count. A tick on which the old process has no good answer either does not count against the
//! candidate.
//! If the old process dies, the trial goes on. While the candidate is active the vehicle itself is watched too. The
//! trial judges messages alone, so it ends the same way in every mode.

use std::collections::VecDeque;

use contract::message::Truth;
use contract::topic::Topic;
use guidance::Trajectory;
use settings::{Scenario, Swap, SwapBounds, SwapTicks};

use super::answer::{Answer, Scale, Similarity};
use crate::record::Record;
use crate::states::{length_m, position_error_m};

/// Time for which answers are kept until they are judged \[s\]: in real time the launcher may look late.
const REMEMBERED_S: f64 = 2.0;

/// Candidate under trial, with the statistics of its answers.
pub struct Trial {
    pub candidate: u32,
    /// Process before the candidate; `None` once it has ended.
    pub old: Option<u32>,
    pub active: bool,
    bounds: SwapBounds,
    ticks: SwapTicks,
    scale: Scale,
    trajectory: Trajectory,
    sample_s: f64,
    answers: VecDeque<Answer>,
    /// Ticks that the plant has sampled, and that are not judged yet.
    sampled: VecDeque<u64>,
    /// Largest number of answers, and of sampled ticks, that are kept.
    room: usize,
    /// First tick that is not judged yet.
    next: u64,
    similarity: Similarity,
    /// Ticks in a row that count against the candidate.
    bad_ticks: u64,
    /// Bound that the vehicle has exceeded under the candidate, in words.
    out_of_bounds: Option<String>,
    seen: Seen,
}

/// Figures of the trial so far.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    ticks: u64,
    difference: f64,
    response_ns: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ruling {
    /// The candidate becomes active.
    HandOver,
    /// The candidate stays active, and its trial ends.
    Keep,
    /// The candidate is killed on standby.
    Reject,
    /// The candidate is killed and the process before it becomes active again.
    Return,
}

impl Trial {
    /// Creates the trial of `candidate` for the role of `old` on `topic`, on the given ticks of a run of `scenario`.
    pub fn new(scenario: &Scenario, swap: &Swap, topic: Topic, ticks: SwapTicks, (old, candidate): (u32, u32)) -> Self {
        Self {
            candidate,
            old: Some(old),
            active: false,
            bounds: swap.bounds,
            ticks,
            scale: Scale::new(scenario, topic),
            trajectory: Trajectory::new(scenario),
            sample_s: scenario.sample_s(),
            answers: VecDeque::new(),
            sampled: VecDeque::new(),
            room: (REMEMBERED_S / scenario.sample_s()) as usize * 2,
            next: ticks.from,
            similarity: Similarity::default(),
            bad_ticks: 0,
            out_of_bounds: None,
            seen: Seen::default(),
        }
    }

    pub fn observe(&mut self, record: &Record) {
        if let Record::State(state) = record
            && state.stamp.tick >= self.next
            && self.sampled.back().is_none_or(|newest| *newest < state.stamp.tick)
            && record.is_intact()
        {
            remember(&mut self.sampled, state.stamp.tick, self.room);
        }
        match record {
            Record::Truth(truth) if self.active => self.watch(truth),
            _ => self.note(record),
        }
    }

    /// Returns the ruling before `tick`, with the reason, if any. All messages of earlier ticks must be known.
    pub fn rule(&mut self, tick: u64) -> Option<(Ruling, String)> {
        let ending = if self.active { Ruling::Return } else { Ruling::Reject };
        self.next = self.next.max(tick);
        while let Some(judged) = self.sampled.front().copied().filter(|sampled| *sampled < tick) {
            self.sampled.pop_front();
            let (mine, theirs) = self.answers_to(judged);
            let no_worse = self.old.is_some() && !theirs.is_some_and(|theirs| theirs.is_good(self.scale.due_ns));
            match self.against(judged, mine, theirs) {
                None => self.bad_ticks = 0,
                Some(_) if no_worse => {}
                Some(complaint) => {
                    self.bad_ticks += 1;
                    if self.bad_ticks >= self.bounds.ticks {
                        return Some((ending, complaint));
                    }
                }
            }
        }
        if let Some(why) = self.out_of_bounds.take() {
            return Some((Ruling::Return, why));
        }
        match self.active {
            _ if self.bad_ticks > 0 => None,
            false if tick >= self.ticks.hand_over => Some((Ruling::HandOver, self.describe())),
            true if tick >= self.ticks.until => Some((Ruling::Keep, self.describe())),
            _ => None,
        }
    }

    /// Describes the trial so far, for people.
    pub fn describe(&self) -> String {
        let Seen { ticks, difference, response_ns } = self.seen;
        let percent = difference * 100.0;
        let ready = if self.scale.clocked {
            format!(", ready within {:.2} ms", response_ns as f64 / 1e6)
        } else {
            String::new()
        };
        format!("{ticks} answers, at most {percent:.2} % of the range from the old one's{ready}")
    }

    fn note(&mut self, record: &Record) {
        if record.stamped().is_none_or(|(_, stamp)| stamp.is_faulted() || stamp.is_withheld()) {
            return; // the message as computed; the delivered one, if any, is another message
        }
        let Some(answer) = self.scale.read(record) else { return };
        let mut known = std::iter::once(self.candidate).chain(self.old).map(u64::from);
        if known.any(|epoch| epoch == answer.epoch) && answer.tick >= self.next {
            remember(&mut self.answers, answer, self.room);
        }
    }

    /// Takes out the candidate's answer to `tick` and that of the old process, and drops earlier ones.
    fn answers_to(&mut self, tick: u64) -> (Option<Answer>, Option<Answer>) {
        let of = |epoch: u32| self.answers.iter().rfind(|a| a.tick == tick && a.epoch == u64::from(epoch)).copied();
        let both = (of(self.candidate), self.old.and_then(of));
        self.answers.retain(|answer| answer.tick > tick);
        both
    }

    /// Returns the reason why `tick` counts against the candidate, for people; `None` if its answer is good.
    fn against(&mut self, tick: u64, mine: Option<Answer>, theirs: Option<Answer>) -> Option<String> {
        let at = format!("at {:.2} s", tick as f64 * self.sample_s);
        let Some(mine) = mine else { return Some(format!("no answer {at}")) };
        if !mine.usable {
            return Some(format!("an answer {at} that cannot be used"));
        }
        let (difference, similarity) = theirs.filter(|theirs| theirs.usable).map_or((0.0, 1.0), |theirs| {
            self.similarity.note(&mine, &theirs);
            (mine.difference(&theirs), self.similarity.least())
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
        let limit = self.bounds.similarity;
        (similarity < limit)
            .then(|| format!("the opposite of the old one's answers {at}: similarity {similarity:.2}, limit {limit}"))
    }

    /// Compares the vehicle under the candidate with the bounds of the swap.
    fn watch(&mut self, truth: &Truth) {
        let tilt_deg = truth.actual.tilt_rad().to_degrees();
        let time_s = truth.tick as f64 * self.sample_s;
        let error_m = length_m(position_error_m(self.trajectory.at(time_s).position_m, truth));
        let (tilt_limit, error_limit) = (self.bounds.tilt_deg, self.bounds.error_m);
        if tilt_deg > tilt_limit {
            self.out_of_bounds =
                Some(format!("the vehicle tilted {tilt_deg:.1} deg at {time_s:.2} s, limit {tilt_limit}"));
        } else if error_m > error_limit {
            self.out_of_bounds =
                Some(format!("the vehicle was {error_m:.2} m off at {time_s:.2} s, limit {error_limit}"));
        }
    }
}

/// Adds `newest`, and drops the oldest if there are `room` already.
fn remember<T>(all: &mut VecDeque<T>, newest: T, room: usize) {
    if all.len() >= room {
        all.pop_front();
    }
    all.push_back(newest);
}
