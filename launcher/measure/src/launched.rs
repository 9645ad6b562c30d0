//! Control of a stack from outside, as by a user: a command starts the stack, the namespace identifies its processes,
//! and signals kill and stop them.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::Topic;
use contract::message::{Message, Stamp};
use contract::stamp::delivery;
use flight::log::Log;
use flight::own_program;
use folder::files::write_whole;
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, now_ns};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use settings::{Scenario, to_toml};

/// Longest wait for a process to appear; exceeds every restart delay.
const PATIENCE: Duration = Duration::from_secs(1);
/// Wall time after which a short flight is killed.
const WATCHDOG: Duration = Duration::from_secs(30);
/// Interval between two looks at the processes.
const LOOK: Duration = Duration::from_millis(1);

/// A process of a stack.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StackProcess {
    pub pid: Pid,
    /// Name of the node, `recorder`, or `launcher`.
    pub name: String,
    pub epoch: u32,
}

impl StackProcess {
    /// Lists the processes that run in `namespace`, without zombies.
    pub fn all(namespace: &str) -> Vec<Self> {
        let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
        let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        pids.filter_map(|pid| Self::look(Pid::from_raw(pid)?, namespace)).collect()
    }

    /// Returns the process `name` with the largest epoch.
    pub fn newest(namespace: &str, name: &str) -> Option<Self> {
        Self::all(namespace).into_iter().filter(|process| process.name == name).max_by_key(|process| process.epoch)
    }

    /// Sends `signal` and returns the time \[ns\]; `None` if the process has ended, even if its number was reused.
    pub fn signal(&self, namespace: &str, signal: Signal) -> Option<u64> {
        let pidfd = pidfd_open(self.pid, PidfdFlags::empty()).ok()?;
        (Self::look(self.pid, namespace)? == *self).then_some(())?;
        let at_ns = now_ns();
        pidfd_send_signal(pidfd, signal).ok().map(|()| at_ns)
    }

    /// Identifies process `pid` by its command line; `None` if it is not in `namespace`.
    fn look(pid: Pid, namespace: &str) -> Option<Self> {
        let line = std::fs::read_to_string(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).ok()?;
        let words: Vec<&str> = line.split('\0').collect();
        let after = |word: &str| words.windows(2).find(|pair| pair[0] == word).map(|pair| pair[1]);
        (after("--namespace")? == namespace).then_some(())?;
        let name = after("node").unwrap_or("launcher").to_owned();
        let epoch = after("--epoch").and_then(|epoch| epoch.parse().ok()).unwrap_or(1);
        Some(Self { pid, name, epoch })
    }
}

/// Running `trefoil fly` in a namespace. Drop kills this launcher, and the processes of its stack end with it.
pub struct Launcher {
    pub namespace: String,
    pub started: Instant,
    child: Child,
}

impl Launcher {
    /// Starts a flight of `scenario`. Writes the run to `run` in `folder`, standard error to `stderr`.
    pub fn start(scenario: &Scenario, namespace: &str, folder: &Path) -> anyhow::Result<Self> {
        let cannot = || format!("cannot write to {}", folder.display());
        fs::create_dir_all(folder).with_context(cannot)?;
        let stderr = File::create(folder.join("stderr")).with_context(cannot)?;
        let file = folder.join("scenario.toml");
        write_whole(&file, to_toml(scenario).as_bytes())?;
        let mut command = own_program();
        command.args(["fly", "--namespace", namespace]).arg(file).arg("--out").arg(folder.join("run"));
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr).spawn();
        let child = child.context("cannot start a flight")?;
        Ok(Self { namespace: namespace.to_owned(), started: Instant::now(), child })
    }

    /// Calls `look` with the namespace until it finds something, the flight ends, or 1 s has passed.
    pub fn wait_for<T>(&mut self, look: impl Fn(&str) -> Option<T>) -> Option<T> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let found = look(&self.namespace);
            if found.is_some() || self.has_ended() || Instant::now() > deadline {
                return found;
            }
            sleep(LOOK);
        }
    }

    /// Waits until the plant has sent a sample, which takes seconds on a loaded machine; `None` if the flight ends
    /// before.
    pub fn wait_for_flight(&mut self) -> Option<ControlPage> {
        let mut page = None;
        while page.is_none() && !self.has_ended() {
            page = self.wait_for(|namespace| {
                let page = ControlPage::open(&Domain::find(namespace).ok()?.file("page")).ok()?;
                (page.role(Topic::State).done(1).get() > 0).then_some(page)
            });
        }
        page
    }

    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|status| status.is_some())
    }

    /// Waits for the end and returns the exit code; `None` if the launcher had to be killed after 30 s.
    pub fn end(self) -> Option<i32> {
        self.end_within(WATCHDOG)
    }

    /// Waits like [`end`](Self::end), up to `limit` after the start.
    pub fn end_within(mut self, limit: Duration) -> Option<i32> {
        while self.started.elapsed() < limit {
            if let Ok(Some(status)) = self.child.try_wait() {
                return status.code();
            }
            sleep(LOOK);
        }
        None
    }

    /// Returns the time from `since_ns`, when the launcher was killed, until the last process of its namespace is gone
    /// \[ms\]; `None` if a process is left after 5 s.
    pub fn until_gone(&mut self, since_ns: u64) -> anyhow::Result<Option<f64>> {
        self.child.wait()?;
        let deadline = Instant::now() + PATIENCE * 5;
        while !StackProcess::all(&self.namespace).is_empty() {
            if Instant::now() > deadline {
                return Ok(None);
            }
            sleep(LOOK);
        }
        Ok(Some(milliseconds(now_ns() - since_ns)))
    }
}

impl Drop for Launcher {
    fn drop(&mut self) {
        // The launcher has ended already, except after an error.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Reads the standard error of the flight in `folder`.
pub fn said(folder: &Path) -> String {
    fs::read_to_string(folder.join("stderr")).unwrap_or_default()
}

/// Returns the time at which epoch `epoch` of `node` sent its first delivered message \[ns\]; `None` for the plant and
/// the recorder.
pub fn first_message_ns(log: &Log, node: &str, epoch: u32) -> Option<u64> {
    fn first<M: Message>(messages: &[M], epoch: u32) -> Option<u64> {
        let mut stamps = messages.iter().map(Message::stamp);
        let is_first = |stamp: &&Stamp| stamp.epoch == u64::from(epoch) && stamp.delivery == delivery::DELIVERED;
        stamps.find(is_first).map(|stamp| stamp.publish_ns[M::TOPIC as usize])
    }
    match node {
        "guidance" => first(&log.references, epoch),
        "attitude-mpc" => first(&log.controls, epoch),
        "mixer" => first(&log.actuators, epoch),
        _ => None,
    }
}

/// Lists leftovers of a stack that has ended: its folder in shared memory, and processes.
pub fn left(namespace: &str) -> Vec<String> {
    let folder = Domain::left(namespace).map(|domain| domain.folder.display().to_string());
    folder.into_iter().chain(StackProcess::all(namespace).into_iter().map(|process| process.name)).collect()
}

pub fn milliseconds(ns: u64) -> f64 {
    ns as f64 / 1e6
}
