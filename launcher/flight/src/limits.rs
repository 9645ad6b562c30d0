//! Every limit and time-out of the launcher while it flies, except those that `[supervision]` sets.

use std::time::Duration;

use runtime::limits::OBSERVER_S;

// Start and end.

/// Smallest limit on open files. The launcher and the recorder have about fifty files open, and four more for every
/// replaced process whose files in shared memory are not removed yet.
pub const FILES_NEEDED: u64 = 128;
/// Smallest stack of the main thread \[bytes\]: a node touches a quarter of it before its loop.
pub const STACK_NEEDED: u64 = 1 << 20;
/// Smallest limit on the memory of a process \[bytes\]; a flight in one process needs half of it.
pub const MEMORY_NEEDED: u64 = 64 << 20;
/// Longest time until all child processes are ready before the flight.
pub const JOIN_LIMIT: Duration = Duration::from_secs(10);
/// Longest time that a node or an intruder may take to end after the run.
pub const LEAVE_LIMIT: Duration = Duration::from_secs(1);
/// Longest wait for the end of a killed process. One that the kernel keeps (frozen, or in a device) is left behind.
pub const KILL_LIMIT: Duration = Duration::from_secs(5);
/// Longest wait until the recorder has taken in all messages: it looks every two milliseconds, unless it is stopped.
pub const CATCH_UP_LIMIT: Duration = Duration::from_secs(1);
/// Longest wait until the recorder has closed its log: it may write its last chunk to a slow disk.
pub const CLOSE_LIMIT: Duration = Duration::from_secs(30);
/// Waits longer than this are reported to the user.
pub const SAY_AFTER: Duration = Duration::from_secs(1);
/// Longest wait for the threads that remove the files of dead processes.
pub const CLEAN_UP_LIMIT: Duration = Duration::from_millis(500);
/// Attempts to create a folder whose parent another run has just removed.
pub const FOLDER_TRIES: u32 = 5;

// Looking at processes.

/// Longest time between two looks at all processes.
pub const LOOK: Duration = Duration::from_millis(5);
/// Real time: shortest time between two looks, for example while a process may hang.
pub const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// Lockstep: time between two looks while the plant waits for an answer, or soon may.
pub const QUICK_LOOK: Duration = Duration::from_micros(100);
/// Time between two looks at the run's files in shared memory.
pub const FILES_LOOK: Duration = Duration::from_millis(100);
/// Delay after which a sample that was due is expected: the plant needs a moment to take it \[ns\].
pub const GRACE_NS: u64 = 500_000;

// Processes that `[supervision]` does not name.

/// Time without a sample after which the plant counts as hung \[ns\].
pub const PLANT_HANG_NS: u64 = 500_000_000;
/// Smallest start limit of a recorder: a disk may be slow \[ns\].
pub const RECORDER_START_NS: u64 = 3_000_000_000;
/// Time without progress after which a recorder counts as hung \[ns\]: its queues then begin to lose messages.
pub const RECORDER_HANG_NS: u64 = OBSERVER_S as u64 * 1_000_000_000;

// Recorder.

/// Pause of the recorder after it found its queues empty.
pub const RECORDER_POLL: Duration = Duration::from_millis(2);
/// Size at which a chunk of the log is closed and handed to the system \[bytes of messages\].
pub const CHUNK_BYTES: usize = 64 * 1024;
/// Time after which a chunk is closed even if it is smaller, and the log is forced to the disk.
pub const FLUSH_PERIOD: Duration = Duration::from_secs(1);
/// Longest record of a log that is read \[bytes\]: a chunk of another program may have some megabytes, decompressed.
pub const MAX_RECORD_BYTES: usize = 64 << 20;
/// Longest index of a log that is used \[bytes\]: the index of a day at 100 Hz has 20 MB. A longer one is ignored.
pub const MAX_INDEX_BYTES: u64 = 64 << 20;
/// Largest number of events of a log that is read.
pub const MAX_EVENTS: usize = 100_000;
/// Longest outcome that a recorder writes at its end \[bytes\]: the capacity of a pipe.
pub const OUTCOME_BYTES: u64 = 65_536;
/// Longest reason of an event \[characters\]. Longer ones are cut, so that the line of the event fits into the pipe.
pub const REASON_CHARS: usize = 500;

// Control socket.

/// Longest request \[bytes\].
pub const REQUEST_BYTES: usize = 4096;
/// Longest time that a client may take to send its request.
pub const REQUEST_LIMIT: Duration = Duration::from_secs(1);
/// Longest wait for an answer. A launcher looks for requests every few milliseconds, unless it is stopped or gone.
pub const ANSWER_LIMIT: Duration = Duration::from_secs(2);
/// Largest number of clients at once. The one that has been silent for the longest is disconnected for a new one.
pub const CLIENTS: usize = 32;
/// Largest number of clients that are accepted at one look.
pub const NEW_CLIENTS: usize = 8;
/// Newest events in the answer to `status`.
pub const STATUS_EVENTS: usize = 8;
/// Largest number of events in one answer, so that it fits into the socket.
pub const ANSWER_EVENTS: usize = 100;
