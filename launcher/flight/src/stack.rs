//! The ring as processes: start them, watch them, stop them, leave shared memory clean.
//!
//! ```text
//! take the namespace -> create services and page -> start children -> all joined? -> GO
//!   watch: empty the queues, do what the supervisor orders, show progress
//! plant has left, or Ctrl-C, or nobody can go on -> LEAVE -> nodes gone -> CLOSE -> recorder gone -> wipe
//! ```

mod answer;
mod archive;
mod children;
mod driver;
mod end;
mod files;
mod host;
mod live;
mod supervise;
mod surroundings;
mod swaps;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::Scenario;
use contract::guard::Refusal;
use contract::scenario::Fault;
use contract::topic::Topic;
use runtime::domain::{Hold, check_room};
use runtime::observer::Observer;
use runtime::port::{Bus, PortFailure, Services, bytes_needed, observer_depth};
use runtime::realtime::{ControlPage, phase, tell_of_crashes};
use runtime::shared_role::Assignment;

use children::{Children, wait};
use end::ChildExit;
pub use end::{Ended, StartError, refused};
use host::Host;

use crate::control::Server;
use crate::event::{Event, Sender};
use crate::log::Record;
use crate::provenance::{Scheduling, scheduling_of};
use crate::recorder::{LogOutcome, Observers};
use archive::Archive;
use driver::Driver;
use supervise::RECORDER;

use crate::roles::hearing::Hearing;
use crate::roles::realtime::plant_tick;

/// How long children may take to join, and nodes to leave.
const JOIN_LIMIT: Duration = Duration::from_secs(10);
const LEAVE_LIMIT: Duration = Duration::from_secs(1);

/// Messages refused, by listener and cause.
pub type Refused = Vec<(&'static str, [u32; Refusal::ALL.len()])>;

/// How often the ports of each node have failed, by cause; the launcher's own too.
pub type PortFailures = Vec<(&'static str, [u32; PortFailure::ALL.len()])>;

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
    /// What happened.
    pub events: Vec<Event>,
    /// The settings as they were in the end: with the faults and swaps that were ordered while it flew.
    pub scenario: Scenario,
    /// Messages refused, by listener and cause.
    pub refused: Refused,
    /// How often ports have failed, by node.
    pub port_failures: PortFailures,
}

/// A stack whose processes are all there. Dropping it kills what is left and wipes shared memory.
pub struct Stack {
    children: Children,
    driver: Driver,
    /// Everything that happened.
    events: Vec<Event>,
    started: Instant,
    archive: Option<Archive>,
    host: Host,
    page: std::sync::Arc<ControlPage>,
    observers: Observers,
    hearing: Hearing,
    /// Topics that the launcher itself does not hear.
    blind: [bool; Topic::COUNT],
    /// The newest process of each node that was found mute or deaf.
    silenced: [u32; Topic::COUNT],
    /// As it is by now: with what was ordered while it flies.
    scenario: Scenario,
    control: Server,
    /// Who ordered which of the swaps by hand.
    orderers: BTreeMap<usize, Sender>,
    /// Whether it was asked to end.
    stopped: bool,
    /// When the newest message of each topic was sent.
    newest_ns: [u64; Topic::COUNT],
    // Dropped in this order: the services before the domain that holds their files.
    _services: Services,
    _bus: Bus,
    hold: Hold,
}

impl Stack {
    /// Starts the processes of `scenario` in `namespace`, with a recorder if `log` names a file.
    pub fn start(
        namespace: &str,
        scenario: &Scenario,
        log: Option<&Path>,
        interrupts: &AtomicU32,
    ) -> anyhow::Result<Self> {
        tell_of_crashes();
        surroundings::check(scenario.run.rate_hz)?;
        let hold = Hold::take(namespace)?;
        check_room(bytes_needed(scenario.run.rate_hz))?; // what a killed launcher has left is wiped by now
        let domain = &hold.domain;
        let shm = |what| move || format!("cannot write {what} in shared memory");
        domain.write("scenario.toml", &contract::scenario::to_toml(scenario)).with_context(shm("settings"))?;
        ControlPage::create(&domain.file("page")).with_context(shm("the page"))?;
        let bus = Bus::attach(domain)?;
        let services = bus.create_services(observer_depth(scenario.run.rate_hz))?;
        let mut observer = Observer::join(namespace)?;
        let observers = Observers::join(&mut observer)?;
        let host = Host::new(domain.clone(), scenario)?;
        let mut stack = Self {
            children: Children::new(domain.clone()),
            driver: Driver::new(scenario),
            events: vec![],
            started: Instant::now(),
            archive: log.map(|path| Archive::new(path, scenario)),
            host,
            page: observer.ports.page.clone(),
            observers,
            hearing: Hearing::default(),
            blind: [false; Topic::COUNT],
            silenced: [0; Topic::COUNT],
            scenario: scenario.clone(),
            control: Server::open(domain).with_context(shm("the control socket"))?,
            orderers: BTreeMap::new(),
            stopped: false,
            newest_ns: [0; Topic::COUNT],
            _services: services,
            _bus: bus,
            hold,
        };
        for topic in Topic::ALL {
            stack.page.role(topic).assign(0, |_| Assignment { active: 1, standby: 0 });
            stack.start_node(topic, 1, None)?;
        }
        stack.start_recorder()?;
        stack.wait_until_ready(&mut observer, interrupts)?;
        Ok(stack)
    }

    /// Flies: `watch` sees every message; `tick` is called at every look around, while all are there, with the faults as
    /// they are by then.
    pub fn fly(
        mut self,
        interrupts: &AtomicU32,
        mut watch: impl FnMut(Record),
        mut tick: impl FnMut(&[Fault]),
    ) -> Flown {
        // Every process has entered its class before it said that it is ready; reading takes longer than a tick may wait.
        let scheduling = self.children.all.iter().map(|p| (p.name.to_owned(), scheduling_of(p.child.id()))).collect();
        let started = Instant::now();
        self.page.set_phase(phase::GO);
        let ended = loop {
            let question = self.driver.question(&self.page); // before the look: all that was sent before it is here
            let ready = Topic::ALL.map(|topic| self.page.role(topic).ready.get());
            self.drain(&mut watch);
            Topic::ALL.into_iter().zip(ready).for_each(|(topic, epoch)| self.page.role(topic).met.set(epoch));
            if interrupts.load(Ordering::Relaxed) > 0 || self.stopped {
                break Ended::Interrupted;
            }
            let events = self.host.look(plant_tick(&self.page), &self.children);
            self.events.extend(events);
            self.listen();
            if let Some(ended) = self.supervise(question) {
                break ended;
            }
            self.tell_events();
            self.attend();
            tick(&self.scenario.fault);
            self.children.sleep(self.control.sources(), self.driver.due(&self.page));
        };
        let given_up = self.driver.given_up();
        let wall = started.elapsed();
        self.settle_swaps();
        let (lost, log) = self.stop(interrupts, &mut watch);
        let events = self.host.finish(plant_tick(&self.page), interrupts);
        self.events.extend(events);
        // A node that fails while leaving has still failed.
        let ended = match (ended, lost.or(given_up.map(str::to_owned))) {
            (Ended::Lost(name), Some(other)) if name != other => Ended::Lost(format!("{name}; {other}")),
            (Ended::Lost(name), _) | (Ended::Flown | Ended::Late(_), Some(name)) => Ended::Lost(name),
            (Ended::Flown, None) => self.unseen().map_or(Ended::Flown, Ended::Unseen),
            (other, _) => other,
        };
        let count =
            |topic: Topic| (topic.publisher(), Refusal::ALL.map(|r| self.page.role(topic).refused[r as usize].get()));
        let refused = Topic::ALL.map(count).into();
        let port_failures = self.port_failures();
        let events = std::mem::take(&mut self.events);
        Flown { ended, log, wall, scheduling, events, scenario: self.scenario.clone(), refused, port_failures }
    }

    /// What the launcher has not seen of the messages that were sent: without them a flight has no figures to be trusted.
    fn unseen(&self) -> Option<String> {
        let missing = |topic: Topic| {
            let sent = u64::from(self.page.role(topic).sent_by_all.get());
            Some((topic, sent.saturating_sub(self.observers.drained(topic)))).filter(|(_, missing)| *missing > 0)
        };
        let (topic, missing) = Topic::ALL.into_iter().find_map(missing)?;
        Some(format!("{missing} messages on topic '{}' were sent that the launcher did not see", topic.name()))
    }

    fn port_failures(&self) -> PortFailures {
        let count = |topic: Topic| {
            let failures = &self.page.role(topic).port_failures;
            (topic.publisher(), PortFailure::ALL.map(|failure| failures[failure as usize].get()))
        };
        Topic::ALL.map(count).into_iter().chain([("launcher", [0, self.observers.failures()])]).collect()
    }

    /// Waits until everybody is ready: every process has received something of everybody it listens to.
    fn wait_until_ready(&mut self, observer: &mut Observer, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let deadline = Instant::now() + JOIN_LIMIT;
        loop {
            let silent = observer.ports.probe_once().map_err(|error| StartError::Lost(error.to_string()))?;
            let Some(name) = silent.or_else(|| self.unready()) else { return Ok(()) };
            if interrupts.load(Ordering::Relaxed) > 0 || self.stopped {
                return Err(StartError::Interrupted.into());
            }
            if let Some((i, how)) = self.children.exited() {
                return Err(StartError::Lost(how.tell(self.children.all[i].name)).into());
            }
            if Instant::now() > deadline {
                let why = format!("after {} s {name} is not ready", JOIN_LIMIT.as_secs());
                return Err(StartError::Lost(why).into());
            }
            self.attend();
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// A process that is not ready yet.
    fn unready(&self) -> Option<&'static str> {
        let topic = Topic::ALL.into_iter().find(|topic| self.page.role(*topic).ready.get() == 0);
        let recorder = || (self.archive.is_some() && self.page.archive().ready.get() == 0).then_some(RECORDER);
        topic.map(Topic::publisher).or_else(recorder)
    }

    /// Shows `watch` every message that has come, and tells the plant, which waits for it in lockstep.
    fn drain(&mut self, watch: &mut impl FnMut(Record)) {
        let mut newest = 0;
        let Self { newest_ns, driver, archive, observers, .. } = self;
        observers.drain(|record| {
            if record.is_intact() {
                let (stamp, topic) = (record.stamp(), record.topic() as usize);
                newest = newest.max(stamp.tick);
                newest_ns[topic] = newest_ns[topic].max(stamp.publish_ns[topic]);
            }
            driver.observe(&record);
            if let Some(archive) = archive {
                archive.observe(&record);
            }
            watch(record);
        });
        self.page.watched().raise(newest as u32);
    }

    /// Nodes first, then the recorder, so that the log has their last messages. A second Ctrl-C kills.
    fn stop(&mut self, interrupts: &AtomicU32, watch: &mut impl FnMut(Record)) -> (Option<String>, Option<LogOutcome>) {
        let mut lost = None;
        self.drain(watch); // nodes that are still here are not gone by the next look
        self.wait_for_recorder(|page| page.recorded().count() >= page.watched().count());
        self.page.set_phase(phase::LEAVE);
        for process in self.children.all.iter_mut().filter(|process| process.topic.is_some()) {
            let name = process.name;
            match wait(&mut process.child, name, LEAVE_LIMIT, interrupts) {
                // A candidate, or who stood by, leaves as it likes; one that was killed on purpose is an event already; one that
                // broke its budget has been named already, and another that did so meanwhile is no worse.
                _ if process.topic.is_none_or(|topic| self.page.role(topic).active() != process.epoch) => {}
                Some(status) if process.condemned || !matches!(ChildExit::of(status), ChildExit::Badly(_)) => {}
                Some(status) => _ = lost.get_or_insert_with(|| format!("{name} ({status})")),
                None => _ = lost.get_or_insert_with(|| format!("{name} (did not leave within 1 s and was killed)")),
            }
        }
        self.drain(watch);
        self.tell_events();
        self.page.set_phase(phase::CLOSE);
        let log = self.close_log(interrupts);
        (lost, log)
    }
}
