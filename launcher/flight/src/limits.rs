//! Every limit and time-out of the launcher while it flies, but for what `[supervision]` sets.

use std::time::Duration;

use runtime::limits::OBSERVER_S;

// Start and end.

/// The launcher and the recorder have about fifty files open, and four more for every process that is replaced before
/// what it left is cleared away.
pub const FILES_NEEDED: u64 = 128;
/// Smallest stack of the main thread \[bytes\]: a node touches a quarter of that before its loop.
pub const STACK_NEEDED: u64 = 1 << 20;
/// Smallest limit on the memory of a process \[bytes\]; a flight in one process needs half of it.
pub const MEMORY_NEEDED: u64 = 64 << 20;
/// How long children may take to be ready before the flight.
pub const JOIN_LIMIT: Duration = Duration::from_secs(10);
/// How long a node, or an intruder, may take to leave.
pub const LEAVE_LIMIT: Duration = Duration::from_secs(1);
/// How long a process that was killed may take to end; one that the kernel keeps (frozen, or in a device) is left behind.
pub const KILL_LIMIT: Duration = Duration::from_secs(5);
/// The recorder looks every two milliseconds; one that is stopped is not waited for.
pub const CATCH_UP_LIMIT: Duration = Duration::from_secs(1);
/// The recorder may have a slow disk to empty its last chunk to.
pub const CLOSE_LIMIT: Duration = Duration::from_secs(30);
/// After this long it is said what is waited for.
pub const SAY_AFTER: Duration = Duration::from_secs(1);
/// How long the threads that remove what dead processes left are waited for.
pub const CLEAN_UP_LIMIT: Duration = Duration::from_millis(500);
/// How often a folder is made whose parent another run has just removed.
pub const FOLDER_TRIES: u32 = 5;

// Looking at processes.

/// How often everything is looked at, at least.
pub const LOOK: Duration = Duration::from_millis(5);
/// Real time: how soon again when a process may hang.
pub const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// Lockstep: how often while the plant waits for an answer, or soon may.
pub const QUICK_LOOK: Duration = Duration::from_micros(100);
/// How often the run's files in shared memory are looked at.
pub const FILES_LOOK: Duration = Duration::from_millis(100);
/// A sample is looked for so long after it was due: the plant needs a moment to take it \[ns\].
pub const GRACE_NS: u64 = 500_000;

// Processes that `[supervision]` does not name.

/// A plant that takes no sample for so long hangs \[ns\].
pub const PLANT_HANG_NS: u64 = 500_000_000;
/// A recorder may take so long to start, at least: a disk may be slow \[ns\].
pub const RECORDER_START_NS: u64 = 3_000_000_000;
/// A recorder that takes in nothing for so long hangs \[ns\]: then its queues begin to lose messages.
pub const RECORDER_HANG_NS: u64 = OBSERVER_S as u64 * 1_000_000_000;

// Recorder.

/// How often the recorder empties its queues.
pub const RECORDER_POLL: Duration = Duration::from_millis(2);
/// A chunk of the log is closed and handed to the system when it holds this many bytes of messages...
pub const CHUNK_BYTES: usize = 64 * 1024;
/// ...or when this much time has passed since the last one.
pub const FLUSH_PERIOD: Duration = Duration::from_secs(1);
/// A record of a log that is read is no longer \[bytes\]: a chunk of other programs may have some megabytes, decompressed.
pub const MAX_RECORD_BYTES: usize = 64 << 20;
/// The index of a log is no longer \[bytes\]: that of a day at 100 Hz has 20 MB. One that is longer is not used.
pub const MAX_INDEX_BYTES: u64 = 64 << 20;
/// Events of a log that is read.
pub const MAX_EVENTS: usize = 100_000;
/// The outcome that a recorder writes at its end is no longer \[bytes\]: what a pipe holds.
pub const OUTCOME_BYTES: u64 = 65_536;
/// Longer reasons of events are cut, so that a line fits into the pipe \[characters\].
pub const REASON_CHARS: usize = 500;

// Control socket.

/// A request is no longer than this.
pub const REQUEST_BYTES: usize = 4096;
/// A client may take this long for a request.
pub const REQUEST_LIMIT: Duration = Duration::from_secs(1);
/// A launcher looks around every few milliseconds: one that takes longer to answer is stopped or gone.
pub const ANSWER_LIMIT: Duration = Duration::from_secs(2);
/// Clients at once; one more, and the one that has said nothing for the longest is sent away.
pub const CLIENTS: usize = 32;
/// Clients that are accepted at one look.
pub const NEW_CLIENTS: usize = 8;
/// Events in the answer to `status`: the newest.
pub const STATUS_EVENTS: usize = 8;
/// Events in one answer, so that it fits into the socket.
pub const ANSWER_EVENTS: usize = 100;
