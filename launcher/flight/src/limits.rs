//! Every limit and time-out of the launcher while it flies, except those that `[supervision]` sets.

use std::time::Duration;

// Start and end.

/// Longest time until all child processes are ready before the flight. An interpreter that loads an optimizer needs 2 s
/// of an idle processor, and more than 10 s beside flights in the real-time class.
pub const JOIN_LIMIT: Duration = Duration::from_secs(30);
/// Longest time that a node may take to end after the run. An interpreter may need seconds.
pub const LEAVE_LIMIT: Duration = Duration::from_secs(5);
/// Longest wait for the end of a killed process. A process that the kernel keeps (frozen, or in a device) is left
/// behind.
pub const KILL_LIMIT: Duration = Duration::from_secs(5);
/// Longest wait until the recorder has taken in all messages: a recorder that is not stopped looks every two
/// milliseconds.
pub const CATCH_UP_LIMIT: Duration = Duration::from_secs(1);
/// Longest wait until the recorder has closed its log: the last chunk may go to a slow disk.
pub const CLOSE_LIMIT: Duration = Duration::from_secs(30);
/// Waits longer than this are reported to the user.
pub const SAY_AFTER: Duration = Duration::from_secs(1);
/// Longest wait for the threads that remove the files of dead processes.
pub const CLEAN_UP_LIMIT: Duration = Duration::from_millis(500);

// Looking at processes.

/// Longest time between two looks at all processes: half a period at 100 Hz; chosen, not measured.
pub const LOOK: Duration = Duration::from_millis(5);
/// Real time: shortest time between two looks, for example while a process may hang.
pub const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// Lockstep: time between two looks while the plant waits for an answer, or soon may.
pub const QUICK_LOOK: Duration = Duration::from_micros(100);
/// Time between two looks at the run's files in shared memory.
pub const FILES_LOOK: Duration = Duration::from_millis(100);
/// Delay after which a due sample is expected to be taken: the plant needs a moment for it \[ns\].
/// Chosen, not measured: a twentieth of a period at 100 Hz.
pub const GRACE_NS: u64 = 500_000;

// Recorder.

/// Pause of the recorder after it found its queues empty.
pub const RECORDER_POLL: Duration = Duration::from_millis(2);
/// Size at which a chunk of the log is closed and handed to the system \[bytes of messages\].
pub const CHUNK_BYTES: usize = 64 * 1024;
/// Time after which a chunk is closed even if it is smaller, and the log is forced to the disk.
pub const FLUSH_PERIOD: Duration = Duration::from_secs(1);
/// Longest record that is read from a log \[bytes\]: a chunk of another program may have some megabytes, decompressed.
pub const MAX_RECORD_BYTES: usize = 64 << 20;
/// Longest index of a log that is used \[bytes\]: the index of a day at 100 Hz has 20 MB. A longer index is ignored.
pub const MAX_INDEX_BYTES: u64 = 64 << 20;
/// Largest number of events that are read from a log.
pub const MAX_EVENTS: usize = 100_000;
/// Longest outcome that a recorder can write into its pipe at its end \[bytes\]: the capacity of the pipe.
pub const OUTCOME_BYTES: u64 = 65_536;

// Observers.

/// Largest number of observers of a flight at once: each takes a place that a replaced process may need.
pub const OBSERVERS: usize = 4;
/// Pause of an observer after a look that found nothing.
pub const OBSERVER_POLL: Duration = Duration::from_millis(10);
/// Time between two requests of an observer for the events of the flight.
pub const EVENTS_PERIOD: Duration = Duration::from_millis(200);
/// Time after which an observer reconnects to a topic on which messages were sent but none arrived.
pub const RECONNECT_PERIOD: Duration = Duration::from_secs(1);

// Control socket.

/// Longest request \[bytes\].
pub const REQUEST_BYTES: usize = 4096;
/// Longest time that a client may take to send its request.
pub const REQUEST_LIMIT: Duration = Duration::from_secs(1);
/// Longest wait for an answer. A launcher looks for requests every few milliseconds, unless it is stopped or gone.
pub const ANSWER_LIMIT: Duration = Duration::from_secs(2);
/// Largest number of clients at once. A new client replaces the one that has been silent for the longest.
pub const CLIENTS: usize = 32;
/// Largest number of clients that are accepted at one look.
pub const NEW_CLIENTS: usize = 8;
/// Number of newest events in the answer to `status`.
pub const STATUS_EVENTS: usize = 8;
/// Largest number of events in one answer, so that it fits into the socket.
pub const ANSWER_EVENTS: usize = 100;
