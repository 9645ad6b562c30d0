//! Flights in one thread, guarded against the libraries that fly in them: a flight with a library is flown by a child
//! process. A library that crashes, ends its process or never returns costs that flight, which ends as if the
//! node were lost.
//!
//! ```text
//! fly(scenario) -- without a library --> here
//!               -- with one -----------> child of this thread, started once for many flights with the same libraries
//!                                        request: the settings    ->
//!                                        <- every message, and the end of the flight
//! ```
//!
//! Messages come through memory that both processes share, so none is lost with the child, and not every message costs
//! a system call. If a library changes its process (limits, variables, working directory, signals) or leaves a process
//! running, the child is ended after the flight, and the next flight has a new child. Before any flight a library is
//! tried in a child of its own ([`try_out`]).
//!
//! | module | holds |
//! |---|---|
//! | `frames` | requests and answers as words |
//! | `child` | the process that flies |
//! | `surroundings` | the state of the child that a flight must not change |
//! | `command` | a whole command in a child: a replay that loads libraries |
//! | `host` | the parent's end of a child |

mod child;
mod command;
mod frames;
mod host;
mod surroundings;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use contract::Topic;
use ring::stepped::SteppedResult;
use runtime::error::SessionError;
use settings::Scenario;

pub use child::serve;
pub use command::{command, exit_code};

use crate::libraries;
use crate::log::{Memory, Record};
use crate::nodes;
use host::ChildHost;

/// Largest number of idle children of a thread; with more, the child that has been idle longest is ended.
const MOST_IDLE: usize = 8;

thread_local! {
    /// Children of this thread that wait for the next flight, one for each set of libraries, so that a campaign can
    /// compare two controllers that cannot share a process.
    static IDLE: RefCell<Vec<ChildHost>> = const { RefCell::new(vec![]) };
}

/// Longest time that a library may take to be loaded and to answer to a few samples.
const TRIAL_LIMIT: Duration = Duration::from_secs(10);

/// Flies `scenario` to its end, or until `watch`, which gets every message, returns false; `remember` gets the snapshot
/// of every node, every ten seconds.
///
/// # Errors
/// Something derived from `scenario` does not exist ([`nodes::ring`]), or no child can be started.
pub fn fly(
    scenario: &Scenario,
    with_checksums: bool,
    watch: impl FnMut(&Record) -> bool,
    remember: impl FnMut(&Memory),
) -> Result<SteppedResult, SessionError> {
    if libraries::all(scenario).is_empty() {
        return nodes::ring(scenario, with_checksums)?.fly(watch, remember);
    }
    let idle = IDLE.with_borrow_mut(|idle| {
        let suits = idle.iter().position(|host| host.suits(scenario));
        suits.map(|at| idle.remove(at))
    });
    let mut host =
        idle.map_or_else(|| ChildHost::start(libraries::env_of(scenario), libraries::files(scenario)), Ok)?;
    let flown = host.fly(scenario, with_checksums, watch, remember)?;
    if host.is_idle {
        IDLE.with_borrow_mut(|idle| {
            idle.push(host);
            let surplus = idle.len().saturating_sub(MOST_IDLE);
            idle.drain(..surplus);
        });
    }
    Ok(flown)
}

/// Returns whether a fault or a swap may change a message. If so, receivers need checksums to refuse a changed message;
/// if not, a flight whose messages are not kept needs no checksums.
pub fn changes_messages(scenario: &Scenario) -> bool {
    !scenario.swap.is_empty() || scenario.fault.iter().any(|fault| fault.target.topic().is_some())
}

/// Tries the library of `node` in a child with the variables `env`, or without a node all libraries of `scenario` side
/// by side; the error says why they cannot be flown. The output of the libraries goes to the launcher's stderr.
pub fn try_out(scenario: &Scenario, node: Option<Topic>, env: BTreeMap<String, String>) -> Result<(), String> {
    let host = ChildHost::start(env, BTreeSet::new());
    host.map_err(|error| error.to_string())?.try_out(scenario, node, TRIAL_LIMIT)
}
