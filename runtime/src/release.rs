//! The release: what begins a cycle. It is decided once, when a process joins; every choice that depends on it but the
//! waiting itself ([`crate::sample_loop`], [`crate::cycle_loop`]) is made here.
//!
//! ```text
//!           the plant samples                 a node answers                        wakes by
//! Timer     at t0 + k T, whatever happens     its input came, or is late            ringing at every message
//! Barrier   all are done with the last tick   the node before it is done            ringing at the end of a cycle
//! Recording its caller says so                its caller says so                    -
//! ```
//!
//! In process the caller of the nodes is the barrier: nothing waits, nothing wakes, and no clock is read
//! ([`crate::cycle_timing`]).

use crate::realtime::{ControlPage, Doorbell, now_ns};
use contract::scenario::{Late, Mode, NodeDeadline, Scenario};

/// What begins a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Release {
    /// Real time: `CLOCK_MONOTONIC`.
    Timer {
        /// Between two samples \[ns\].
        period_ns: u64,
    },
    /// Lockstep: all that work are done with what comes before.
    Barrier,
    /// Replay: the caller, when the recording has a cycle.
    Recording,
}

impl Release {
    /// That of a run of `scenario`.
    pub fn of(scenario: &Scenario) -> Self {
        match scenario.run.mode {
            Mode::Realtime => Self::Timer { period_ns: scenario.sample_ns() },
            Mode::Lockstep | Mode::Inprocess => Self::Barrier,
        }
    }

    /// The instant of sample `tick`, which in lockstep is the present one.
    pub fn sample_ns(self, page: &ControlPage, tick: u64) -> u64 {
        match self {
            Self::Timer { period_ns } => page.origin_ns() + tick * period_ns,
            Self::Barrier | Self::Recording => page.origin_ns(),
        }
    }

    /// How many samples exist when an answer to sample `tick` is judged: those `taken` by the plant, and in real time also those
    /// that it slept through, because the nodes answer to them too.
    pub fn samples_by_now(self, page: &ControlPage, taken: u64, tick: u64) -> u64 {
        match self {
            Self::Timer { period_ns } if tick >= taken && page.origin_ns() > 0 => {
                taken.max(now_ns().saturating_sub(page.origin_ns()) / period_ns + 1)
            }
            Self::Recording => u64::MAX, // it was judged in the flight
            _ => taken,
        }
    }

    /// The deadline that counts: without a clock no message is too late to be sent.
    pub fn deadline(self, deadline: NodeDeadline) -> NodeDeadline {
        match self {
            Self::Timer { .. } | Self::Recording => deadline,
            Self::Barrier => NodeDeadline { late: Late::Send, ..deadline },
        }
    }

    /// Holds the process up for `held_ns`, as a fault wants it. Without a clock it only counts: what is to be added to
    /// the stamp.
    pub fn hold_up(self, page: &ControlPage, held_ns: u64) -> u64 {
        match self {
            Self::Timer { .. } => {
                if held_ns > 0 {
                    page.phase.wait(page.phase.count(), now_ns() + held_ns);
                }
                0
            }
            Self::Barrier => held_ns,
            Self::Recording => 0, // the recorded times have it
        }
    }

    /// A message is out. Without a clock no process is due before this one is done with its cycle.
    pub fn message_sent(self, doorbell: &Doorbell) {
        match self {
            Self::Timer { .. } => doorbell.ring(),
            Self::Barrier | Self::Recording => doorbell.mark(),
        }
    }

    /// The cycle is done.
    pub fn cycle_done(self, doorbell: &Doorbell) {
        if self == Self::Barrier {
            doorbell.ring(); // against the clock the message was what the others wait for
        }
    }
}
