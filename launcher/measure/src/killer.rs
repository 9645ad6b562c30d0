//! The processes of a stack, seen from outside by their namespace as a user sees them, and signals to them.

use contract::Topic;
use contract::message::Stamp;
use contract::stamp::delivery;
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, now_ns};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

/// A process of a stack.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Process {
    pub pid: Pid,
    /// Its node, `recorder`, or `launcher`.
    pub name: String,
    pub epoch: u32,
}

impl Process {
    /// Those that run now in `namespace`, without zombies.
    pub fn all(namespace: &str) -> Vec<Self> {
        let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
        let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        pids.filter_map(|pid| Self::look(Pid::from_raw(pid)?, namespace)).collect()
    }

    /// The newest of those named `name`.
    pub fn newest(namespace: &str, name: &str) -> Option<Self> {
        Self::all(namespace).into_iter().filter(|process| process.name == name).max_by_key(|process| process.epoch)
    }

    /// Sends `signal`, and returns when \[ns\]. `None` when the process has ended, even if its number was given to another.
    pub fn signal(&self, namespace: &str, signal: Signal) -> Option<u64> {
        let pidfd = pidfd_open(self.pid, PidfdFlags::empty()).ok()?;
        (Self::look(self.pid, namespace)? == *self).then_some(())?;
        let at_ns = now_ns();
        pidfd_send_signal(pidfd, signal).ok().map(|()| at_ns)
    }

    /// Process `pid` by its command line, if it belongs to `namespace`.
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

/// When epoch `epoch` of the publisher of `topic` sent its first message that was delivered \[ns\].
pub fn first_message_ns<'a>(stamps: impl IntoIterator<Item = &'a Stamp>, topic: Topic, epoch: u32) -> Option<u64> {
    let is_first = |stamp: &&Stamp| stamp.epoch == u64::from(epoch) && stamp.delivery == delivery::DELIVERED;
    stamps.into_iter().find(is_first).map(|stamp| stamp.publish_ns[topic as usize])
}

/// The control page of the stack in `namespace`.
pub fn page(namespace: &str) -> Option<ControlPage> {
    ControlPage::open(&Domain::find(namespace).ok()?.file("page")).ok()
}

/// What a stack that is over has left: its folder in shared memory, and processes.
pub fn left(namespace: &str) -> Vec<String> {
    let folder = Domain::left(namespace).map(|domain| domain.folder.display().to_string());
    folder.into_iter().chain(Process::all(namespace).into_iter().map(|process| process.name)).collect()
}

pub fn milliseconds(ns: u64) -> f64 {
    ns as f64 / 1e6
}
