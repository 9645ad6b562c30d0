//! Who works in a flight through processes: what is seen of them, and what is done about it.

use std::collections::VecDeque;
use std::sync::atomic::AtomicU32;
use std::time::{Duration, Instant};

use contract::scenario::{SwapNode, candidate, to_toml};
use contract::topic::Topic;
use runtime::console::eprint_line;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;
use rustix::process::Signal as Unix;

use super::Stack;
use super::archive::Archive;
use super::children::{Process, SpawnRequest, wait};
use super::driver::Order;
use super::end::{ChildExit, Ended};
use crate::event::{Event, What};
use crate::recorder::LogOutcome;
use crate::roles::hearing::Silence;
use crate::roles::realtime::plant_tick;
use crate::roles::role::{Action, Input, Now, Signal};

/// Name of the process that records.
pub const RECORDER: &str = "recorder";
/// The recorder may have a slow disk to empty its last chunk to.
const CLOSE_LIMIT: Duration = Duration::from_secs(30);
/// It looks every two milliseconds; one that is stopped is not waited for.
const CATCH_UP_LIMIT: Duration = Duration::from_secs(1);

impl Stack {
    /// Looks at all processes, and does what their roles say; how the flight has ended, if it has. In lockstep the plant's
    /// `question` is answered, once all processes that come with that tick are there.
    pub(super) fn supervise(&mut self, question: Option<u64>) -> Option<Ended> {
        let tick = question.unwrap_or_else(|| plant_tick(&self.page));
        while let Some((i, how)) = self.children.exited() {
            let Process { name, topic, epoch, .. } = self.children.all[i];
            match (topic, how) {
                (None, _) => self.recorder_exited(i, tick),
                (Some(Topic::State), ChildExit::Well) => return Some(Ended::Flown),
                (Some(Topic::State), how) => return Some(Ended::Lost(how.tell(name))),
                (Some(topic), ChildExit::Late) if self.driver.is_alone(topic, epoch) => {
                    return Some(Ended::Late(name.into()));
                }
                (Some(topic), _) => {
                    let orders = self.driver.exited(&self.page, &self.scenario, (topic, epoch), Input::Exited(epoch));
                    self.carry_out(orders);
                }
            }
            self.children.clean_up(i);
        }
        let orders = self.driver.look(&self.page, &self.scenario, question);
        self.carry_out(orders);
        self.see_to_recorder(tick);
        if self.archive.as_ref().is_none_or(|archive| archive.role.starting().is_none()) {
            self.driver.done(&self.page);
        }
        self.driver.stuck(&self.page).map(Ended::Lost)
    }

    /// Sees to it that every process hears every other: one that is mute or deaf is replaced as if it hung.
    pub(super) fn listen(&mut self) {
        let received = Topic::ALL.map(|topic| self.observers.received(topic));
        for silence in self.hearing.look(&self.page, received) {
            let (topic, epoch, why) = match silence {
                Silence::Mute(topic, epoch) => (topic, epoch, "its messages do not arrive".to_owned()),
                Silence::Deaf(topic, epoch, of) => (topic, epoch, format!("it hears nothing of {}", of.publisher())),
                Silence::Blind(of) => {
                    if !std::mem::replace(&mut self.blind[of as usize], true) {
                        let event = Event::new(plant_tick(&self.page), "launcher", 0, What::Hung);
                        self.events.push(event.because(format!("it hears nothing of {}", of.publisher())));
                    }
                    continue;
                }
            };
            if std::mem::replace(&mut self.silenced[topic as usize], epoch) == epoch {
                continue; // it has been killed, and is about to be seen to end
            }
            let orders = self.driver.unheard(&self.page, &self.scenario, (topic, epoch), &why);
            self.carry_out(orders);
        }
    }

    fn carry_out(&mut self, orders: Vec<Order>) {
        for (topic, action) in orders {
            match action {
                Action::Spawn(epoch, origin) => self.start_or_report(topic, epoch, origin),
                Action::Signal(epoch, signal) => self.children.signal(topic, epoch, unix(signal)),
                Action::Report(event) => self.events.push(event),
                Action::Activate(_) | Action::Standby(_) | Action::Vacate(_) => {} // the driver has done it
            }
        }
    }

    fn start_or_report(&mut self, topic: Topic, epoch: u32, origin: Option<usize>) {
        let mut started = self.start_node(topic, epoch, origin);
        if let Err(error) = started.as_ref()
            && origin.is_some()
            && self.page.role(topic).active() == 0
        {
            // The program that was swapped in is gone by now: the launcher's own is better than none.
            eprint_line(&format!("error: {error:#}; {} goes on as at the beginning", topic.publisher()));
            started = self.start_node(topic, epoch, None);
        }
        if let Err(error) = started {
            let why = format!("{error:#}");
            eprint_line(&format!("error: {why}"));
            let input = Input::NotStarted(epoch, why);
            let orders = self.driver.exited(&self.page, &self.scenario, (topic, epoch), input);
            self.carry_out(orders);
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
        archive.role.may_swap()
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
        self.see_to_recorder(plant_tick(&self.page)); // one that is ready takes over now
        let mut archive = self.archive.take()?;
        let untold = self.events.len() - self.children.told;
        for Process { epoch, child, .. } in self.children.all.iter_mut().filter(|process| process.name == RECORDER) {
            let starts = archive.role.starting() == Some(*epoch);
            wait(child, RECORDER, if starts { Duration::ZERO } else { CLOSE_LIMIT }, interrupts);
            if let Some(stdout) = child.stdout.take().filter(|_| !starts) {
                archive.keep(*epoch, stdout);
            }
        }
        let sent = Topic::ALL.map(|topic| u64::from(self.page.role(topic).sent_by_all.get())).iter().sum();
        Some(archive.close(self.page.archive().active(), &self.scenario, &self.events, untold, sent))
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
    fn recorder_exited(&mut self, i: usize, tick: u64) {
        let Some(archive) = &mut self.archive else { return };
        let Process { epoch, child, .. } = &mut self.children.all[i];
        let epoch = *epoch;
        // One that was never ready has written nothing.
        if let Some(stdout) = child.stdout.take().filter(|_| archive.role.starting() != Some(epoch)) {
            archive.keep(epoch, stdout);
        }
        self.on_recorder(tick, Input::Exited(epoch));
    }

    /// Sees to it that a recorder works. The flight is worth more than its log, whose loss is told at the end.
    fn see_to_recorder(&mut self, tick: u64) {
        let Some(Archive { role, begun, .. }) = &mut self.archive else { return };
        let mut inputs = vec![Input::Tick];
        inputs.extend(role.starting().filter(|epoch| self.page.archive().ready.get() == *epoch).map(Input::Ready));
        let (recorded, watched) = (self.page.recorded().count(), self.page.watched().count());
        inputs.push(Input::Progress { done: recorded.into(), samples: watched.into(), excused_ns: 0 });
        begun.resize(self.scenario.swap.len(), false);
        let from = |i: &usize| self.scenario.swap[*i].ticks(self.scenario.sample_s()).from;
        let ours = |i: &usize| self.scenario.swap[*i].node == SwapNode::Recorder && !begun[*i];
        let first = (0..self.scenario.swap.len()).filter(ours).min_by_key(from);
        if let Some(swap) = first.filter(|i| tick >= from(i) && !role.is_busy() && !role.given_up()) {
            begun[swap] = true;
            inputs.push(Input::SwapRequested(swap));
        }
        for input in inputs {
            self.on_recorder(tick, input);
        }
    }

    /// Takes `input` into the recorder's role, which runs by the wall clock in every mode, and does what it says.
    fn on_recorder(&mut self, tick: u64, input: Input) {
        let now = Now { ns: self.started.elapsed().as_nanos() as u64, tick };
        let mut inputs = VecDeque::from([input]);
        while let Some(input) = inputs.pop_front() {
            let Some(archive) = &mut self.archive else { return };
            for action in archive.role.on(now, input) {
                match action {
                    Action::Spawn(epoch, origin) => {
                        if let Err(error) = self.spawn_recorder(epoch, origin) {
                            let why = format!("{error:#}");
                            eprint_line(&format!("error: {why}"));
                            inputs.push_back(Input::NotStarted(epoch, why));
                        }
                    }
                    Action::Signal(epoch, signal) => self.children.signal(None, epoch, unix(signal)),
                    Action::Activate(epoch) => {
                        self.page.archive().assign(0, |_| Assignment { active: epoch, standby: 0 });
                        self.page.recorded().raise(self.page.watched().count()); // it never has what was sent before it came
                        inputs.push_back(Input::Activated(epoch));
                    }
                    Action::Vacate(epoch) => self.page.archive().assign(0, |work| work.without(epoch)),
                    Action::Report(event) => self.events.push(event),
                    Action::Standby(_) => {} // a recorder is not compared with another
                }
            }
        }
        if self.archive.as_ref().is_some_and(|archive| archive.role.given_up()) {
            self.page.recorded().raise(u32::MAX); // nothing is recorded, so there is nothing to wait for
        }
    }
}

fn unix(signal: Signal) -> Unix {
    match signal {
        Signal::Kill => Unix::KILL,
        Signal::Stop => Unix::STOP,
        Signal::Continue => Unix::CONT,
    }
}
