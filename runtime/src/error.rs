//! Errors of a process that joins a run or works in it.

#![expect(missing_docs, reason = "the text of an error says what it is")]

use std::any::Any;
use std::io;
use std::path::PathBuf;

use contract::topic::NODES;
use settings::ScenarioError;

use crate::limits::{FILES_NEEDED, HOME_NAMES, IMPLAUSIBLE_ANSWERS, PROBE_LIMIT_NS};

/// Error when a domain is taken or found.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    #[error(
        "namespace '{0}' is in use by another stack; stop it with `trefoil stop --namespace {0}` or fly under another --namespace"
    )]
    InUse(String),
    #[error("no stack runs in namespace '{0}' of this user; `trefoil status` lists those that do")]
    NotRunning(String),
    #[error("'{0}' cannot be a namespace: use 1 to 40 letters, digits, '-' or '_'")]
    BadName(String),
    #[error(
        "files of other users stand under all names that this user's folder can have, {0} to {0}.{last}; remove one of them, as root", last = HOME_NAMES - 1
    )]
    Crowded(PathBuf),
    #[error(
        "a flight needs {need_mb} MB of shared memory, and /dev/shm has {free_mb} MB free; end other flights, or make it larger \
(as root: `mount -o remount,size=256M /dev/shm`; Docker: `--shm-size 256m`), or fly with --mode inprocess"
    )]
    Full { need_mb: u64, free_mb: u64 },
    #[error(
        "a flight makes up to {FILES_NEEDED} files in shared memory, and /dev/shm has room for {0}; end other flights, or allow more \
(as root: `mount -o remount,nr_inodes=100k /dev/shm`), or fly with --mode inprocess"
    )]
    NoFiles(u64),
    #[error(
        "shared memory at {path}: {source}; a flight through processes needs a file system in memory at /dev/shm that this user may \
write to (--mode inprocess needs none)"
    )]
    Io { path: PathBuf, source: io::Error },
}

/// Error when a port is opened or connected. The text names the topic and the remedy.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    #[error("topic '{name}': {reason}")]
    Service { name: &'static str, reason: String },
    #[error("topic '{name}': {node} cannot be heard: {reason}")]
    Unreachable { name: &'static str, node: &'static str, reason: String },
    #[error("shared memory of this run: {0}")]
    Domain(String),
}

/// Failure of a port in the loop, which is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum PortFailure {
    /// Message that was not sent.
    Send = 0,
    /// Queue that could not be read.
    Receive = 1,
    /// Copy of the process (`fork`) that had the ports of the process, and has ended.
    Copy = 2,
}

impl PortFailure {
    pub const ALL: [Self; 3] = [Self::Send, Self::Receive, Self::Copy];

    pub fn name(self) -> &'static str {
        match self {
            Self::Send => "send",
            Self::Receive => "receive",
            Self::Copy => "copy",
        }
    }
}

/// Error that keeps a process from joining a run or ends its session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error("it belongs to the launcher of namespace '{0}', which did not start it, or has died since")]
    Orphan(String),
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    #[error("{what}: {why}")]
    Io { what: String, why: std::io::Error },
    #[error(
        "tick {tick}: the message was ready {response_ms:.3} ms after the sample, past its deadline of {deadline_ms} ms"
    )]
    Late { tick: u64, response_ms: f64, deadline_ms: f64 },
    #[error("'{0}' is no node of the ring; the nodes are {nodes}", nodes = NODES.join(", "))]
    UnknownNode(String),
    #[error(
        "no place for {node} of epoch {epoch}: the launcher starts the processes of its run itself, one for each place"
    )]
    Taken { node: &'static str, epoch: u32 },
    #[error("no message of {node} has arrived within {} s: it has not started, or is stuck", PROBE_LIMIT_NS / 1_000_000_000)]
    Silent { node: &'static str },
    #[error("{file}: {why}")]
    Foreign { file: String, why: String },
    #[error("{0}")]
    InChild(String),
    #[error("tick {tick}: the last {IMPLAUSIBLE_ANSWERS} answers had numbers that are not finite or out of range")]
    Implausible { tick: u64 },
    #[error("tick {tick}: a fault `exit` ended this process")]
    FaultExit { tick: u64 },
}

/// Returns the message of a panic that was caught.
pub fn words_of_panic(panic: &(dyn Any + Send)) -> &str {
    let said = panic.downcast_ref::<String>().map(String::as_str);
    said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic without a message")
}
