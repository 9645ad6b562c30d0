//! Every limit and time-out of this crate.

use std::time::Duration;

// Start.

/// A process waits so long before the start for a message of every node it listens to \[ns\]: less than the launcher
/// waits for the process, so that the process can say which node is silent.
pub const PROBE_LIMIT_NS: u64 = 9_000_000_000;
/// Between two probes \[ns\].
pub const PROBE_PERIOD_NS: u64 = 2_000_000;
/// A publisher that is there and not received for so long before the start is connected to anew \[ns\].
pub const RECONNECT_NS: u64 = 300_000_000;
/// Attempts to connect anew.
pub const RECONNECTS: u32 = 10;
/// The plant waits so long for the nodes to wait for its first sample \[ns\].
pub const GATHER_NS: u64 = 100_000_000;
/// From then to its first sample \[ns\].
pub const LEAD_IN_NS: u64 = 5_000_000;
/// Attempts to read a memory, which may be written at the same time.
pub const MEMORY_READS: usize = 100;

// Cycle.

/// Longest sleep without a look at phase and role \[ns\]: a lost wake-up costs no more than this.
pub const LOOK_AROUND_NS: u64 = 100_000_000;
/// From a warm-up to the release \[ns\]: enough for four nodes one after another on one processor.
pub const WARM_UP_LEAD_NS: u64 = 250_000;
/// The warm-up lead is at most this part of the period.
pub const WARM_UP_PARTS: u64 = 4;
/// Lockstep: ticks by which the plant may be ahead of launcher and recorder, who must see them all. A quarter of a
/// queue, because a fault may send every message twice.
pub const LEAD_TICKS: u64 = MIN_OBSERVER_DEPTH as u64 / 4;
/// Messages that a link holds back at once; the oldest is lost beyond that.
pub const HELD_MESSAGES: usize = 64;

// Roles.

/// Epochs of a role that may work at once, or be about to: active, standby, pending and one that is being started.
pub const ROLE_SLOTS: usize = 4;
/// Epochs of a role whose ports are known: a recorder may be behind by some of them.
pub const ROLE_PORTS: usize = 64;

// Ports.

/// Queue of a node: the newest value counts, one more in case it arrives between two looks.
pub const NODE_DEPTH: usize = 2;
/// Shortest queue of an observer.
pub const MIN_OBSERVER_DEPTH: usize = 512;
/// Longest queue of an observer.
pub const MAX_OBSERVER_DEPTH: usize = 2048;
/// An observer may hang so long before it loses messages \[s\]; a recorder that hangs so long is replaced.
pub const OBSERVER_S: usize = 5;
/// Publishers per topic: the node, the one that takes over from it, and dead ones that are not removed yet.
pub const MAX_PUBLISHERS: usize = 16;
/// Subscribers per topic: three nodes with a standby each, two recorders, the launcher; of each node and of the recorder
/// as many dead ones as it takes to give it up, if none is removed yet. A publisher sets memory aside for each.
pub const MAX_SUBSCRIBERS: usize = 24;
/// Attachments to a run, dead ones included.
pub const MAX_NODES: usize = 48;

// Operating system.

/// More than a process maps after its start \[bytes\]: the segments of all processes that may join.
pub const LATER_BYTES: usize = 1 << 30;
/// More files than a connection to one publisher opens.
pub const FILES_OF_A_CONNECTION: usize = 16;
/// A flight makes about a hundred files in shared memory; some more for processes that are replaced.
pub const FILES_NEEDED: u64 = 300;
/// Names that a user's folder in shared memory can have; another user's file can stand under some.
pub const HOME_NAMES: usize = 8;
/// Attempts to take a namespace: a run's folder is locked for a moment by those who look whether the run lives.
pub const NAMESPACE_TRIES: usize = 20;
/// Between two such attempts.
pub const NAMESPACE_PAUSE: Duration = Duration::from_millis(5);

// Console.

/// Lines for stderr that wait to be written; more are dropped.
pub const WAITING_LINES: usize = 256;
/// A process that ends waits so long until its lines are written.
pub const LAST_LINES: Duration = Duration::from_secs(1);
