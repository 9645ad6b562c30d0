//! The release: the event that begins a cycle. It is chosen once, when a process joins. What depends on it is
//! decided here, except the waiting ([`crate::sample_loop`], [`crate::cycle_loop`]) and the setup of a process
//! ([`crate::session`]).
//!
//! ```text
//!           the plant samples                 a node answers                        wakes by
//! Timer     at t0 + k T, whatever happens     its input came, or is late            ringing at every message
//! Barrier   all have done the tick before     the node before it is done            ringing at the end of a cycle
//! ```
//!
//! In process the caller of the nodes is the barrier: no node waits or wakes another, and no clock is read
//! ([`crate::cycle_timing`]). A replay has no release: its nodes are called as the recording says ([`Caller`]).

use crate::realtime::{ControlPage, Doorbell, now_ns};
use settings::{Late, Mode, NodeDeadline, Scenario};

/// Event that begins a cycle of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Release {
    /// Real time: `CLOCK_MONOTONIC`.
    Timer {
        /// Time between two samples \[ns\].
        period_ns: u64,
    },
    /// Lockstep and in process: all preceding processes are done with their cycle.
    Barrier,
}

/// Caller of a node: decides who waits, who wakes, and which messages may exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Caller {
    /// The node's loop, or the ring in process in its place.
    Loop(Release),
    /// Replay, at the cycles of the recording.
    Recording,
}

impl Release {
    /// Chooses the release of a run of `scenario`.
    pub fn of(scenario: &Scenario) -> Self {
        match scenario.run.mode {
            Mode::Realtime => Self::Timer { period_ns: scenario.sample_ns() },
            Mode::Lockstep | Mode::Inprocess => Self::Barrier,
        }
    }

    /// Instant of sample `tick` \[ns\]; in lockstep that of the present sample, whatever the `tick`.
    pub fn sample_ns(self, page: &ControlPage, tick: u64) -> u64 {
        match self {
            Self::Timer { period_ns } => page.origin_ns.get() + tick * period_ns,
            Self::Barrier => page.origin_ns.get(),
        }
    }

    /// Deadline in force: in lockstep and in process late messages are counted, but always sent.
    pub fn deadline(self, deadline: NodeDeadline) -> NodeDeadline {
        match self {
            Self::Timer { .. } => deadline,
            Self::Barrier => NodeDeadline { late: Late::Send, ..deadline },
        }
    }

    /// Announces the end of a cycle, which in lockstep wakes the waiting processes.
    pub fn cycle_done(self, doorbell: &Doorbell) {
        if self == Self::Barrier {
            doorbell.ring(); // in real time the message itself has woken the others
        }
    }
}

impl Caller {
    /// Number of samples that may exist when a message of sample `tick` is checked. In real time the clock decides: the
    /// plant counts a sample as `taken` only after its STATE was sent, and may have slept through others that the nodes
    /// answer.
    pub fn samples_by_now(self, page: &ControlPage, taken: u64, tick: u64) -> u64 {
        match self {
            Self::Loop(Release::Timer { period_ns }) if tick >= taken && page.origin_ns.get() > 0 => {
                taken.max(now_ns().saturating_sub(page.origin_ns.get()) / period_ns + 1)
            }
            Self::Loop(_) => taken,
            Self::Recording => u64::MAX, // the message was checked in the flight
        }
    }

    /// Delays the process by `held_ns`, as a fault demands. In lockstep and in process the process does not wait; the
    /// delay is returned instead, to be added to the stamp.
    pub fn hold_up(self, page: &ControlPage, held_ns: u64) -> u64 {
        match self {
            Self::Loop(Release::Timer { .. }) => {
                if held_ns > 0 {
                    page.phase.wait(page.phase.count(), now_ns() + held_ns);
                }
                0
            }
            Self::Loop(Release::Barrier) => held_ns,
            Self::Recording => 0, // the recorded times contain the delay
        }
    }

    /// Announces a sent message. In real time this wakes the receivers; in lockstep [`Release::cycle_done`] does.
    pub fn message_sent(self, doorbell: &Doorbell) {
        match self {
            Self::Loop(Release::Timer { .. }) => doorbell.ring(),
            Self::Loop(Release::Barrier) | Self::Recording => doorbell.mark(),
        }
    }
}
