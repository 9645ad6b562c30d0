//! The ring as processes: start them, watch them, stop them, leave shared memory clean.
//!
//! ```text
//! take the namespace -> create services and board -> start children -> all joined? -> GO
//!   watch: empty the queues, do what the supervisor orders, show progress
//! plant has left, or Ctrl-C, or nobody can go on -> LEAVE -> nodes gone -> CLOSE -> recorder gone -> wipe
//! ```

mod children;
mod end;
mod files;
mod host;

use std::io::Read;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::Scenario;
use contract::domain::Hold;
use contract::guard::Refusal;
use contract::port::{Bus, Services, config_toml};
use contract::process::Seat;
use contract::realtime::{Board, phase, tell_of_bus_errors};
use contract::topic::Topic;
use rustix::process::Signal;

use children::{Children, Process, wait};
use end::Departure;
pub use end::{Ended, StartError};
use host::Host;
pub use host::HostEvent;

use crate::log::Record;
use crate::provenance::{Scheduling, scheduling_of};
use crate::recorder::{LogOutcome, Observers};
use crate::supervisor::{Event, Order, Supervisor, plant_tick};

/// How long children may take to join, and nodes to leave.
const JOIN_LIMIT: Duration = Duration::from_secs(10);
const LEAVE_LIMIT: Duration = Duration::from_secs(1);
/// The recorder may have a slow disk to empty its last chunk to.
const CLOSE_LIMIT: Duration = Duration::from_secs(30);
const RECORDER: &str = "recorder";

/// What a flight through processes leaves behind, beside the messages.
pub struct Flown {
    /// How it ended.
    pub ended: Ended,
    /// The recorder's last word.
    pub log: Option<LogOutcome>,
    /// Wall time from GO to the end.
    pub wall: Duration,
    /// What every node obtained from the kernel.
    pub scheduling: Vec<(String, Scheduling)>,
    /// What happened to the processes.
    pub events: Vec<Event>,
    /// What happened around them.
    pub host: Vec<HostEvent>,
    /// Messages refused, by listener and cause.
    pub refused: Vec<(&'static str, [u32; Refusal::ALL.len()])>,
}

/// A stack whose processes are all there. Dropping it kills what is left and wipes shared memory.
pub struct Stack {
    children: Children,
    supervisor: Supervisor,
    host: Host,
    board: std::sync::Arc<Board>,
    observers: Observers,
    // Dropped in this order: the services before the domain that holds their files.
    services: Services,
    _bus: Bus,
    _hold: Hold,
}

impl Stack {
    /// Starts the processes of `scenario` in `namespace`, with a recorder if `log` names a file.
    pub fn start(
        namespace: &str,
        scenario: &Scenario,
        log: Option<&Path>,
        interrupts: &AtomicU32,
    ) -> anyhow::Result<Self> {
        tell_of_bus_errors();
        let hold = Hold::take(namespace)?;
        let domain = &hold.domain;
        let shm = |what| move || format!("cannot write {what} in shared memory");
        std::fs::write(domain.file("scenario.toml"), contract::scenario::to_toml(scenario))
            .with_context(shm("settings"))?;
        std::fs::write(domain.file("iceoryx2.toml"), config_toml(domain)).with_context(shm("iceoryx2.toml"))?;
        Board::create(&domain.file("board")).with_context(shm("the board"))?;
        let bus = Bus::attach(domain)?;
        let services = bus.create_services()?;
        hold.tighten()?;
        let seat = Seat::join(namespace, "launcher", 1)?;
        let observers = Observers::join(&seat)?;
        let supervisor = Supervisor::new(scenario);
        let host = Host::new(domain.clone(), scenario)?;
        let mut stack = Self {
            children: Children::new(domain.clone()),
            supervisor,
            host,
            board: seat.board,
            observers,
            services,
            _bus: bus,
            _hold: hold,
        };
        for topic in Topic::ALL {
            stack.board.office(topic).holder.set(1);
            stack.hire(topic, 1)?;
        }
        match log {
            Some(path) => stack.children.spawn(RECORDER, None, 1, Some(path))?,
            None => stack.board.recorded().raise(u32::MAX), // nobody records, so nobody is to be waited for
        }
        stack.wait_until_joined(1 + usize::from(log.is_some()), interrupts)?;
        Ok(stack)
    }

    /// Flies: `watch` sees every message, `tick` is called at every look around, while all are there.
    pub fn fly(mut self, interrupts: &AtomicU32, mut watch: impl FnMut(Record), mut tick: impl FnMut()) -> Flown {
        let mut scheduling = vec![];
        let started = Instant::now();
        self.board.set_phase(phase::GO);
        let ended = loop {
            let newest = self.drain(&mut watch);
            if scheduling.is_empty() && newest > 0 {
                // Everybody has been round once, and so has long settled into the class it got.
                scheduling =
                    self.children.all.iter().map(|p| (p.name.to_owned(), scheduling_of(p.child.id()))).collect();
            }
            if interrupts.load(Ordering::Relaxed) > 0 {
                break Ended::Interrupted;
            }
            self.host.look(plant_tick(&self.board), &self.children);
            if let Some(ended) = self.supervise() {
                break ended;
            }
            tick();
            self.children.sleep();
        };
        let given_up = self.supervisor.given_up();
        let wall = started.elapsed();
        let (lost, log) = self.stop(interrupts, &mut watch);
        self.host.finish(plant_tick(&self.board), interrupts);
        // A node that fails while leaving has still failed.
        let ended = match (ended, lost.or(given_up.map(str::to_owned))) {
            (Ended::Lost(name), Some(other)) if name != other => Ended::Lost(format!("{name}; {other}")),
            (Ended::Lost(name), _) | (Ended::Flown | Ended::Late(_), Some(name)) => Ended::Lost(name),
            (other, _) => other,
        };
        let count = |topic: Topic| {
            (topic.publisher(), Refusal::ALL.map(|r| self.board.office(topic).refused[r as usize].get()))
        };
        let refused = Topic::ALL.map(count).into();
        let (events, host) = (std::mem::take(&mut self.supervisor.events), std::mem::take(&mut self.host.events));
        Flown { ended, log, wall, scheduling, events, host, refused }
    }

    /// Sees to it that everybody is there who should be; how the flight has ended, if it has.
    fn supervise(&mut self) -> Option<Ended> {
        while let Some((i, how)) = self.children.departed() {
            let Process { name, topic, epoch, .. } = self.children.all[i];
            match (topic, how) {
                (Some(Topic::State), Departure::Well) => return Some(Ended::Flown),
                (_, Departure::Late) => return Some(Ended::Late(name.into())),
                (Some(topic), how) => {
                    if !self.supervisor.died(&self.board, topic, epoch) {
                        return Some(Ended::Lost(how.tell(name)));
                    }
                    self.children.bury(i);
                }
                (None, how) => return Some(Ended::Lost(how.tell(name))),
            }
        }
        for order in self.supervisor.orders(&self.board) {
            match order {
                Order::Start(topic, epoch) => {
                    if let Err(error) = self.hire(topic, epoch) {
                        return Some(Ended::Lost(format!("{} ({error:#})", topic.publisher())));
                    }
                }
                Order::Kill(topic) => self.children.signal(topic, Signal::KILL),
                Order::Stop(topic) => self.children.signal(topic, Signal::STOP),
                Order::Continue(topic) => self.children.signal(topic, Signal::CONT),
            }
        }
        None
    }

    /// Starts the process number `epoch` of the node that speaks on `topic`, and keeps a place for it.
    fn hire(&mut self, topic: Topic, epoch: u32) -> anyhow::Result<()> {
        self.board.office(topic).offer(epoch);
        self.children.spawn(topic.publisher(), Some(topic), epoch, None)
    }

    /// Waits until every topic has its publisher and all its subscribers; `observers` of them are not nodes.
    fn wait_until_joined(&mut self, observers: usize, interrupts: &AtomicU32) -> Result<(), StartError> {
        let deadline = Instant::now() + JOIN_LIMIT;
        let missing = |services: &Services, topic: Topic| {
            // Three nodes listen to STATE, one to each other topic.
            let listeners = observers + if topic == Topic::State { 3 } else { 1 };
            let (publishers, subscribers) = services.joined(topic);
            publishers < 1 || subscribers < listeners
        };
        while let Some(topic) = Topic::ALL.into_iter().find(|topic| missing(&self.services, *topic)) {
            if interrupts.load(Ordering::Relaxed) > 0 {
                return Err(StartError::Interrupted);
            }
            if let Some((i, _)) = self.children.departed() {
                return Err(StartError::Lost(format!("{} ended", self.children.all[i].name)));
            }
            if Instant::now() > deadline {
                let (publishers, subscribers) = self.services.joined(topic);
                let counts = format!("{publishers} publishers and {subscribers} subscribers");
                return Err(StartError::Lost(format!("after 10 s topic '{}' has {counts}", topic.name())));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    /// Shows `watch` every message that has come, and tells the plant, which waits for it in lockstep; the newest tick.
    fn drain(&self, watch: &mut impl FnMut(Record)) -> u64 {
        let mut newest = 0;
        self.observers.drain(|record| {
            if record.is_whole() {
                newest = newest.max(record.stamp().tick);
            }
            watch(record);
        });
        self.board.watched().raise(newest as u32);
        newest
    }

    /// Nodes first, then the recorder, so that the log has their last messages. A second Ctrl-C kills.
    fn stop(&mut self, interrupts: &AtomicU32, watch: &mut impl FnMut(Record)) -> (Option<String>, Option<LogOutcome>) {
        let mut lost = None;
        self.board.set_phase(phase::LEAVE);
        for process in self.children.all.iter_mut().filter(|process| process.topic.is_some()) {
            let name = process.name;
            match wait(&mut process.child, LEAVE_LIMIT, interrupts) {
                // One that was killed on purpose is an event already; one that broke its budget has been named already, and another that did so meanwhile is no worse.
                Some(status) if process.condemned || !matches!(Departure::of(status), Departure::Badly(_)) => {}
                Some(status) => _ = lost.get_or_insert_with(|| format!("{name} ({status})")),
                None => _ = lost.get_or_insert_with(|| format!("{name} (did not leave within 1 s and was killed)")),
            }
        }
        self.drain(watch);
        self.board.set_phase(phase::CLOSE);
        let recorder = self.children.all.iter_mut().find(|process| process.name == RECORDER).map(|p| &mut p.child);
        let log = recorder.map(|child| {
            let done = wait(child, CLOSE_LIMIT, interrupts).is_some();
            let mut text = String::new();
            let read = child.stdout.take().map(|mut out| out.read_to_string(&mut text));
            let word = read.and_then(|_| serde_json::from_str(&text).ok()).filter(|_| done);
            word.unwrap_or_else(|| LogOutcome {
                error: Some("the recorder ended before it could close the log".into()),
                ..LogOutcome::default()
            })
        });
        (lost, log)
    }
}
