//! `trefoil`: the program that users run. The command line, on top of the libraries that fly, evaluate and measure.
//!
//! | module | holds |
//! |---|---|
//! | `cli` | the commands |
//! | `fly` | `fly`: one flight from scenario to report |
//! | `mission` | the parts of a mission, for `check` |
//! | `vehicle` | hover and control loops, for `check`; input weights that do not fit, for `check` and `fly` |
//! | `doctor` | `doctor`: checks of this machine for flights in real time |
//! | `progress` | the line shown while flying |
//! | `manage` | `status` and `stop` |
//! | `mavlink` | `mavlink`: a flying stack for ground stations |
//! | `beside` | processes of `--web` and `--mavlink` beside a flight |
//! | `command` | `inject` and `clear` |
//! | `swap` | `swap`: replaces the process of a node of a flying stack |
//! | `replay` | `replay` and `explain`: a flight flown again from its folder |
//! | `compare`, `export` | `compare`: recorded flights side by side; `export`: a flight for other tools |
//! | `new` | `new`: a controller of the user's own from a template |
//! | `campaign` | `campaign`: many flights, here or on a cluster |
//! | `tune` | `tune`: gains for the controllers of a campaign |
//! | `scenarios`, `runs` | `scenarios` and `runs`: lists of shipped scenarios and of recorded flights |
//! | `manual` | `schema`, `completions`, `man` |
//! | `help` | examples and exit codes of every command |
//! | `reference` | test: the pages in docs/reference/ follow from the code |
//! | `run_folder` | the run that a command reads; hints for a path that is no run |
//! | `target` | the flying stack that a command addresses |
//! | `web` | `web` and `fly --web`: the live page |

mod beside;
mod campaign;
mod cli;
mod command;
mod compare;
mod doctor;
mod export;
mod fly;
mod help;
mod manage;
mod manual;
mod mavlink;
mod mission;
mod new;
mod progress;
#[cfg(test)]
#[allow(
    clippy::format_push_string,
    clippy::format_collect,
    clippy::needless_for_each,
    reason = "a page is written line by line"
)]
mod reference;
mod replay;
mod run_folder;
mod runs;
mod scenarios;
mod swap;
mod target;
mod tune;
mod vehicle;
mod web;

use std::process::ExitCode;

use flight::provenance::{BUILT_FROM, Git};

fn main() -> ExitCode {
    if let Some(commit) = option_env!("TREFOIL_COMMIT") {
        let changed = option_env!("TREFOIL_CHANGED") == Some("true");
        let _ = BUILT_FROM.set(Git { commit: commit.into(), changed }); // fails only if it was set before
    }
    cli::main()
}
