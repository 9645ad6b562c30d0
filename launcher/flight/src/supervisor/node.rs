//! One node under supervision: who holds its role, who was started, who is under trial.

use std::time::{Duration, Instant};

use contract::topic::Topic;
use runtime::realtime::ControlPage;

use super::Order;
use super::progress::{Progress, limit};
use crate::event::{Event, What};
use crate::succession::trial::Trial;
use crate::succession::{DEATHS_WITHIN, MOST_DEATHS, successor};

/// Waits before the first, second, third new start within [`DEATHS_WITHIN`]; after that the node is given up.
const BACK_OFF_MS: [u64; MOST_DEATHS - 1] = [0, 50, 100];
/// A process that is not ready by then never will be: it waits for what another has left half made, or was stopped.
const START_LIMIT: Duration = Duration::from_secs(1);

/// One node.
pub struct Node {
    /// The topic it speaks on.
    pub topic: Topic,
    /// A candidate, once it works.
    pub trial: Option<Trial>,
    /// Nobody is started any more.
    pub given_up: bool,
    /// What the active has done.
    pub progress: Progress,
    sample_s: f64,
    /// The newest epoch.
    pub newest: u32,
    /// Who has been started and does not work yet.
    pub started: Option<Started>,
    /// New starts within the window.
    starts: Vec<Instant>,
    /// When the next is to be started.
    pub restart_at: Option<Instant>,
    /// A candidate that is not wanted any more.
    superfluous: Option<u32>,
    /// The epochs that work, or are about to, and are to be replaced when they die.
    pub wanted: Vec<u32>,
    /// The swaps that the active and the standby came with.
    pub origins: (Option<usize>, Option<usize>),
    /// The active when last looked at.
    active: u32,
}

/// Who has been started.
#[derive(Clone, Copy)]
pub struct Started {
    /// Which incarnation.
    pub epoch: u32,
    /// When.
    pub at: Instant,
    /// The swap that it comes with, when it is a candidate.
    pub swap: Option<usize>,
}

impl Node {
    /// With its first process.
    pub fn new(topic: Topic, sample_s: f64) -> Self {
        Self {
            topic,
            trial: None,
            given_up: false,
            progress: Progress::new(Instant::now()),
            sample_s,
            newest: 1,
            started: None,
            starts: vec![],
            restart_at: None,
            superfluous: None,
            wanted: vec![1],
            origins: (None, None),
            active: 1,
        }
    }

    /// A process of it has ended.
    pub fn died(&mut self, page: &ControlPage, epoch: u32, tick: u64, events: &mut Vec<Event>) {
        let was_wanted = self.dismiss(epoch);
        self.vacate(page, epoch);
        if !was_wanted {
            return;
        }
        let name = self.topic.publisher();
        events.push(Event::new(tick, name, epoch, What::Died));
        if self.started.take_if(|started| started.epoch == epoch).is_some_and(|started| started.swap.is_some()) {
            events.push(Event::new(tick, name, epoch, What::Rejected).because("it died before it was ready"));
        } else if let Some(trial) = self.trial.as_mut().filter(|trial| trial.old == Some(epoch)) {
            trial.old = None; // it goes on without
        } else if let Some(trial) = self.trial.take() {
            events.push(Event::new(tick, name, epoch, trial.ending_by_death()).because("it died"));
            self.origins = (if trial.active { self.origins.1 } else { self.origins.0 }, None);
        }
        // Nobody active waits for a candidate that is not ready and has shown nothing.
        if let Some(late) = self.started.filter(|started| started.swap.is_some() && self.wanted == [started.epoch]) {
            self.dismiss(late.epoch);
            self.started = None;
            self.superfluous = Some(late.epoch);
            let rejected = Event::new(tick, name, late.epoch, What::Rejected);
            events.push(rejected.because("nobody was active any more before it was ready"));
        }
        if self.wanted.is_empty() {
            self.count_failure(epoch, tick, events);
        }
    }

    /// Forgets a process; whether it was wanted.
    pub fn dismiss(&mut self, epoch: u32) -> bool {
        let wanted = self.wanted.len();
        self.wanted.retain(|other| *other != epoch);
        self.wanted.len() < wanted
    }

    /// Sees to it that another is started; after too many deaths nobody is.
    pub fn count_failure(&mut self, epoch: u32, tick: u64, events: &mut Vec<Event>) {
        let now = Instant::now();
        self.starts.retain(|start| now.duration_since(*start) < DEATHS_WITHIN);
        if let Some(wait_ms) = BACK_OFF_MS.get(self.starts.len()) {
            self.starts.push(now);
            self.restart_at = Some(now + Duration::from_millis(*wait_ms));
        } else {
            self.given_up = true;
            events.push(Event::new(tick, self.topic.publisher(), epoch, What::GivenUp));
        }
    }

    /// Starts who is due.
    pub fn restart(
        &mut self,
        page: &ControlPage,
        tick: u64,
        now: Instant,
        events: &mut Vec<Event>,
        orders: &mut Vec<Order>,
    ) {
        orders.extend(self.superfluous.take().map(|epoch| Order::Kill(self.topic, epoch)));
        if self.restart_at.take_if(|at| now >= *at).is_some() {
            self.newest = successor(self.newest, page.role(self.topic).assignment().standby);
            self.start(None, tick, now, events, orders);
        }
        if let Some(started) = self.started
            && now.duration_since(started.at) > START_LIMIT
        {
            events.push(Event::new(tick, self.topic.publisher(), started.epoch, What::Hung));
            self.started = Some(Started { at: now, ..started }); // it is dead soon
            orders.push(Order::Kill(self.topic, started.epoch));
        }
    }

    /// Has another process started, with what a swap says of it or its predecessor was like.
    pub fn start(
        &mut self,
        swap: Option<usize>,
        tick: u64,
        now: Instant,
        events: &mut Vec<Event>,
        orders: &mut Vec<Order>,
    ) {
        self.started = Some(Started { epoch: self.newest, at: now, swap });
        self.wanted.push(self.newest);
        events.push(Event::new(tick, self.topic.publisher(), self.newest, What::Started).begins(swap));
        orders.push(Order::Start(self.topic, self.newest, swap.or(self.origins.0)));
    }

    /// Roles that changed, active epochs that hang.
    pub fn notice(
        &mut self,
        page: &ControlPage,
        tick: u64,
        now: Instant,
        events: &mut Vec<Event>,
        orders: &mut Vec<Order>,
    ) {
        let role = page.role(self.topic);
        let active = role.active();
        if active != self.active && active != 0 {
            let mut event = Event::new(tick, self.topic.publisher(), active, What::TookOver);
            if let Some(trial) = self.trial.as_mut().filter(|trial| trial.candidate == active) {
                trial.active = true;
                event = event.because(trial.describe());
                self.origins = (self.origins.1, self.origins.0);
            }
            events.push(event);
        }
        let done = u64::from(role.done(active).get());
        if active == 0 || active != self.active {
            self.progress.begin(done, now);
        }
        self.progress.note(done, now);
        self.active = active;
        // Nobody samples for the plant: time alone tells, from the start of the run on.
        let samples = match self.topic {
            Topic::State => u64::MAX,
            _ if tick == 0 => 0,
            _ => tick + 1,
        };
        if active != 0 && self.progress.hangs(samples, limit(self.topic, self.sample_s), now) {
            events.push(Event::new(tick, self.topic.publisher(), active, What::Hung));
            self.progress.begin(done, now);
            orders.push(Order::Kill(self.topic, active));
            if self.topic != Topic::State {
                self.vacate(page, active); // dying takes milliseconds, for which nobody is to wait
            }
        }
    }

    /// When the active will count as hung if it makes no more progress; the first sample was taken at `origin`.
    pub fn hangs_at(&self, page: &ControlPage, origin: Instant) -> Option<Instant> {
        let active = page.role(self.topic).active() != 0;
        active.then(|| self.progress.deadline(origin, self.sample_s, limit(self.topic, self.sample_s)))
    }

    /// Leaves the role to nobody but a standby, if `epoch` holds it or is about to.
    pub fn vacate(&mut self, page: &ControlPage, epoch: u32) {
        let role = page.role(self.topic);
        role.dismiss(epoch);
        if role.ready.get() == epoch {
            role.ready.set(0);
        }
        page.doorbell(self.topic).ring();
    }
}
