//! Flights in one thread, guarded against the libraries that fly in them: a flight with a library is flown by a child
//! process. A library that crashes, ends its process or never returns costs that flight, which ends as one that has
//! lost the node.
//!
//! ```text
//! fly(scenario) -- without a library --> inprocess, here
//!               -- with one -----------> child of this thread, started once for many flights with the same libraries
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

use contract::scenario::Scenario;
use runtime::error::SessionError;

pub use child::serve;
pub use command::{command, exit_code};

use crate::inprocess::{self, Flown};
use crate::log::{Memory, Record};
use crate::programs;
use host::Host;

/// Most children of a thread that wait; beyond them the one that has waited longest ends.
const MOST_IDLE: usize = 8;

thread_local! {
    /// Children of this thread that wait for the next flight, one for each set of libraries: two controllers that
    /// cannot be in one process are compared in a campaign all the same.
    static IDLE: RefCell<Vec<Host>> = const { RefCell::new(vec![]) };
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
    !programs::libraries(scenario).is_empty()
}

fn fly_in_child(
    scenario: &Scenario,
    logged: bool,
    watch: impl FnMut(&Record) -> bool,
    remember: impl FnMut(&Memory),
) -> Result<Flown, SessionError> {
    let idle = IDLE.with_borrow_mut(|idle| {
        let suits = idle.iter().position(|host| host.suits(scenario));
        suits.map(|at| idle.remove(at))
    });
    let mut host = idle.map_or_else(|| Host::start(scenario), Ok)?;
    let flown = host.fly(logged, scenario, watch, remember)?;
    if host.is_idle() {
        IDLE.with_borrow_mut(|idle| {
            idle.push(host);
            let surplus = idle.len().saturating_sub(MOST_IDLE);
            idle.drain(..surplus);
        });
    }
    Ok(flown)
}
