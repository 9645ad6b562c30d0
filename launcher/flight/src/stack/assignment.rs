//! Who works in a flight through processes: what became of them, and what is done about it.

use std::sync::atomic::AtomicU32;
use std::time::{Duration, Instant};

use contract::scenario::{candidate, to_toml};
use contract::topic::Topic;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;
use rustix::process::Signal;

use super::Stack;
use super::archive::Archive;
use super::children::{Process, SpawnRequest, wait};
use super::end::{ChildExit, Ended};
use super::recorders::{self, At, RECORDER};
use crate::event::{Event, What, not_started};
use crate::recorder::LogOutcome;
use crate::supervisor::hearing::Silence;
use crate::supervisor::{Order, plant_tick};
use runtime::console::eprint_line;

/// The recorder may have a slow disk to empty its last chunk to.
const CLOSE_LIMIT: Duration = Duration::from_secs(30);
/// It looks every two milliseconds; one that is stopped is not waited for.
const CATCH_UP_LIMIT: Duration = Duration::from_secs(1);

impl Stack {
    /// Sees to it that everybody is there who should be; how the flight has ended, if it has. In lockstep the plant's
    /// `question` is answered, once all who come with that tick are there.
    pub(super) fn supervise(&mut self, question: Option<u64>) -> Option<Ended> {
        let at = At { tick: question.unwrap_or_else(|| plant_tick(&self.page)), now: Instant::now() };
        while let Some((i, how)) = self.children.exited() {
            let Process { name, topic, epoch, .. } = self.children.all[i];
            match (topic, how) {
                (None, how) => self.recorder_ended(i, matches!(how, ChildExit::Well), at),
                (Some(Topic::State), ChildExit::Well) => return Some(Ended::Flown),
                (Some(topic), ChildExit::Late) if self.regime.is_alone(&self.page, topic, epoch) => {
                    return Some(Ended::Late(name.into()));
                }
                (Some(topic), how) => {
                    if !self.regime.died(&self.page, topic, epoch) {
                        return Some(Ended::Lost(how.tell(name)));
                    }
                }
            }
            self.children.clean_up(i);
        }
        for order in self.regime.orders(&self.page, &self.scenario, question) {
            self.obey(order);
        }
        self.see_to_recorders(at);
        if self.archive.as_ref().is_none_or(|archive| archive.recorders.is_settled()) {
            self.regime.answer(&self.page);
        }
        None
    }

    /// Sees to it that everybody hears everybody: who is mute or deaf is replaced as if it hung.
    pub(super) fn listen(&mut self) {
        let received = Topic::ALL.map(|topic| self.observers.received(topic));
        for silence in self.hearing.look(&self.page, received) {
            let (topic, epoch, why) = match silence {
                Silence::Mute(topic, epoch) => (topic, epoch, "its messages do not arrive".to_owned()),
                Silence::Deaf(topic, epoch, of) => (topic, epoch, format!("it hears nothing of {}", of.publisher())),
                Silence::Blind(of) => {
                    if !std::mem::replace(&mut self.blind[of as usize], true) {
                        let event = Event::new(plant_tick(&self.page), "launcher", 0, What::Hung);
                        self.regime.events().push(event.because(format!("it hears nothing of {}", of.publisher())));
                    }
                    continue;
                }
            };
            if std::mem::replace(&mut self.silenced[topic as usize], epoch) == epoch {
                continue; // it has been killed, and is about to be seen to end
            }
            let order = self.regime.delivery(&self.page, topic, epoch, &why);
            self.obey(order);
        }
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Start(topic, epoch, origin) => {
                let mut started = self.start_node(topic, epoch, origin);
                if let Err(error) = started.as_ref()
                    && origin.is_some()
                    && self.page.role(topic).active() == 0
                {
                    // The program that was swapped in is gone by now: the launcher's own is better than nobody.
                    eprint_line(&format!("error: {error:#}; {} goes on as at the beginning", topic.publisher()));
                    started = self.start_node(topic, epoch, None);
                }
                if let Err(error) = started {
                    let (why, before) = (format!("{error:#}"), self.regime.events().len());
                    eprint_line(&format!("error: {why}"));
                    self.regime.died(&self.page, topic, epoch);
                    not_started(&mut self.regime.events()[before..], epoch, &why);
                }
            }
            Order::Kill(topic, epoch) => self.children.signal(topic, epoch, Signal::KILL),
            Order::Stop(topic, epoch) => self.children.signal(topic, epoch, Signal::STOP),
            Order::Continue(topic, epoch) => self.children.signal(topic, epoch, Signal::CONT),
        }
    }

    /// Starts a process of a node, with what the swap `origin` says of it, and keeps a place for it.
    pub(super) fn start_node(&mut self, topic: Topic, epoch: u32, origin: Option<usize>) -> anyhow::Result<()> {
        self.page.role(topic).offer(epoch);
        let request = SpawnRequest { name: topic.publisher(), topic: Some(topic), epoch, ..SpawnRequest::default() };
        let Some(swap) = origin.and_then(|i| self.scenario.swap.get(i)) else { return self.children.spawn(&request) };
        let text = to_toml(&candidate(&self.scenario, swap)?);
        let settings = self.hold.domain.write(&format!("{}.{epoch}.toml", request.name), &text)?;
        self.children.spawn(&SpawnRequest { program: swap.exec.as_deref(), settings: Some(&settings), ..request })
    }

    /// Starts the first recorder, which has its role at once.
    pub(super) fn start_recorder(&mut self) -> anyhow::Result<()> {
        if self.archive.is_none() {
            self.page.recorded().raise(u32::MAX); // nobody records, so nobody is to be waited for
            return Ok(());
        }
        self.page.archive().assign(0, |_| Assignment { active: 1, standby: 0 });
        self.spawn_recorder(1, None)
    }

    /// Whether another recorder may take over now; why not.
    pub(super) fn may_swap_recorder(&self) -> Result<(), String> {
        let archive =
            self.archive.as_ref().ok_or("nobody records this flight, so there is nobody to take over from")?;
        archive.recorders.may_swap(&self.page)
    }

    /// Waits a moment until the recorder is as far as `is_there` says. One that does not get there loses messages, which
    /// are counted.
    pub(super) fn wait_for_recorder(&self, is_there: impl Fn(&ControlPage) -> bool) {
        let deadline = Instant::now() + CATCH_UP_LIMIT;
        let records = || self.archive.is_some() && self.page.archive().active() > 0;
        while records() && !is_there(&self.page) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// All nodes have left: waits until the log is closed, and says how it went.
    pub(super) fn close_log(&mut self, interrupts: &AtomicU32) -> Option<LogOutcome> {
        let mut archive = self.archive.take()?;
        let events = self.regime.events();
        let untold = events.len() - self.children.told;
        let at = At { tick: plant_tick(&self.page), now: Instant::now() };
        archive.recorders.welcome(&self.page, at, events);
        for Process { epoch, child, .. } in self.children.all.iter_mut().filter(|process| process.name == RECORDER) {
            let starts = archive.recorders.awaits(*epoch);
            wait(child, RECORDER, if starts { Duration::ZERO } else { CLOSE_LIMIT }, interrupts);
            if let Some(stdout) = child.stdout.take().filter(|_| !starts) {
                archive.keep(*epoch, stdout);
            }
        }
        let sent = Topic::ALL.map(|topic| self.page.role(topic).sent_by_all()).iter().sum();
        Some(archive.close(self.page.archive().active(), &self.scenario, events, untold, sent))
    }

    fn spawn_recorder(&mut self, epoch: u32, origin: Option<usize>) -> anyhow::Result<()> {
        let Some(archive) = &self.archive else { return Ok(()) };
        let log = archive.part(epoch);
        let program = origin.and_then(|i| self.scenario.swap.get(i)).and_then(|swap| swap.exec.as_deref());
        self.children.spawn(&SpawnRequest {
            name: RECORDER,
            epoch,
            log: Some(&log),
            program,
            ..SpawnRequest::default()
        })
    }

    /// A recorder has ended, whether it was asked to or not.
    fn recorder_ended(&mut self, i: usize, well: bool, at: At) {
        let Some(archive) = &mut self.archive else { return };
        let Process { epoch, child, .. } = &mut self.children.all[i];
        let has_recorded = archive.recorders.ended(&self.page, *epoch, well, at, self.regime.events());
        if let Some(stdout) = child.stdout.take().filter(|_| has_recorded) {
            archive.keep(*epoch, stdout);
        }
    }

    /// Sees to it that somebody records. The flight is worth more than its log, whose loss is told at the end.
    fn see_to_recorders(&mut self, at: At) {
        let Some(Archive { recorders, .. }) = &mut self.archive else { return };
        match recorders.look(&self.page, &self.scenario, at, self.regime.events()) {
            Some(recorders::Order::Kill(epoch)) => self.children.signal(None, epoch, Signal::KILL),
            Some(recorders::Order::Start(epoch, origin)) => {
                if let Err(error) = self.spawn_recorder(epoch, origin) {
                    let why = format!("{error:#}");
                    eprint_line(&format!("error: {why}"));
                    if let Some(Archive { recorders, .. }) = &mut self.archive {
                        let events = self.regime.events();
                        let before = events.len();
                        recorders.ended(&self.page, epoch, false, at, events);
                        not_started(&mut events[before..], epoch, &why);
                    }
                }
            }
            None => {}
        }
    }
}
