//! Flies: starts the ring as processes or turns it in one thread, decides who runs a node, records what is sent.
//!
//! | module | holds |
//! |---|---|
//! | [`settings`] | the settings of a flight, checked before it |
//! | [`stack`] | the ring as processes: start, watch, stop |
//! | [`inprocess`] | the ring turned by one thread |
//! | [`roles`] | who runs a node: one state machine, three drivers |
//! | [`intruder`] | a process that does not belong to a run, as a fault |
//! | [`event`] | what happens to processes, and how the recorder learns of it |
//! | [`swap_story`] | what became of each swap, by the events |
//! | [`recorder`] | the fifth process: every message to `flight.mcap` |
//! | [`log`] | the flight log's format |
//! | [`replay`] | a flight flown again from its log |
//! | [`control`] | the socket on which a flying stack is asked and told |
//! | [`folder`] | the folder of a run |
//! | [`dir`], [`files`] | the one way to files of runs and campaigns |
//! | [`provenance`] | where a run was made |
//! | [`interrupts`] | Ctrl-C |
//! | `limits` | every limit and time-out |
//! | [`duration`] | durations on the command line |

#![allow(missing_docs)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

use std::os::unix::process::CommandExt;
use std::process::Command;

pub mod control;
pub mod dir;
pub mod duration;
pub mod event;
pub mod files;
pub mod folder;
pub mod inprocess;
pub mod interrupts;
pub mod intruder;
mod limits;
pub mod log;
pub mod provenance;
pub mod recorder;
pub mod replay;
pub mod roles;
pub mod settings;
pub mod stack;
pub mod swap_story;

/// This program, for another process of it: the file that runs here, whatever has its name by now.
pub fn own_program() -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0("launcher");
    command
}
