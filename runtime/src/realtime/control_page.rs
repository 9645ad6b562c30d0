//! The control page: shared memory with the phase of the run, a doorbell per topic, the roles and the fault table.
//!
//! iceoryx2 carries the messages; the doorbells only wake. A doorbell is a counter with a futex on it: a publisher
//! raises the counter after a send, and a receiver sleeps until the counter changes or a deadline passes. The event of
//! iceoryx2 is a datagram with time-outs in milliseconds; a futex needs one system call on each side and has time-outs
//! in nanoseconds.
//!
//! A doorbell holds no state that matters: if a process dies between sending and ringing, the others wait for one
//! time-out.

use std::sync::atomic::{AtomicU32, Ordering};

use super::{sleep_while, wake};
use crate::fault_table::FaultTable;
use crate::shared_role::{LongWord, SharedRole, SnapshotCell, Word};
use contract::Topic;
use contract::snapshot::PLANT_WORDS;

/// Content of the control page.
#[repr(C)]
#[derive(Default)]
pub struct Page {
    /// Version of the page's layout, by which a process recognises the page.
    pub(super) magic: AtomicU32,
    /// Phase of the run: see [`phase`]. Rung at every change.
    pub phase: Doorbell,
    /// Newest tick that the launcher has seen; limits how far lockstep may run ahead.
    pub watched: Doorbell,
    /// Newest tick that the recorder has seen, which limits lockstep too; `u32::MAX` if nothing is recorded.
    pub recorded: Doorbell,
    /// Lockstep: ticks up to which the plant has asked the launcher for the assignment of the roles.
    pub asked: Doorbell,
    /// Lockstep: ticks up to which the launcher has decided the assignment.
    pub decided: Doorbell,
    /// Lockstep: first tick for which the plant must ask.
    pub next_decision: Word,
    doorbells: [Doorbell; Topic::COUNT],
    roles: [SharedRole; Topic::COUNT],
    /// Memory of the plant, written every ten seconds for the log.
    pub plant_memory: SnapshotCell<PLANT_WORDS>,
    /// Role of the recorder.
    pub recorder: SharedRole,
    /// Faults that were given in flight.
    pub fault_table: FaultTable,
    /// Number of TRUTHs that the plant has sent.
    pub truths_sent: Word,
    /// Port through which the plant sends TRUTH; 0 before it is open.
    pub truth_port: LongWord,
    /// Instant of sample 0, in lockstep of the present sample \[ns\]; 0 before it is known. Set by the plant.
    pub origin_ns: LongWord,
    /// Number of samples of the run; 0 at first. The plant sets it before it sends the last STATE.
    pub total_samples: LongWord,
}

/// Phases of a run: the values of [`Page::phase`].
pub mod phase {
    /// Phase in which the processes join.
    pub const JOIN: u32 = 0;
    /// Phase in which the plant may fly: all processes are ready.
    pub const GO: u32 = 1;
    /// Phase in which the nodes end.
    pub const LEAVE: u32 = 2;
    /// Phase in which the recorder closes its file: the nodes have ended.
    pub const CLOSE: u32 = 3;
}

/// Counter that wakes waiting processes, on a cache line of its own.
#[repr(C, align(64))]
#[derive(Default)]
pub struct Doorbell(AtomicU32);

impl Doorbell {
    /// Present count. Read it before looking for a message, then pass it to [`wait`](Self::wait).
    pub fn count(&self) -> u32 {
        self.0.load(Ordering::Acquire)
    }

    /// Raises the counter and wakes every process that waits.
    pub fn ring(&self) {
        self.0.fetch_add(1, Ordering::Release);
        wake(&self.0);
    }

    /// Raises the counter and wakes no process.
    pub fn mark(&self) {
        self.0.fetch_add(1, Ordering::Release);
    }

    /// Raises the counter to `count` and wakes every process that waits; no effect if the counter is that high already.
    pub fn raise(&self, count: u32) {
        if self.0.fetch_max(count, Ordering::Release) < count {
            wake(&self.0);
        }
    }

    /// Sleeps until the counter differs from `seen` or `deadline_ns` (`CLOCK_MONOTONIC`) has passed.
    pub fn wait(&self, seen: u32, deadline_ns: u64) {
        sleep_while(&self.0, seen, deadline_ns);
    }
}

impl Page {
    /// Doorbell of a topic.
    pub fn doorbell(&self, topic: Topic) -> &Doorbell {
        &self.doorbells[topic as usize]
    }

    /// Role of the node that publishes `topic`.
    pub fn role(&self, topic: Topic) -> &SharedRole {
        &self.roles[topic as usize]
    }

    /// Number of samples that the plant has taken.
    pub fn samples_taken(&self) -> u64 {
        u64::from(self.role(Topic::State).done(1).get())
    }

    /// Current tick: the newest that the plant has sampled; 0 before the first.
    pub fn plant_tick(&self) -> u64 {
        self.samples_taken().saturating_sub(1)
    }

    /// Moves the run on to `phase` and wakes every process that waits on a doorbell of a topic or of the phase.
    pub fn set_phase(&self, phase: u32) {
        self.phase.raise(phase);
        for topic in Topic::ALL {
            self.doorbell(topic).ring();
        }
    }
}
