//! Flights in one thread, guarded against the libraries that fly in them: a flight with a library is flown by a child
//! process. A library that crashes, ends its process or never returns costs that flight, which ends as one that has
//! lost the node.
//!
//! ```text
//! fly(scenario) -- without a library --> inprocess, here
//!               -- with one -----------> child of this thread, started once for many flights
//!                                        request: the settings    ->
//!                                        <- every message, and the end of the flight
//! ```
//!
//! Messages come through memory that both processes share, so none is lost with the child, and a flight is not slower
//! by a system call for each. What a library changes in its process (limits, variables, working directory, signals), or
//! leaves running, ends with the flight: the next one then has a new child.
//!
//! | module | holds |
//! |---|---|
//! | `frames` | requests and answers as words |
//! | `child` | the process that flies |
//! | `surroundings` | what a flight must leave as it was |
//! | `command` | a whole command in a child: a replay that loads libraries |
//! | `host` | the parent's end of a child |

mod child;
mod command;
mod frames;
mod host;
mod surroundings;

use std::cell::RefCell;

use contract::scenario::{Scenario, candidate};
use runtime::error::SessionError;

pub use child::serve;
pub use command::{command, exit_code};

use crate::inprocess::{self, Flown};
use crate::log::{Memory, Record};
use host::Host;

thread_local! {
    /// Child of this thread that waits for the next flight.
    static IDLE: RefCell<Option<Host>> = const { RefCell::new(None) };
}

/// Flies as [`inprocess::fly`] does.
pub fn fly(scenario: &Scenario, watch: impl FnMut(&Record) -> bool) -> Flown {
    fly_remembering(scenario, watch, |_| {})
}

/// Flies as [`inprocess::fly_remembering`] does.
pub fn fly_remembering(
    scenario: &Scenario,
    watch: impl FnMut(&Record) -> bool,
    remember: impl FnMut(&Memory),
) -> Flown {
    if !has_library(scenario) {
        return inprocess::fly_remembering(scenario, watch, remember);
    }
    let flown = fly_in_child(scenario, true, watch, remember);
    flown.unwrap_or_else(|error| panic!("cannot fly a checked scenario in process: {error}"))
}

/// Flies as [`inprocess::fly_unlogged`] does.
///
/// # Errors
/// As there, or no child can be started.
pub fn fly_unlogged(scenario: &Scenario, watch: impl FnMut(&Record) -> bool) -> Result<Flown, SessionError> {
    if !has_library(scenario) {
        return inprocess::fly_unlogged(scenario, watch);
    }
    fly_in_child(scenario, false, watch, |_| {})
}

/// Returns whether a node is a library, from the beginning or by a swap.
fn has_library(scenario: &Scenario) -> bool {
    let mut swapped = scenario.swap.iter().filter_map(|swap| candidate(scenario, swap).ok());
    scenario.node.libraries().next().is_some() || swapped.any(|own| own.node.libraries().next().is_some())
}

fn fly_in_child(
    scenario: &Scenario,
    logged: bool,
    watch: impl FnMut(&Record) -> bool,
    remember: impl FnMut(&Memory),
) -> Result<Flown, SessionError> {
    let idle = IDLE.take().filter(|host| host.suits(scenario));
    let mut host = idle.map_or_else(|| Host::start(scenario), Ok)?;
    let flown = host.fly(logged, scenario, watch, remember)?;
    if host.is_idle() {
        IDLE.set(Some(host));
    }
    Ok(flown)
}
