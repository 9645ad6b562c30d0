//! Replay: a flight flown again from the folder of its run, in one thread.
//!
//! ```text
//! log -> Script: which process answered when to which sample, and what it had read           (script, recording)
//!     -> ReplayRun: each process goes on as soon as its inputs have been sent                (again)
//!     -> Worker: one core with the ports, link and faults of its process                     (worker)
//!     -> messages, compared one by one with those of the log                                 (fields)
//! ```
//!
//! A process of a flight is a function of what it reads: its settings, the memory it begins with, its inputs, the clock
//! at the end of a cycle (for its deadline), and the faults it knew. The log names all of these. So a replay need not
//! wait for the times of the flight, and may run processes in any order in which each message is sent before it is
//! read. The plant reads commands, each with the instant of its arrival.
//!
//! A process of another program is not run: its messages are those of the log.
//!
//! [`verdict`] judges whether a replay is the same flight; [`explain`] replays with single disturbances undone, to
//! find the cost of each late, lost or missing message.

#![allow(missing_docs)]

mod again;
mod counterfactual;
mod course;
pub mod explain;
mod fields;
mod plan;
mod program;
mod recording;
mod script;
mod sender;
pub mod verdict;
mod worker;

pub use again::{replay, replay_script};
pub use counterfactual::{Disturbed, disturbed, without};
pub use fields::{Differs, difference};

pub use plan::{ComparedMessages, FirstDifference, ReplayPlan, Replayed};
pub use recording::Recording;
pub use script::{Cycle, Key, Process, Read, Script};

#[cfg(test)]
mod tests;
