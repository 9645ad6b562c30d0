//! The launcher's children: start, signal, wait, and clear away what they leave.

use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::domain::Domain;
use contract::port::Bus;
use contract::topic::Topic;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, pidfd_open};
use rustix::time::Timespec;

use super::end::Departure;

const BURIAL_LIMIT: Duration = Duration::from_millis(500);

/// A child.
pub struct Process {
    /// Node or recorder.
    pub name: &'static str,
    /// The topic it speaks on; none for the recorder.
    pub topic: Option<Topic>,
    /// Which incarnation of the node.
    pub epoch: u32,
    /// Itself.
    pub child: Child,
    /// Whether it was killed on purpose.
    pub condemned: bool,
    /// Becomes readable when it ends.
    pidfd: Option<OwnedFd>,
}

/// All children of a run. Dropping it kills those that are left.
pub struct Children {
    domain: Domain,
    /// Those that have not been seen to end.
    pub all: Vec<Process>,
    undertakers: Vec<JoinHandle<()>>,
}

impl Children {
    /// None yet.
    pub fn new(domain: Domain) -> Self {
        Self { domain, all: vec![], undertakers: vec![] }
    }

    /// Starts one.
    pub fn spawn(
        &mut self,
        name: &'static str,
        topic: Option<Topic>,
        epoch: u32,
        log: Option<&Path>,
    ) -> anyhow::Result<()> {
        let program = std::env::current_exe().context("cannot find this program's own file")?;
        let mut command = Command::new(program);
        command.args(["node", name, "--namespace", self.domain.namespace(), "--epoch", &epoch.to_string()]);
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        if let Some(path) = log {
            command.arg("--log").arg(path);
        }
        // A group of its own: a Ctrl-C in the terminal reaches the launcher only, which then stops the nodes in order.
        let child = command.process_group(0).spawn().with_context(|| format!("cannot start {name}"))?;
        let pidfd = Pid::from_raw(child.id() as i32).and_then(|pid| pidfd_open(pid, PidfdFlags::empty()).ok());
        self.all.push(Process { name, topic, epoch, child, condemned: false, pidfd });
        Ok(())
    }

    /// One that has ended, and how; one that did not end well is told first.
    pub fn departed(&mut self) -> Option<(usize, Departure)> {
        let ended = self.all.iter_mut().enumerate().filter_map(|(i, process)| {
            let status = process.child.try_wait().ok().flatten()?;
            Some((i, Departure::of(status)))
        });
        ended.max_by_key(|(_, how)| how.gravity())
    }

    /// Forgets one that has ended, and has what it left removed from the services: by a thread of its own, because that
    /// takes longer than a process may be missing.
    pub fn bury(&mut self, i: usize) {
        self.all.remove(i);
        let domain = self.domain.clone();
        let bury = move || {
            if let Ok(bus) = Bus::attach(&domain) {
                bus.bury_the_dead();
            }
        };
        self.undertakers.retain(|undertaker| !undertaker.is_finished());
        self.undertakers.extend(std::thread::Builder::new().name("undertaker".into()).spawn(bury).ok());
    }

    /// Signals every process of a node that is there now.
    pub fn signal(&mut self, topic: Topic, signal: Signal) {
        for process in self.all.iter_mut().filter(|process| process.topic == Some(topic)) {
            process.condemned |= signal == Signal::KILL;
            // Fails for one that has just ended, which the next look around finds.
            let _ = Pid::from_raw(process.child.id() as i32).map(|pid| kill_process(pid, signal));
        }
    }

    /// Sleeps until one ends, which is noticed at once, or until it is time to look around.
    pub fn sleep(&self, until: Instant) {
        let mut ends: Vec<PollFd> =
            self.all.iter().filter_map(|p| p.pidfd.as_ref()).map(|fd| PollFd::new(fd, PollFlags::IN)).collect();
        let left = Timespec::try_from(until.saturating_duration_since(Instant::now())).ok();
        let _ = poll(&mut ends, left.as_ref()); // an early return is a look around too soon
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        for Process { child, .. } in &mut self.all {
            // Fails for those that have ended already, which is what is wanted.
            let _ = child.kill();
            let _ = child.wait();
        }
        // Whoever is at it still would leave traces of its own in what is wiped next; one that is stuck is not waited for.
        let deadline = Instant::now() + BURIAL_LIMIT;
        while self.undertakers.iter().any(|undertaker| !undertaker.is_finished()) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Waits for `child` to end by itself and says how; kills it after `limit` or at a second interrupt.
pub fn wait(child: &mut Child, limit: Duration, interrupts: &AtomicU32) -> Option<ExitStatus> {
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
