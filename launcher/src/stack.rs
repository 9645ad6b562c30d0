//! The ring as processes: start them, watch them, stop them, leave shared memory clean.
//!
//! ```text
//! take the namespace -> create services and board -> start children -> all joined? -> GO
//!   watch: empty the queues, look after the children, show progress
//! plant has left, or Ctrl-C, or a child died -> LEAVE -> nodes gone -> CLOSE -> recorder gone -> wipe
//! ```

mod end;

use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::Scenario;
use contract::domain::Hold;
use contract::port::{Bus, Services, config_toml};
use contract::process::Seat;
use contract::realtime::{Board, phase};
use contract::topic::{NODES, Topic};

use end::Departure;
pub use end::{Ended, StartError};

use crate::log::Record;
use crate::provenance::{Scheduling, scheduling_of};
use crate::recorder::{LogOutcome, Observers};

/// How long children may take to join, and nodes to leave.
const JOIN_LIMIT: Duration = Duration::from_secs(10);
const LEAVE_LIMIT: Duration = Duration::from_secs(1);
/// The recorder may have a slow disk to empty its last chunk to.
const CLOSE_LIMIT: Duration = Duration::from_secs(30);
/// How often the queues and the children are looked at.
const POLL: Duration = Duration::from_millis(5);

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
}

/// A stack whose processes are all there. Dropping it kills what is left and wipes shared memory.
pub struct Stack {
    children: Vec<(String, Child)>,
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
        let hold = Hold::take(namespace)?;
        let domain = &hold.domain;
        let shm = |what| move || format!("cannot write {what} in shared memory");
        std::fs::write(domain.file("scenario.toml"), contract::scenario::to_toml(scenario))
            .with_context(shm("settings"))?;
        std::fs::write(domain.file("iceoryx2.toml"), config_toml(domain)).with_context(shm("iceoryx2.toml"))?;
        Board::create(&domain.file("board")).with_context(shm("the board"))?;
        let bus = Bus::attach(domain)?;
        let services = bus.create_services()?;
        let seat = Seat::join(namespace, "launcher")?;
        let observers = Observers::join(&seat)?;
        let mut stack = Self { children: vec![], board: seat.board, observers, services, _bus: bus, _hold: hold };
        for node in NODES {
            stack.spawn(node, namespace, None)?;
        }
        match log {
            Some(path) => stack.spawn("recorder", namespace, Some(path))?,
            None => stack.board.recorded().raise(u32::MAX), // nobody records, so nobody is to be waited for
        }
        stack.wait_until_joined(1 + usize::from(log.is_some()), interrupts)?;
        Ok(stack)
    }

    /// Flies: `watch` sees every message, `tick` is called at every look around.
    pub fn fly(mut self, interrupts: &AtomicU32, mut watch: impl FnMut(Record), mut tick: impl FnMut()) -> Flown {
        let mut scheduling = vec![];
        let started = Instant::now();
        self.board.set_phase(phase::GO);
        let ended = loop {
            let newest = self.drain(&mut watch);
            if scheduling.is_empty() && newest > 0 {
                // Everybody has been round once, and so has long settled into the class it got.
                scheduling = self.children.iter().map(|(name, c)| (name.clone(), scheduling_of(c.id()))).collect();
            }
            tick();
            if interrupts.load(Ordering::Relaxed) > 0 {
                break Ended::Interrupted;
            }
            match self.departed() {
                None => std::thread::sleep(POLL),
                Some((name, Departure::Well)) if name == "plant" => break Ended::Flown,
                Some((name, Departure::Late)) => break Ended::Late(name),
                Some((name, Departure::Well)) => break Ended::Lost(name),
                Some((name, Departure::Badly(how))) => break Ended::Lost(format!("{name} ({how})")),
            }
        };
        let wall = started.elapsed();
        let (lost, log) = self.stop(interrupts, &mut watch);
        // A node that fails while leaving has still failed.
        let ended = match (ended, lost) {
            (Ended::Lost(name), Some(other)) if name != other => Ended::Lost(format!("{name}; {other}")),
            (Ended::Lost(name), _) | (Ended::Flown | Ended::Late(_), Some(name)) => Ended::Lost(name),
            (other, _) => other,
        };
        Flown { ended, log, wall, scheduling }
    }

    fn spawn(&mut self, name: &str, namespace: &str, log: Option<&Path>) -> anyhow::Result<()> {
        let program = std::env::current_exe().context("cannot find this program's own file")?;
        let mut command = Command::new(program);
        command.args(["node", name, "--namespace", namespace]).stdin(Stdio::null()).stdout(Stdio::piped());
        if let Some(path) = log {
            command.arg("--log").arg(path);
        }
        // A group of its own: a Ctrl-C in the terminal reaches the launcher only, which then stops the nodes in order.
        let child = command.process_group(0).spawn().with_context(|| format!("cannot start {name}"))?;
        self.children.push((name.into(), child));
        Ok(())
    }

    /// Waits until every topic has its publisher and all its subscribers; `observers` of them are not nodes.
    fn wait_until_joined(&mut self, observers: usize, interrupts: &AtomicU32) -> Result<(), StartError> {
        let deadline = Instant::now() + JOIN_LIMIT;
        let missing = |services: &Services, topic: Topic| {
            // guidance and attitude-mpc listen to STATE, one node to each other topic.
            let listeners = observers + if topic == Topic::State { 2 } else { 1 };
            let (publishers, subscribers) = services.joined(topic);
            publishers < 1 || subscribers < listeners
        };
        while let Some(topic) = Topic::ALL.into_iter().find(|topic| missing(&self.services, *topic)) {
            if interrupts.load(Ordering::Relaxed) > 0 {
                return Err(StartError::Interrupted);
            }
            if let Some((name, _)) = self.departed() {
                return Err(StartError::Lost(format!("{name} ended")));
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
            newest = newest.max(record.stamp().tick);
            watch(record);
        });
        self.board.watched().raise(newest as u32);
        newest
    }

    /// A child that has ended, and how; one that did not end well is named first.
    fn departed(&mut self) -> Option<(String, Departure)> {
        let ended = self.children.iter_mut().filter_map(|(name, child)| {
            let status = child.try_wait().ok().flatten()?;
            Some((name.clone(), Departure::of(status)))
        });
        ended.max_by_key(|(_, how)| how.gravity())
    }

    /// Nodes first, then the recorder, so that the log has their last messages. A second Ctrl-C kills.
    fn stop(&mut self, interrupts: &AtomicU32, watch: &mut impl FnMut(Record)) -> (Option<String>, Option<LogOutcome>) {
        let mut lost = None;
        self.board.set_phase(phase::LEAVE);
        let nodes = self.children.iter().filter(|(name, _)| name != "recorder").count();
        for (name, child) in &mut self.children[..nodes] {
            match wait(child, LEAVE_LIMIT, interrupts) {
                // One that broke its budget has been named already, and another that did so meanwhile is no worse.
                Some(status) if !matches!(Departure::of(status), Departure::Badly(_)) => {}
                Some(status) => _ = lost.get_or_insert_with(|| format!("{name} ({status})")),
                None => _ = lost.get_or_insert_with(|| format!("{name} (did not leave within 1 s and was killed)")),
            }
        }
        self.drain(watch);
        self.board.set_phase(phase::CLOSE);
        let recorder = self.children.get_mut(nodes).map(|(_, child)| child);
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

impl Drop for Stack {
    fn drop(&mut self) {
        for (_, child) in &mut self.children {
            // Fails for those that have ended already, which is what is wanted.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Waits for `child` to end by itself and says how; kills it after `limit` or at a second interrupt.
fn wait(child: &mut Child, limit: Duration, interrupts: &AtomicU32) -> Option<ExitStatus> {
    let deadline = Instant::now() + limit;
    loop {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        if Instant::now() > deadline || interrupts.load(Ordering::Relaxed) > 1 {
            let _ = child.kill();
            let _ = child.wait();
            return None;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}
