//! Flies: runs the ring as processes or in one thread, decides which process runs a node, and records every message.
//!
//! | module | holds |
//! |---|---|
//! | [`scenario`] | the settings of a flight, checked before it |
//! | `libraries` | the nodes of a flight that are libraries |
//! | [`nodes`], [`programs`] | the cores of the nodes: the launcher's own, or programs of users |
//! | [`stack`] | the ring as processes: start, watch, stop |
//! | [`hover`] | the hover of a scenario, and its control loops in small motions about it |
//! | [`guarded`] | the ring in one thread, with libraries in a child: a crash or an endless loop costs one flight |
//! | [`roles`] | which process runs a node: the drivers in real time and lockstep of the state machine in `ring` |
//! | [`strays`] | processes that code of users has left behind |
//! | [`event`] | events of processes, and the pipe that carries them to the recorder |
//! | [`swap_story`] | course and end of each swap, read from the events |
//! | [`circumstances`] | facts of a flight that stand in no message |
//! | [`observer`] | reads a flying stack from another process |
//! | [`recorder`] | the fifth process: writes every message to `flight.mcap` |
//! | [`log`] | the flight log's format |
//! | [`control`] | the socket for requests to a flying stack |
//! | [`provenance`] | origin of a run: commit, command, host, scheduling |
//! | [`interrupts`] | Ctrl-C |
//! | [`limits`] | every limit and time-out |
//! | [`duration`] | durations on the command line |

#![allow(missing_docs)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

use std::os::unix::process::CommandExt;
use std::process::Command;

pub mod circumstances;
pub mod control;
pub mod duration;
pub mod event;
pub mod guarded;
pub mod hover;
pub mod interrupts;
mod libraries;
pub mod limits;
pub mod log;
pub mod nodes;
pub mod observer;
pub mod programs;
pub mod provenance;
pub mod recorder;
pub mod roles;
pub mod scenario;
pub mod stack;
pub mod strays;
pub mod swap_story;

/// Returns a command that starts this program again: the file that runs, even if its path names another file by now.
pub fn own_program() -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0("trefoil");
    command
}
