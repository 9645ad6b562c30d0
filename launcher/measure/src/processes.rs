//! The processes of a stack and its shared memory, seen from outside: by namespace, as a user sees them.

use runtime::domain::Domain;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

/// A process of a stack.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Process {
    pid: Pid,
    /// Its node, `recorder`, or `launcher`.
    pub name: String,
    /// Which incarnation of the node.
    pub epoch: u32,
}

impl Process {
    /// Those that run now in `namespace`; one that has ended and is only waited for does not count.
    pub fn all(namespace: &str) -> Vec<Self> {
        let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
        let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        pids.filter_map(|pid| Self::look(Pid::from_raw(pid)?, namespace)).collect()
    }

    /// The newest of those named `name`.
    pub fn newest(namespace: &str, name: &str) -> Option<Self> {
        Self::all(namespace).into_iter().filter(|process| process.name == name).max_by_key(|process| process.epoch)
    }

    /// Sends `signal`; whether it reached this process and no other that was given its number since.
    pub fn signal(&self, namespace: &str, signal: Signal) -> bool {
        let Ok(pidfd) = pidfd_open(self.pid, PidfdFlags::empty()) else { return false };
        let still = Self::look(self.pid, namespace).is_some_and(|now| now == *self);
        still && pidfd_send_signal(pidfd, signal).is_ok()
    }

    /// Process `pid`, if it belongs to `namespace`: what its command line says.
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

/// What a stack has left when it is over: names in shared memory, and processes.
pub fn left(namespace: &str) -> Vec<String> {
    let folder = Domain::left(namespace).map(|domain| domain.folder.display().to_string());
    folder.into_iter().chain(Process::all(namespace).into_iter().map(|process| process.name)).collect()
}
