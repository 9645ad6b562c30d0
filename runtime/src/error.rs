//! What can go wrong when a process joins a run or works in it.

use std::io;
use std::path::PathBuf;

use contract::Topic;
use contract::scenario::ScenarioError;

use crate::limits::{FILES_NEEDED, HOME_NAMES, PROBE_LIMIT_NS};

/// Why a domain cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// Another launcher has the namespace.
    #[error(
        "namespace '{0}' is in use by another stack; stop it with `launcher stop --namespace {0}` or fly under another --namespace"
    )]
    InUse(String),
    /// No run there.
    #[error("no stack runs in namespace '{0}' of this user; `launcher status` lists those that do")]
    NotRunning(String),
    /// A name that cannot stand in a file name.
    #[error("'{0}' cannot be a namespace: use 1 to 40 letters, digits, '-' or '_'")]
    BadName(String),
    /// Other users' files stand wherever this user's folder could.
    #[error(
        "files of other users stand under all names that this user's folder can have, {0} to {0}.{last}; remove one of them, as root", last = HOME_NAMES - 1
    )]
    Crowded(PathBuf),
    /// Too little memory.
    #[error(
        "a flight needs {need_mb} MB of shared memory, and /dev/shm has {free_mb} MB free; end other flights, or make it larger \
(as root: `mount -o remount,size=256M /dev/shm`; Docker: `--shm-size 256m`), or fly with --mode inprocess"
    )]
    Full {
        /// What the flight needs.
        need_mb: u64,
        /// What there is.
        free_mb: u64,
    },
    /// Too few names.
    #[error(
        "a flight makes up to {FILES_NEEDED} files in shared memory, and /dev/shm has room for {0}; end other flights, or allow more \
(as root: `mount -o remount,nr_inodes=100k /dev/shm`), or fly with --mode inprocess"
    )]
    NoFiles(u64),
    /// Shared memory refused.
    #[error(
        "shared memory at {path}: {source}; a flight through processes needs a file system in memory at /dev/shm that this user may \
write to (--mode inprocess needs none)"
    )]
    Io {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Why a port cannot be had. The text names the topic and what to do.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The service refused.
    #[error("topic '{topic}': {reason}")]
    Service {
        /// Which topic.
        topic: &'static str,
        /// What this process is short of, or what iceoryx2 said.
        reason: String,
    },
    /// The publisher cannot be connected to.
    #[error("topic '{}': {} cannot be heard: {reason}", .topic.name(), .topic.publisher())]
    Unreachable {
        /// Which topic.
        topic: Topic,
        /// Why.
        reason: String,
    },
    /// The domain itself.
    #[error("shared memory of this run: {0}")]
    Domain(String),
}

/// What a port can fail at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum PortFailure {
    /// A message was not sent.
    Send = 0,
    /// A queue could not be read.
    Receive = 1,
}

impl PortFailure {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Send, Self::Receive];

    /// For people and run.json.
    pub fn name(self) -> &'static str {
        match self {
            Self::Send => "send",
            Self::Receive => "receive",
        }
    }
}

/// Why a process cannot take or keep its session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The run is not there.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Its parent is not the launcher of the run.
    #[error("it belongs to the launcher of namespace '{0}', which did not start it, or has died since")]
    Orphan(String),
    /// A port is refused.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The run's settings cannot be read.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The run's page or settings file cannot be opened.
    #[error("{what}: {why}")]
    Io {
        /// Which file.
        what: String,
        /// Why.
        why: std::io::Error,
    },
    /// A deadline with the policy `stop` was missed.
    #[error(
        "tick {tick}: the message was ready {response_ms:.3} ms after the sample, past its deadline of {deadline_ms} ms"
    )]
    Late {
        /// Which tick.
        tick: u64,
        /// When it was ready \[ms\].
        response_ms: f64,
        /// When it was due \[ms\].
        deadline_ms: f64,
    },
    /// The program names a node that the ring does not have.
    #[error("'{0}' is no node of the ring; the nodes are plant, guidance, attitude-mpc and mixer")]
    UnknownNode(String),
    /// No place was offered to this process, or another process has it.
    #[error(
        "no place for {node} of epoch {epoch}: the launcher starts the processes of its run itself, one for each place"
    )]
    Taken {
        /// Which node.
        node: &'static str,
        /// Which process of it.
        epoch: u32,
    },
    /// Before the start, no message of a node arrived.
    #[error("no message of {node} has arrived within {} s: it has not started, or is stuck", PROBE_LIMIT_NS / 1_000_000_000)]
    Silent {
        /// Which node.
        node: &'static str,
    },
    /// A fault ends the process.
    #[error("tick {tick}: a fault has it end by itself")]
    FaultExit {
        /// Which tick.
        tick: u64,
    },
}
