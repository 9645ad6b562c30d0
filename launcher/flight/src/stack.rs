//! Ring of processes: starts them, watches them, stops them, and leaves shared memory clean.
//!
//! ```text
//! take the namespace -> create services and page -> start children -> all joined? -> GO
//!   watch: empty the queues, do what the roles order, show progress
//! plant has left, or Ctrl-C, or the ring cannot go on -> LEAVE -> nodes gone -> CLOSE -> recorder gone -> wipe
//! ```
//!
//! | module | holds |
//! |---|---|
//! | `children` | the processes: start, signal, wait, clear away |
//! | `run` | the processes with what they share; carries out the orders of their roles |
//! | `archive` | the recorder, its role and its files |
//! | `rest` | the part of the log that the launcher writes after a recorder has died |
//! | `requests`, `swaps` | requests of users in flight; the times that swaps took |
//! | `one_cpu` | the CPU of a flight in lockstep |
//! | `files` | files in shared memory |
//! | `own_domain` | shared memory of a run, created by its launcher |
//! | `surroundings` | checks of the system before the start |
//! | `end` | the ways in which a flight can end |

mod archive;
pub mod children;
mod end;
mod files;
mod one_cpu;
pub mod own_domain;
mod requests;
mod rest;
mod run;
mod surroundings;
mod swaps;

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::message::{Payload, Truth};
use contract::topic::Topic;
pub use ring::ended::{Ended, Refused, refused_by_listener};
use runtime::limits::PROBE_LIMIT_NS;
use runtime::port::PortFailure;
use runtime::ports::Ports;
use runtime::realtime::{phase, tell_of_crashes};
use settings::{Fault, Mode, ProgramKind, Scenario};

use archive::Archive;
use children::{RECORDER, wait};
use end::ChildExit;
pub use end::{StartError, refused};
use files::Files;
use own_domain::OwnDomain;
use requests::Requests;
use run::FlightRun;
pub use surroundings::check_memory;

use crate::circumstances::{Circumstances, PortFailures};
use crate::event::{Event, What};
use crate::limits::{JOIN_LIMIT, LEAVE_LIMIT};
use crate::log::{LogOutcome, Record};
use crate::provenance::{ProcessScheduling, scheduling_of};
use crate::recorder::Observers;
use crate::roles::connections::{Connections, Disconnected};
use ring::roles::role::RoleInput;
use ring::roles::supervised::given_up;

/// Result of a flight in any mode, except its messages.
pub struct FlightResult {
    pub how: Circumstances,
    /// Wall time from GO to the end.
    pub wall: Duration,
    /// Scheduling that each process obtained from the kernel; empty in process.
    pub scheduling: Vec<(String, ProcessScheduling)>,
    /// Settings at the end, with the faults and swaps that were ordered in flight.
    pub scenario: Scenario,
}

/// Stack whose processes are all ready. Dropping it kills the processes that are left and wipes shared memory.
pub struct Stack {
    run: FlightRun,
    archive: Option<Archive>,
    files: Files,
    requests: Requests,
    observers: Observers,
    connections: Connections,
    /// Topics that the launcher itself does not receive.
    not_received: [bool; Topic::COUNT],
    /// Epoch of the newest process of each node that was found cut off; 0 if none was.
    cut_off: [u32; Topic::COUNT],
    /// Scheduling that each process obtained from the kernel.
    pub scheduling: Vec<(String, ProcessScheduling)>,
    _domain: OwnDomain,
}

impl Stack {
    /// Starts the processes of `scenario` in `namespace`, with a recorder if `log` names a file; returns when all are
    /// ready.
    pub fn start(
        namespace: &str,
        scenario: &Scenario,
        log: Option<&Path>,
        interrupts: &AtomicU32,
    ) -> anyhow::Result<Self> {
        tell_of_crashes();
        let (own, mut ports) = OwnDomain::open(namespace, scenario)?;
        let domain = own.domain();
        let mut stack = Self {
            observers: Observers::open(&mut ports, scenario)?,
            files: Files::new(domain.clone()),
            archive: log.map(|path| Archive::new(path, scenario)),
            requests: Requests::open(&domain).context("cannot write the control socket in shared memory")?,
            run: FlightRun::new(domain, ports.page.clone(), scenario),
            connections: Connections::default(),
            not_received: [false; Topic::COUNT],
            cut_off: [0; Topic::COUNT],
            scheduling: vec![],
            _domain: own,
        };
        stack.run.children.outputs = log.and_then(Path::parent).map(Path::to_owned);
        for topic in Topic::ALL {
            stack.run.start_node(topic, 1, None)?;
        }
        match &stack.archive {
            Some(archive) => archive.start(&mut stack.run)?,
            None => stack.run.page.recorded.raise(u32::MAX), // without a recorder, the plant waits for none
        }
        stack.wait_until_ready(&mut ports, interrupts)?;
        // A process enters its scheduling class before it is ready. The class is read here, because reading takes
        // longer than a tick may wait.
        let processes = stack.run.children.all.iter();
        stack.scheduling = processes.map(|p| (p.name().to_owned(), scheduling_of(p.child.id()))).collect();
        Ok(stack)
    }

    /// Flies to the end. `watch` gets every message; `tick` gets, at every look, all faults of the settings and those
    /// given in flight.
    pub fn fly(
        mut self,
        interrupts: &AtomicU32,
        mut watch: impl FnMut(&Record),
        mut tick: impl FnMut(&[Fault]),
    ) -> FlightResult {
        let scheduling = self.scheduling.clone();
        let started = Instant::now();
        let page = self.run.page.clone();
        page.set_phase(phase::GO);
        let ended = loop {
            // Read before the drain, so that every message sent before the question has been drained.
            let question = self.run.driver.question();
            // A process that was ready before this drain is connected to the launcher's ports after it.
            let ready = Topic::ALL.map(|topic| page.role(topic).ready.get());
            self.drain(&mut watch);
            Topic::ALL.into_iter().zip(ready).for_each(|(topic, epoch)| page.role(topic).observed.set(epoch));
            if self.is_interrupted(interrupts) {
                break Ended::Interrupted;
            }
            self.run.events.extend(self.files.events(page.plant_tick(), &self.run.children));
            self.check_connections();
            if let Some(ended) = self.supervise(question) {
                break ended;
            }
            self.requests.tell_recorder(&mut self.run);
            self.requests.answer_one(&mut self.run);
            tick(&self.run.scenario.fault);
            self.run.children.sleep(self.requests.server.sources(), self.run.driver.due());
        };
        let wall = started.elapsed();
        let given_up = given_up(self.run.driver.nodes());
        if self.run.scenario.run.mode == Mode::Realtime {
            swaps::settle(&mut self.run.scenario, &self.run.events); // in lockstep swaps take the times that are set
        }
        let (lost, log) = self.stop(interrupts, &mut watch);
        // A node that fails while leaving has still failed.
        let ended = match (ended, lost.or(given_up.map(str::to_owned))) {
            (Ended::Lost(name), Some(other)) if name != other => Ended::Lost(format!("{name}; {other}")),
            (Ended::Lost(name), _) | (Ended::Flown | Ended::Late(_), Some(name)) => Ended::Lost(name),
            (Ended::Flown, None) => self.unseen().map_or(Ended::Flown, Ended::Unseen),
            (other, _) => other,
        };
        let how = Circumstances {
            ended,
            log,
            events: std::mem::take(&mut self.run.events),
            refused: refused_by_listener(&page),
            port_failures: self.port_failures(),
            observers: vec![],
        };
        FlightResult { how, wall, scheduling, scenario: self.run.scenario.clone() }
    }

    /// Describes the sent messages that the launcher has not seen, if any: figures without them cannot be trusted.
    fn unseen(&self) -> Option<String> {
        let missing = |kind: usize| {
            let (sent, drained) = self.observers.sent_and_drained(kind);
            Some((kind, u64::from(sent).saturating_sub(drained))).filter(|(_, missing)| *missing > 0)
        };
        let (kind, missing) = (0..Record::KINDS).find_map(missing)?;
        let name = Topic::ALL.get(kind).map_or(Truth::NAME, |topic| topic.name());
        Some(format!("{missing} messages of '{name}' were sent that the launcher did not see"))
    }

    fn port_failures(&self) -> PortFailures {
        let count = |topic: Topic| {
            let failures = &self.run.page.role(topic).port_failures;
            (topic.publisher(), PortFailure::ALL.map(|failure| failures[failure as usize].get()))
        };
        Topic::ALL.map(count).into_iter().chain([("launcher", [0, self.observers.failures(), 0])]).collect()
    }

    fn is_interrupted(&self, interrupts: &AtomicU32) -> bool {
        interrupts.load(Ordering::Relaxed) > 0 || self.requests.stopped
    }

    /// Waits until every process is ready, that is, has received a message from each process that it listens to.
    fn wait_until_ready(&mut self, ports: &mut Ports, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let started = Instant::now();
        let deadline = started + JOIN_LIMIT;
        loop {
            let silent = ports.probe_once().map_err(|error| StartError::Lost(error.to_string()))?;
            let Some(name) = silent.or_else(|| self.unready()) else { return Ok(()) };
            if self.is_interrupted(interrupts) {
                return Err(StartError::Interrupted.into());
            }
            if let Some((i, how)) = self.run.children.exited() {
                let process = &self.run.children.all[i];
                process.tell_output();
                // A process that ended because it waited in vain for another is not the reason: the absent process is.
                let waited_ns = started.elapsed().as_nanos() as u64;
                let absent = self.absent().filter(|_| waited_ns >= PROBE_LIMIT_NS);
                let why = absent.map_or_else(|| how.tell(process.name()), |topic| self.not_joined(topic));
                return Err(StartError::Lost(why).into());
            }
            if Instant::now() > deadline {
                let why = || format!("after {} s {name} is not ready", JOIN_LIMIT.as_secs());
                return Err(StartError::Lost(self.absent().map_or_else(why, |topic| self.not_joined(topic))).into());
            }
            self.requests.answer_one(&mut self.run);
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Returns the topic of a process that has taken no place in the run yet, if any.
    fn absent(&self) -> Option<Topic> {
        Topic::ALL.into_iter().find(|topic| !self.run.page.role(*topic).is_taken(1))
    }

    fn not_joined(&self, topic: Topic) -> String {
        let (node, program) = (topic.publisher(), self.run.scenario.node.of(topic));
        let (exec, limit_s) = (&program.exec, PROBE_LIMIT_NS / 1_000_000_000);
        let who = match program.kind() {
            ProgramKind::Own => node.to_owned(),
            ProgramKind::Library | ProgramKind::Executable => format!("`{exec}` of {node}"),
        };
        format!("{who} has not joined the run within {limit_s} s: see docs/controllers.md")
    }

    /// Returns the name of a process that is not ready yet, if any.
    fn unready(&self) -> Option<&'static str> {
        let page = &self.run.page;
        let topic = Topic::ALL.into_iter().find(|topic| page.role(*topic).ready.get() == 0);
        let recorder = || (self.archive.is_some() && page.recorder.ready.get() == 0).then_some(RECORDER);
        topic.map(Topic::publisher).or_else(recorder)
    }

    /// Passes new messages to driver, archive and `watch`, and reports the newest tick to the plant, which waits for it
    /// in lockstep.
    fn drain(&mut self, watch: &mut impl FnMut(&Record)) {
        let mut newest = 0;
        let Self { run, archive, observers, .. } = self;
        observers.drain(|record| {
            if record.is_intact() {
                newest = newest.max(record.tick());
                let topic = record.kind();
                let sent_ns = record.stamped().map_or(0, |(_, stamp)| stamp.publish_ns[topic]);
                run.newest_ns[topic] = run.newest_ns[topic].max(sent_ns);
                if record.stamped().is_none_or(|(_, stamp)| stamp.is_delivered()) {
                    run.newest[topic] = Some(*record);
                }
            }
            run.driver.observe(record);
            if let Some(archive) = archive {
                archive.observe(record);
            }
            watch(record);
        });
        run.page.watched.raise(newest as u32);
    }

    /// Finds the processes that are cut off from others, and has each of them replaced as if it hung.
    fn check_connections(&mut self) {
        let received = Topic::ALL.map(|topic| self.observers.received(topic));
        for found in self.connections.look(&self.run.page, received) {
            let (topic, epoch, why) = match found {
                Disconnected::Sender(topic, epoch) => (topic, epoch, "its messages do not arrive".to_owned()),
                Disconnected::Listener(topic, epoch, of) => {
                    (topic, epoch, format!("it hears nothing of {}", of.publisher()))
                }
                Disconnected::Launcher(of) => {
                    if !std::mem::replace(&mut self.not_received[of as usize], true) {
                        let event = Event::new(self.run.page.plant_tick(), "launcher", 0, What::Hung);
                        self.run.events.push(event.because(format!("it hears nothing of {}", of.publisher())));
                    }
                    continue;
                }
            };
            if std::mem::replace(&mut self.cut_off[topic as usize], epoch) == epoch {
                continue; // the process was killed already; its exit will be seen soon
            }
            self.run.on(topic, RoleInput::Disconnected(epoch, why));
        }
    }

    /// Looks at all processes and carries out the orders of their roles. Returns how the flight has ended, if it has.
    /// In lockstep, answers the plant's `question` once all processes that start with that tick are ready.
    fn supervise(&mut self, question: Option<u64>) -> Option<Ended> {
        let Self { run, archive, .. } = self;
        let tick = question.unwrap_or_else(|| run.page.plant_tick());
        while let Some((i, how)) = run.children.exited() {
            let process = &run.children.all[i];
            process.tell_output();
            let (name, topic, epoch) = (process.name(), process.topic, process.epoch);
            match (topic, how) {
                (None, _) => _ = archive.as_mut().map(|archive| archive.exited(run, i, tick)),
                (Some(Topic::State), ChildExit::Well) if run.page.total_samples.get() > 0 => return Some(Ended::Flown),
                (Some(topic), ChildExit::Late)
                    if topic == Topic::State || run.driver.nodes()[topic as usize].role.is_alone(epoch) =>
                {
                    return Some(Ended::Late(name.into()));
                }
                (Some(Topic::State), how) => return Some(Ended::Lost(how.tell(name))),
                (Some(topic), _) => run.on(topic, RoleInput::Exited(epoch)),
            }
            run.children.clean_up(i);
        }
        run.look(question);
        if let Some(archive) = archive {
            archive.look(run, tick);
        }
        if archive.as_ref().is_none_or(|archive| archive.role.starting().is_none()) {
            run.driver.done();
        }
        run.stuck().map(Ended::Lost)
    }

    /// Stops the nodes, then the recorder, so that the log has their last messages. A second Ctrl-C kills.
    fn stop(
        &mut self,
        interrupts: &AtomicU32,
        watch: &mut impl FnMut(&Record),
    ) -> (Option<String>, Option<LogOutcome>) {
        let mut lost = None;
        self.drain(watch); // while the nodes and their ports are still there
        let page = self.run.page.clone();
        Archive::catch_up(&page);
        page.set_phase(phase::LEAVE);
        self.run.children.go_on(); // a fault may have stopped a process
        for process in self.run.children.all.iter_mut().filter(|process| process.topic.is_some()) {
            let name = process.name();
            process.awaited = true;
            match wait(&mut process.child, name, LEAVE_LIMIT, interrupts) {
                // A candidate or standby may leave in any way. A process killed on purpose is in the events already. A
                // process that broke its timing budget, and so ended the run, was named already; a process that breaks
                // its budget while it leaves does not matter.
                _ if process.topic.is_none_or(|topic| page.role(topic).active() != process.epoch) => {}
                Some(status) if process.killed || !matches!(ChildExit::of(status), ChildExit::Badly(_)) => {}
                Some(status) => {
                    process.tell_output();
                    lost.get_or_insert_with(|| format!("{name} ({status})"));
                }
                None => {
                    let limit_s = LEAVE_LIMIT.as_secs();
                    lost.get_or_insert_with(|| format!("{name} (did not leave within {limit_s} s and was killed)"));
                }
            }
        }
        self.drain(watch);
        self.requests.tell_recorder(&mut self.run);
        page.set_phase(phase::CLOSE);
        let log = self.archive.take().map(|archive| archive.close(&mut self.run, interrupts));
        (lost, log)
    }
}
