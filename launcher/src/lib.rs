//! The launcher: starts the stack, watches it, records it, reports on it. It reads everything, and no node knows it.
//!
//! | module | holds |
//! |---|---|
//! | [`cli`] | the command line |
//! | [`fly`] | one flight from scenario to report |
//! | `folder`, `files` | the folder of a run, and what is written into it |
//! | `progress` | the line shown while flying |
//! | [`settings`] | the settings of a flight, checked before it |
//! | [`inprocess`] | the ring turned by one thread |
//! | [`stack`] | the ring as processes: start, watch, stop |
//! | [`event`] | what happens to processes, and how the recorder hears of it |
//! | [`succession`] | who works for each node when time follows the script, and the trial of newcomers |
//! | `supervisor` | who works for each node against the clock |
//! | `intruder` | a process that does not belong to a run, as a fault |
//! | [`recorder`] | the fifth process: every message to `flight.mcap` |
//! | [`log`] | the flight log's format |
//! | [`summary`], [`timing`] | what a flight amounts to: metrics, state hash, punctuality |
//! | [`solves`], [`faults`] | what the solver did, and what came of the scenario's faults |
//! | [`bounds`] | what a flight must stay inside of |
//! | `happenings` | what is known to have happened in a flight, for its timing, trace and report |
//! | [`run_record`] | `run.json` |
//! | [`report`] | `report.html` |
//! | [`trace`] | `trace`: ticks of a run for a trace viewer |
//! | [`control`] | the socket on which a flying stack is asked and told |
//! | `duration` | durations on the command line |
//! | [`manage`] | `status` and `stop` |
//! | [`swap`] | `swap`: another process for a node of a flying stack |
//! | [`measure`] | `measure`: figures with targets |

use std::os::unix::process::CommandExt;
use std::process::Command;

pub mod bounds;
pub mod cli;
pub mod control;
mod duration;
pub mod event;
pub mod faults;
mod files;
pub mod fly;
mod folder;
mod happenings;
pub mod inprocess;
mod intruder;
pub mod log;
pub mod manage;
pub mod measure;
mod progress;
pub mod provenance;
pub mod recorder;
pub mod report;
pub mod run_record;
pub mod settings;
pub mod solves;
pub mod stack;
pub mod succession;
pub mod summary;
mod supervisor;
pub mod swap;
pub mod timing;
pub mod trace;

pub(crate) use contract::console::{eprint_line, print};

/// This program, for another process of it: the file that runs here, whoever has its name by now.
pub(crate) fn own_program() -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0("launcher");
    command
}
