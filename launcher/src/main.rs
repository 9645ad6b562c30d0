//! `launcher`: the program that users run. The command line, on top of the libraries that fly, evaluate and measure.
//!
//! | module | holds |
//! |---|---|
//! | `cli` | the commands |
//! | `fly` | `fly`: one flight from scenario to report |
//! | `progress` | the line shown while flying |
//! | `manage` | `status` and `stop` |
//! | `command` | `inject` and `clear` |
//! | `swap` | `swap`: replaces the process of a node of a flying stack |
//! | `replay` | `replay` and `explain`: a flight flown again from its folder |
//! | `compare` | `compare`: recorded flights side by side |
//! | `campaign` | `campaign`: many flights, here or on a cluster |
//! | `tune` | `tune`: gains for the controllers of a campaign |
//! | `run_folder` | the run that a command reads; hints for a path that is no run |
//! | `target` | the flying stack that a command is for |

mod campaign;
mod cli;
mod command;
mod compare;
mod export;
mod fly;
mod manage;
mod new;
mod progress;
mod replay;
mod run_folder;
mod swap;
mod target;
mod tune;

use std::process::ExitCode;

use flight::provenance::{BUILT_FROM, BuiltFrom};

fn main() -> ExitCode {
    if let Some(commit) = option_env!("TREFOIL_COMMIT") {
        let changed = option_env!("TREFOIL_CHANGED") == Some("true");
        let _ = BUILT_FROM.set(BuiltFrom { commit, changed }); // fails only if it was set before
    }
    cli::main()
}
