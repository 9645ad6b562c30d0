//! Who records: one recorder active, and now and then one that is about to take over.
//!
//! ```text
//! started -> ready: becomes active, and the one before closes its file
//!         \-> dies, or is not ready in time: rejected, and the one active never noticed
//! active -> dies, or stands still: another one, with the program before its own
//!                                     the fourth time in 5 s nobody records any more
//! ```
//!
//! Nobody is tried here as nodes are: there is nothing to compare before the file is closed. The flight goes on in any case.

use std::time::{Duration, Instant};

use contract::Scenario;
use contract::scenario::SwapNode;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;

use crate::event::{Event, What};
use crate::succession::{DEATHS_WITHIN, MOST_DEATHS};

/// Name of the process.
pub const RECORDER: &str = "recorder";
/// A recorder that is not ready by then never will be.
const START_LIMIT: Duration = Duration::from_secs(3);
/// One active that has not come one tick further by then, though there are some, stands still; a disk may be slow.
const HANG: Duration = Duration::from_secs(5);

/// What is to be done to a recorder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Start this epoch, with the program of this swap, or our own.
    Start(u32, Option<usize>),
    /// SIGKILL.
    Kill(u32),
}

/// The recorders of one run; the first is active from the beginning.
pub struct Recorders {
    /// The newest epoch.
    pub newest: u32,
    /// Nobody is started any more.
    pub given_up: bool,
    starting: Option<Started>,
    /// The swaps whose programs have had the role, without those that died in it: the last is who has it.
    programs: Vec<usize>,
    /// Which of the swaps have begun.
    begun: Vec<bool>,
    deaths: Vec<Instant>,
    /// What had been recorded when that was last no standstill, and when that was.
    progress: (u32, Instant),
}

/// When something happens.
#[derive(Clone, Copy)]
pub struct At {
    /// The tick of the flight: in lockstep, while the plant asks for it.
    pub tick: u64,
    /// On the wall clock.
    pub now: Instant,
}

impl At {
    fn event(self, epoch: u32, what: What) -> Event {
        Event::new(self.tick, RECORDER, epoch, what)
    }
}

/// Who has been started and does not record yet.
struct Started {
    epoch: u32,
    at: Instant,
    /// The swap that it comes with, unless it replaces one that died.
    swap: Option<usize>,
}

impl Recorders {
    /// With the first.
    pub fn new() -> Self {
        Self {
            newest: 1,
            given_up: false,
            starting: None,
            programs: vec![],
            begun: vec![],
            deaths: vec![],
            progress: (0, Instant::now()),
        }
    }

    /// Whether another may take over now; why not.
    pub fn may_swap(&self, page: &ControlPage) -> Result<(), String> {
        if self.given_up {
            return Err("the recorder was given up: too many have died".into());
        }
        if self.starting.is_some() || page.archive().active() == 0 {
            return Err("another recorder is starting already; wait until it has taken over".into());
        }
        Ok(())
    }

    /// Whether `epoch` was started and does not record yet.
    pub fn awaits(&self, epoch: u32) -> bool {
        self.starting.as_ref().is_some_and(|started| started.epoch == epoch)
    }

    /// Whether nobody is about to take over.
    pub fn is_settled(&self) -> bool {
        self.starting.is_none()
    }

    /// Looks around: what is to be done. Swaps may have been added to `scenario` since the last time.
    pub fn look(&mut self, page: &ControlPage, scenario: &Scenario, at: At, events: &mut Vec<Event>) -> Option<Order> {
        self.welcome(page, at, events);
        let hangs = self.hangs(page, at.now);
        if let Some(epoch) = hangs {
            events.push(at.event(epoch, What::Hung));
            return Some(Order::Kill(epoch));
        }
        if self.starting.is_some() || self.given_up {
            return None;
        }
        let swap = self.due(at.tick, scenario);
        (swap.is_some() || page.archive().active() == 0).then(|| self.start(swap, at, events))
    }

    /// Lets in who was started and records; the one before closes its file.
    pub fn welcome(&mut self, page: &ControlPage, at: At, events: &mut Vec<Event>) {
        let role = page.archive();
        let Some(started) = self.starting.take_if(|started| role.ready.get() == started.epoch) else { return };
        role.assign(0, |_| Assignment { active: started.epoch, standby: 0 });
        page.recorded().raise(page.watched().count()); // what was sent before it came it will never have
        self.progress = (page.recorded().count(), at.now);
        self.programs.extend(started.swap);
        events.push(at.event(started.epoch, What::TookOver));
    }

    /// One has ended while the flight goes on; whether it has ever had the role.
    pub fn ended(&mut self, page: &ControlPage, epoch: u32, well: bool, at: At, events: &mut Vec<Event>) -> bool {
        let role = page.archive();
        let started = self.starting.take_if(|started| started.epoch == epoch);
        let active = role.active() == epoch;
        if !well || active || started.is_some() {
            events.push(at.event(epoch, What::Died));
        }
        if started.as_ref().is_some_and(|started| started.swap.is_some()) {
            events.push(at.event(epoch, What::Rejected).because("it ended before it was ready"));
        }
        if active {
            self.programs.pop();
            role.assign(0, |assignment| assignment.without(epoch));
        }
        if active || (started.is_some() && role.active() == 0) {
            self.count_failure(page, epoch, at, events);
        }
        started.is_none()
    }

    /// Nobody is active: too often in a short time, and nobody will be.
    fn count_failure(&mut self, page: &ControlPage, epoch: u32, at: At, events: &mut Vec<Event>) {
        self.deaths.retain(|death| at.now.duration_since(*death) < DEATHS_WITHIN);
        self.deaths.push(at.now);
        if self.deaths.len() >= MOST_DEATHS {
            self.given_up = true;
            events.push(at.event(epoch, What::GivenUp));
            page.recorded().raise(u32::MAX); // nobody records, so nobody is to be waited for
        }
    }

    /// Who takes too long to get ready, or stands still active.
    fn hangs(&mut self, page: &ControlPage, now: Instant) -> Option<u32> {
        if let Some(started) = self.starting.as_mut().filter(|started| now - started.at > START_LIMIT) {
            started.at = now; // it is dead soon
            return Some(started.epoch);
        }
        let recorded = page.recorded().count();
        if recorded != self.progress.0 || recorded >= page.watched().count() {
            self.progress = (recorded, now);
        }
        let active = page.archive().active();
        let hangs = active != 0 && now - self.progress.1 > HANG;
        hangs.then(|| {
            self.progress.1 = now; // likewise
            active
        })
    }

    /// The first swap that is due and has not begun, which it now has.
    fn due(&mut self, tick: u64, scenario: &Scenario) -> Option<usize> {
        self.begun.resize(scenario.swap.len(), false);
        let from = |i: &usize| scenario.swap[*i].ticks(scenario.sample_s()).from;
        let ours = |i: &usize| scenario.swap[*i].node == SwapNode::Recorder && !self.begun[*i];
        let first = (0..scenario.swap.len()).filter(ours).min_by_key(from);
        let due = first.filter(|i| tick >= from(i))?;
        self.begun[due] = true;
        Some(due)
    }

    fn start(&mut self, swap: Option<usize>, at: At, events: &mut Vec<Event>) -> Order {
        self.newest += 1;
        self.starting = Some(Started { epoch: self.newest, at: at.now, swap });
        events.push(at.event(self.newest, What::Started).begins(swap));
        Order::Start(self.newest, swap.or(self.programs.last().copied()))
    }
}

#[cfg(test)]
mod tests;
