//! All limits and time-outs of this crate.

use std::time::Duration;

// Start.

/// Longest wait before the start for a message of every node that a process receives \[ns\]. The launcher waits longer
/// for the process, so that the process can say which node is silent.
pub const PROBE_LIMIT_NS: u64 = 29_000_000_000;
/// Time between two probes \[ns\].
pub const PROBE_PERIOD_NS: u64 = 2_000_000;
/// Time without a message before the start after which a publisher is connected to anew \[ns\].
pub const RECONNECT_NS: u64 = 300_000_000;
/// Largest number of attempts to connect anew: 3 s in all, of the 29 s of [`PROBE_LIMIT_NS`]; chosen, not measured.
pub const RECONNECTS: u32 = 10;
/// Longest time that the plant waits for the nodes before its first sample \[ns\].
pub const GATHER_NS: u64 = 100_000_000;
/// Time from the end of the plant's wait for the nodes to the first sample \[ns\].
pub const LEAD_IN_NS: u64 = 5_000_000;
/// Largest number of attempts to read a snapshot, which may be overwritten at the same time.
pub const MEMORY_READS: usize = 100;

// Cycle.

/// Longest sleep without a look at phase and role \[ns\]; a lost wake-up costs at most this.
pub const LOOK_AROUND_NS: u64 = 100_000_000;
/// Time from a warm-up to the release \[ns\]: enough for four nodes one after another on one processor.
pub const WARM_UP_LEAD_NS: u64 = 250_000;
/// Divisor of the period that gives the longest warm-up lead.
pub const WARM_UP_PARTS: u64 = 4;
/// Lockstep: ticks by which the plant may be ahead of launcher and recorder, which must receive every message. The
/// number is a quarter of a queue, because a fault may send every message twice.
pub const LEAD_TICKS: u64 = MIN_OBSERVER_DEPTH as u64 / 4;
/// Implausible answers in a row, which no receiver accepts, after which a process ends and is replaced.
pub const IMPLAUSIBLE_ANSWERS: u32 = 50;
/// Largest number of messages that a link holds back at once; one more, and the oldest is lost.
pub const HELD_MESSAGES: usize = 64;

// Roles.

/// Largest number of epochs that work for a role or are about to: active, standby, pending, and one being started.
pub const ROLE_SLOTS: usize = 4;
/// Number of newest epochs of a role whose ports are known: a recorder may be some epochs behind.
pub const ROLE_PORTS: usize = 64;

// Ports.

/// Length of a node's queue: a place for the newest message, and one for a message that arrives between two looks.
pub const NODE_DEPTH: usize = 2;
/// Shortest queue of an observer \[messages\].
pub const MIN_OBSERVER_DEPTH: usize = 512;
/// Longest queue of an observer \[messages\].
pub const MAX_OBSERVER_DEPTH: usize = 2048;
/// Longest time that an observer may hang without losing messages \[s\]; a recorder that hangs longer is replaced.
pub const OBSERVER_S: usize = 5;
/// Most publishers per topic: the node's process, the one that replaces it, and dead ones that are not removed yet.
pub const MAX_PUBLISHERS: usize = 16;
/// Most subscribers per topic: three nodes with a standby each, two recorders, the launcher, four observers, and dead
/// processes that are not removed yet. A publisher reserves memory for each subscriber.
pub const MAX_SUBSCRIBERS: usize = 24;
/// Largest number of attachments to a run, those of dead processes included.
pub const MAX_NODES: usize = 48;

// Operating system.

/// Upper bound on the memory that a process maps after its start, for the segments of all processes that may join
/// \[bytes\].
pub const LATER_BYTES: usize = 1 << 30;
/// Upper bound on the files that a connection to one publisher opens.
pub const FILES_OF_A_CONNECTION: usize = 16;
/// Files in shared memory that a flight needs: about a hundred, and more for replaced processes.
pub const FILES_NEEDED: u64 = 300;
/// Number of names that a user's folder in shared memory can have, in case files of other users have some of them.
pub const HOME_NAMES: usize = 8;
/// Number of attempts to take a namespace: a process that checks whether the run lives locks its folder for a moment.
pub const NAMESPACE_TRIES: usize = 20;
/// Pause between two attempts to take a namespace.
pub const NAMESPACE_PAUSE: Duration = Duration::from_millis(5);

// Console.

/// Largest number of lines that wait to be written to stderr; more are dropped.
pub const WAITING_LINES: usize = 256;
/// Longest time that an ending process waits until its lines are written.
pub const LAST_LINES: Duration = Duration::from_secs(1);
