//! Succession: who works for each node on each tick, where time follows the script: in lockstep and in process.
//!
//! ```text
//! scripted death   away from its tick on, then another process
//! death by itself  noticed at once, another process RESTART later; the fourth within 5 s is the last
//! swap             candidate on standby -> active -> kept, or sent away: see [`trial`]
//! ```
//!
//! It knows no process, no clock and no shared memory: whoever turns the ring asks before each tick that may change
//! something, and does what it says. Against the clock the supervisor decides, from what it sees.

mod answer;
mod similarity;
pub mod trial;

use std::time::Duration;

use contract::plan::{Plan, RESTART_S};
use contract::scenario::Scenario;
use contract::topic::Topic;
use runtime::shared_role::Assignment;

use crate::event::{Event, What};
use crate::log::Record;
use trial::{Ruling, Trial};

/// Deaths of a node, or of the recorder, within [`DEATHS_WITHIN`] after which nobody is started any more.
pub const MOST_DEATHS: usize = 4;
/// See [`MOST_DEATHS`].
pub const DEATHS_WITHIN: Duration = Duration::from_secs(5);

/// Who works when, as the script and the flight have it.
pub struct Succession {
    scenario: Scenario,
    plan: Plan,
    posts: [Post; Topic::COUNT],
    /// Everything that happened.
    pub events: Vec<Event>,
}

/// One node.
struct Post {
    topic: Topic,
    active: Option<Worker>,
    standby: Option<Worker>,
    /// The newest epoch.
    newest: u32,
    away: Option<Away>,
    /// The ticks of the newest deaths.
    deaths: Vec<u64>,
    /// A candidate's, and who was there before it.
    trial: Option<(Trial, Worker)>,
}

/// A process that works.
#[derive(Clone, Copy)]
struct Worker {
    epoch: u32,
    /// The swap that it came with.
    origin: Option<usize>,
}

/// Nobody is there.
#[derive(Clone, Copy)]
struct Away {
    until: u64,
    who: Worker,
    /// Whether another comes in its place.
    replaced: bool,
}

/// What is to be done before a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// End the process of this epoch.
    End(Topic, u32),
    /// Start one of this epoch, with the program and settings of this swap, or those of the run.
    Begin(Topic, u32, Option<usize>),
}

impl Succession {
    /// For a run of `scenario`, in which every node has its first process.
    pub fn new(scenario: &Scenario) -> Self {
        let first = Worker { epoch: 1, origin: None };
        let post = |topic| Post {
            topic,
            active: Some(first),
            standby: None,
            newest: 1,
            away: None,
            deaths: vec![],
            trial: None,
        };
        Self { scenario: scenario.clone(), plan: Plan::new(scenario), posts: Topic::ALL.map(post), events: vec![] }
    }

    /// Who works for the node that speaks on `topic`.
    pub fn assignment(&self, topic: Topic) -> Assignment {
        let post = &self.posts[topic as usize];
        let epoch = |worker: Option<Worker>| worker.map_or(0, |worker| worker.epoch);
        Assignment { active: epoch(post.active), standby: epoch(post.standby) }
    }

    /// A node for which nobody is started any more.
    pub fn given_up(&self) -> Option<&'static str> {
        let given_up = |post: &&Post| post.away.is_some_and(|away| away.until == u64::MAX);
        self.posts.iter().find(given_up).map(|post| post.topic.publisher())
    }

    /// Takes one message in: trials are decided by them.
    pub fn observe(&mut self, record: &Record) {
        self.posts.iter_mut().filter_map(|post| post.trial.as_mut()).for_each(|(trial, _)| trial.observe(record));
    }

    /// Decides who works on `tick`; what is to be done before it begins.
    pub fn begin(&mut self, tick: u64) -> Vec<Step> {
        let Self { scenario, plan, posts, events } = self;
        let mut steps = vec![];
        for post in posts {
            let mut happened = |epoch, what| events.push(Event::new(tick, post.topic.publisher(), epoch, what));
            if let Some(absence) = plan.absence(post.topic, tick).filter(|absence| absence.from == tick)
                && let Some(who) = post.active.take()
            {
                happened(who.epoch, if absence.replaced { What::Killed } else { What::Hung });
                steps.extend(absence.replaced.then_some(Step::End(post.topic, who.epoch)));
                post.away = Some(Away { until: absence.until, who, replaced: absence.replaced });
                post.count_failure(tick, absence.replaced, scenario, events);
            }
            post.fill(tick, events, &mut steps);
            post.judge(tick, scenario, events, &mut steps);
            for (i, swap) in scenario.swap.iter().enumerate() {
                if swap.node.topic() == Some(post.topic) && swap.ticks(scenario.sample_s()).from == tick {
                    post.try_candidate(tick, scenario, i, events, &mut steps);
                }
            }
        }
        steps
    }

    /// The process `epoch` has ended by itself, on `tick`.
    pub fn lost(&mut self, topic: Topic, epoch: u32, tick: u64) {
        let Self { scenario, posts, events, .. } = self;
        let post = &mut posts[topic as usize];
        let is = |worker: &mut Worker| worker.epoch == epoch;
        let Some(mut who) = post.active.take_if(is).or_else(|| post.standby.take_if(is)) else { return };
        events.push(Event::new(tick, topic.publisher(), epoch, What::Died));
        if let Some((trial, _)) = post.trial.as_mut().filter(|(trial, _)| trial.old == Some(epoch)) {
            trial.old = None; // it goes on without
        } else if let Some((trial, old)) = post.trial.take() {
            who = old;
            let what = trial.ending_by_death();
            events.push(Event::new(tick, topic.publisher(), epoch, what).because("it died"));
        }
        if post.active.is_none() && post.standby.is_none() {
            post.replace(who, tick, scenario, events);
        }
    }

    /// Whether `epoch` is active, and there is nobody to have it back.
    pub fn is_alone(&self, topic: Topic, epoch: u32) -> bool {
        let post = &self.posts[topic as usize];
        post.active.is_some_and(|active| active.epoch == epoch) && post.trial.is_none()
    }
}

impl Post {
    /// Sees to it that another comes for `who`, who is no more.
    fn replace(&mut self, who: Worker, tick: u64, scenario: &Scenario, events: &mut Vec<Event>) {
        let restart = (RESTART_S / scenario.sample_s() - 1e-6).ceil() as u64;
        self.away = Some(Away { until: tick + restart, who, replaced: true });
        self.count_failure(tick, true, scenario, events);
    }

    /// Counts a death; after too many of them nobody comes back.
    fn count_failure(&mut self, tick: u64, died: bool, scenario: &Scenario, events: &mut Vec<Event>) {
        if !died {
            return;
        }
        self.deaths.retain(|at| (tick - at) as f64 * scenario.sample_s() < DEATHS_WITHIN.as_secs_f64());
        self.deaths.push(tick);
        if self.deaths.len() >= MOST_DEATHS
            && let Some(away) = &mut self.away
        {
            away.until = u64::MAX;
            events.push(Event::new(tick, self.topic.publisher(), away.who.epoch, What::GivenUp));
        }
    }

    /// Puts somebody in an role that is vacant: who works on standby, or who was to come back on this tick.
    fn fill(&mut self, tick: u64, events: &mut Vec<Event>, steps: &mut Vec<Step>) {
        if self.active.is_some() {
            return;
        }
        self.active = self.standby.take();
        if let Some(away) = self.away.take_if(|away| tick >= away.until) {
            let mut who = away.who;
            if away.replaced {
                self.newest += 1;
                who.epoch = self.newest;
                events.push(Event::new(tick, self.topic.publisher(), who.epoch, What::Started));
                steps.push(Step::Begin(self.topic, who.epoch, who.origin));
            }
            self.active = Some(who);
        }
        if let Some(active) = self.active {
            if let Some((trial, _)) = self.trial.as_mut().filter(|(trial, _)| trial.candidate == active.epoch) {
                trial.active = true;
            }
            events.push(Event::new(tick, self.topic.publisher(), active.epoch, What::TookOver));
        }
    }

    /// Does what the trial of a candidate has come to.
    fn judge(&mut self, tick: u64, scenario: &Scenario, events: &mut Vec<Event>, steps: &mut Vec<Step>) {
        let Some((trial, old)) = &mut self.trial else { return };
        let Some((ruling, why)) = trial.rule(tick) else { return };
        let (candidate, old, old_lives) = (trial.candidate, *old, trial.old.is_some());
        let happened = |epoch, what| Event::new(tick, self.topic.publisher(), epoch, what);
        if matches!(ruling, Ruling::HandOver | Ruling::Return) {
            std::mem::swap(&mut self.active, &mut self.standby);
        }
        let (what, leaves) = match ruling {
            Ruling::HandOver => {
                trial.active = true;
                events.push(happened(candidate, What::TookOver).because(why));
                return;
            }
            Ruling::Keep => (What::Kept, Some(old.epoch).filter(|_| old_lives)),
            Ruling::Reject => (What::Rejected, Some(candidate)),
            Ruling::Return => (What::Returned, Some(candidate)),
        };
        self.trial = None;
        self.standby = None;
        steps.extend(leaves.map(|epoch| Step::End(self.topic, epoch)));
        events.push(happened(candidate, what).because(why));
        match self.active {
            Some(active) if ruling == Ruling::Return => events.push(happened(active.epoch, What::TookOver)),
            Some(_) => {}
            None => self.replace(old, tick, scenario, events),
        }
    }

    /// Begins the swap number `i` of the scenario.
    fn try_candidate(
        &mut self,
        tick: u64,
        scenario: &Scenario,
        i: usize,
        events: &mut Vec<Event>,
        steps: &mut Vec<Step>,
    ) {
        let has_begun = steps.iter().any(|step| matches!(step, Step::Begin(topic, ..) if *topic == self.topic));
        let (active, why) = match self.active {
            _ if self.trial.is_some() => (None, "another candidate is on trial"),
            active if !has_begun => (active, "nobody to take over from"),
            _ => (None, "who is active has only just begun"),
        };
        let Some(active) = active else {
            let rejected = Event::new(tick, self.topic.publisher(), self.newest, What::Rejected);
            events.push(rejected.because(why).begins(Some(i)));
            return;
        };
        self.newest = successor(self.newest, active.epoch);
        let candidate = Worker { epoch: self.newest, origin: Some(i) };
        let swap = &scenario.swap[i];
        let ticks = swap.ticks(scenario.sample_s());
        self.trial = Some((Trial::new(scenario, swap, self.topic, ticks, (active.epoch, candidate.epoch)), active));
        self.standby = Some(candidate);
        steps.push(Step::Begin(self.topic, candidate.epoch, candidate.origin));
        let happened = |what| Event::new(tick, self.topic.publisher(), candidate.epoch, what);
        events.extend([happened(What::Started).begins(Some(i)), happened(What::OnStandby)]);
    }
}

/// The epoch of who is started after `newest` beside `active`, if there is one: the two must differ in the last bit
/// ([`runtime::shared_role`]).
pub fn successor(newest: u32, active: u32) -> u32 {
    let next = newest + 1;
    if active > 0 && next % 2 == active % 2 { next + 1 } else { next }
}

#[cfg(test)]
mod tests;
