//! Succession: who works for each node on each tick, where time follows the script: in lockstep and in process.
//!
//! ```text
//! scripted death   away from its tick on, then another process
//! death by itself  noticed at once, another process RESTART later; the fourth within 5 s is the last
//! swap             newcomer in the shadow -> in office -> kept, or sent away: see [`trial`]
//! ```
//!
//! It knows no process, no clock and no shared memory: whoever turns the ring asks before each tick that may change
//! something, and does what it says. Against the clock the supervisor decides, from what it sees.

mod accord;
mod answer;
pub mod trial;

use std::time::Duration;

use contract::plan::{Plan, RESTART_S};
use contract::scenario::Scenario;
use contract::topic::Topic;
use runtime::office::Staff;

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
    holder: Option<Worker>,
    shadow: Option<Worker>,
    /// The newest epoch.
    newest: u32,
    away: Option<Away>,
    /// The ticks of the newest deaths.
    deaths: Vec<u64>,
    /// A newcomer's, and who was there before it.
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
            holder: Some(first),
            shadow: None,
            newest: 1,
            away: None,
            deaths: vec![],
            trial: None,
        };
        Self { scenario: scenario.clone(), plan: Plan::new(scenario), posts: Topic::ALL.map(post), events: vec![] }
    }

    /// Who works for the node that speaks on `topic`.
    pub fn staff(&self, topic: Topic) -> Staff {
        let post = &self.posts[topic as usize];
        let epoch = |worker: Option<Worker>| worker.map_or(0, |worker| worker.epoch);
        Staff { holder: epoch(post.holder), shadow: epoch(post.shadow) }
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
                && let Some(who) = post.holder.take()
            {
                happened(who.epoch, if absence.replaced { What::Killed } else { What::Hung });
                steps.extend(absence.replaced.then_some(Step::End(post.topic, who.epoch)));
                post.away = Some(Away { until: absence.until, who, replaced: absence.replaced });
                post.mourn(tick, absence.replaced, scenario, events);
            }
            post.fill(tick, events, &mut steps);
            post.judge(tick, scenario, events, &mut steps);
            for (i, swap) in scenario.swap.iter().enumerate() {
                if swap.node.topic() == Some(post.topic) && swap.ticks(scenario.sample_s()).from == tick {
                    post.try_newcomer(tick, scenario, i, events, &mut steps);
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
        let Some(mut who) = post.holder.take_if(is).or_else(|| post.shadow.take_if(is)) else { return };
        events.push(Event::new(tick, topic.publisher(), epoch, What::Died));
        if let Some((trial, _)) = post.trial.as_mut().filter(|(trial, _)| trial.old == Some(epoch)) {
            trial.old = None; // it goes on without
        } else if let Some((trial, old)) = post.trial.take() {
            who = old;
            let what = trial.ending_by_death();
            events.push(Event::new(tick, topic.publisher(), epoch, what).because("it died"));
        }
        if post.holder.is_none() && post.shadow.is_none() {
            post.replace(who, tick, scenario, events);
        }
    }

    /// Whether `epoch` is in office, and there is nobody to have it back.
    pub fn is_alone(&self, topic: Topic, epoch: u32) -> bool {
        let post = &self.posts[topic as usize];
        post.holder.is_some_and(|holder| holder.epoch == epoch) && post.trial.is_none()
    }
}

impl Post {
    /// Sees to it that another comes for `who`, who is no more.
    fn replace(&mut self, who: Worker, tick: u64, scenario: &Scenario, events: &mut Vec<Event>) {
        let restart = (RESTART_S / scenario.sample_s() - 1e-6).ceil() as u64;
        self.away = Some(Away { until: tick + restart, who, replaced: true });
        self.mourn(tick, true, scenario, events);
    }

    /// Counts a death; after too many of them nobody comes back.
    fn mourn(&mut self, tick: u64, died: bool, scenario: &Scenario, events: &mut Vec<Event>) {
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

    /// Puts somebody in an office that is vacant: who works in the shadow, or who was to come back on this tick.
    fn fill(&mut self, tick: u64, events: &mut Vec<Event>, steps: &mut Vec<Step>) {
        if self.holder.is_some() {
            return;
        }
        self.holder = self.shadow.take();
        if let Some(away) = self.away.take_if(|away| tick >= away.until) {
            let mut who = away.who;
            if away.replaced {
                self.newest += 1;
                who.epoch = self.newest;
                events.push(Event::new(tick, self.topic.publisher(), who.epoch, What::Started));
                steps.push(Step::Begin(self.topic, who.epoch, who.origin));
            }
            self.holder = Some(who);
        }
        if let Some(holder) = self.holder {
            if let Some((trial, _)) = self.trial.as_mut().filter(|(trial, _)| trial.newcomer == holder.epoch) {
                trial.in_office = true;
            }
            events.push(Event::new(tick, self.topic.publisher(), holder.epoch, What::TookOver));
        }
    }

    /// Does what the trial of a newcomer has come to.
    fn judge(&mut self, tick: u64, scenario: &Scenario, events: &mut Vec<Event>, steps: &mut Vec<Step>) {
        let Some((trial, old)) = &mut self.trial else { return };
        let Some((ruling, why)) = trial.rule(tick) else { return };
        let (newcomer, old, old_lives) = (trial.newcomer, *old, trial.old.is_some());
        let happened = |epoch, what| Event::new(tick, self.topic.publisher(), epoch, what);
        if matches!(ruling, Ruling::HandOver | Ruling::Return) {
            std::mem::swap(&mut self.holder, &mut self.shadow);
        }
        let (what, leaves) = match ruling {
            Ruling::HandOver => {
                trial.in_office = true;
                events.push(happened(newcomer, What::TookOver).because(why));
                return;
            }
            Ruling::Keep => (What::Kept, Some(old.epoch).filter(|_| old_lives)),
            Ruling::Reject => (What::Rejected, Some(newcomer)),
            Ruling::Return => (What::Returned, Some(newcomer)),
        };
        self.trial = None;
        self.shadow = None;
        steps.extend(leaves.map(|epoch| Step::End(self.topic, epoch)));
        events.push(happened(newcomer, what).because(why));
        match self.holder {
            Some(holder) if ruling == Ruling::Return => events.push(happened(holder.epoch, What::TookOver)),
            Some(_) => {}
            None => self.replace(old, tick, scenario, events),
        }
    }

    /// Begins the swap number `i` of the scenario.
    fn try_newcomer(
        &mut self,
        tick: u64,
        scenario: &Scenario,
        i: usize,
        events: &mut Vec<Event>,
        steps: &mut Vec<Step>,
    ) {
        let has_begun = steps.iter().any(|step| matches!(step, Step::Begin(topic, ..) if *topic == self.topic));
        let (holder, why) = match self.holder {
            _ if self.trial.is_some() => (None, "another newcomer is on trial"),
            holder if !has_begun => (holder, "nobody to take over from"),
            _ => (None, "who is in office has only just begun"),
        };
        let Some(holder) = holder else {
            let rejected = Event::new(tick, self.topic.publisher(), self.newest, What::Rejected);
            events.push(rejected.because(why).begins(Some(i)));
            return;
        };
        self.newest = successor(self.newest, holder.epoch);
        let newcomer = Worker { epoch: self.newest, origin: Some(i) };
        let swap = &scenario.swap[i];
        let ticks = swap.ticks(scenario.sample_s());
        self.trial = Some((Trial::new(scenario, swap, self.topic, ticks, (holder.epoch, newcomer.epoch)), holder));
        self.shadow = Some(newcomer);
        steps.push(Step::Begin(self.topic, newcomer.epoch, newcomer.origin));
        let happened = |what| Event::new(tick, self.topic.publisher(), newcomer.epoch, what);
        events.extend([happened(What::Started).begins(Some(i)), happened(What::InShadow)]);
    }
}

/// The epoch of who is started after `newest` beside `holder`, if there is one: the two must differ in the last bit
/// ([`runtime::office`]).
pub fn successor(newest: u32, holder: u32) -> u32 {
    let next = newest + 1;
    if holder > 0 && next % 2 == holder % 2 { next + 1 } else { next }
}

#[cfg(test)]
mod tests;
