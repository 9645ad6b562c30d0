//! Ring in one thread: runs the four steps in order, message by message as the processes would exchange them.
//!
//! | module | holds |
//! |---|---|
//! | [`stepped`] | the ring, flown part by part of a tick |
//! | `workers` | stand-ins for the processes of one node |
//!
//! Flights are bit-identical to lockstep, because the same cores get the same messages in the same order through the
//! same inputs and outputs, under the same roles. Nothing here reads a clock: stamps carry tick and sequence only.

pub mod stepped;
pub(crate) mod workers;

use contract::scenario::Scenario;
use runtime::error::SessionError;

use crate::log::{Memory, Record};
use crate::nodes;
use crate::stack::Ended;
pub use stepped::Flown;
use stepped::{Stepped, TOPICS};

/// Flies `scenario` to its end, or until `watch`, which gets every message, returns false.
pub fn fly(scenario: &Scenario, watch: impl FnMut(&Record) -> bool) -> Flown {
    fly_remembering(scenario, watch, |_| {})
}

/// Flies like [`fly`]; `remember` also gets the memory of every node, every ten seconds.
pub fn fly_remembering(
    scenario: &Scenario,
    watch: impl FnMut(&Record) -> bool,
    remember: impl FnMut(&Memory),
) -> Flown {
    let flown = fly_ring(scenario, true, watch, remember);
    flown.unwrap_or_else(|error| panic!("cannot fly a checked scenario in process: {error}"))
}

/// Flies like [`fly`] a flight of which no message is kept: messages carry checksums only if a fault or a swap
/// [may change them](changes_messages).
///
/// # Errors
/// Something derived from `scenario`, such as the gain of the controller, does not exist. Only the values of `scenario`
/// itself need to have been checked.
pub fn fly_unlogged(scenario: &Scenario, watch: impl FnMut(&Record) -> bool) -> Result<Flown, SessionError> {
    fly_ring(scenario, changes_messages(scenario), watch, |_| {})
}

/// Returns whether a fault or a swap may change a message. If so, receivers accept or refuse it by its checksum.
pub fn changes_messages(scenario: &Scenario) -> bool {
    !scenario.swap.is_empty() || scenario.fault.iter().any(|fault| fault.target.topic().is_some())
}

fn fly_ring(
    scenario: &Scenario,
    with_checksums: bool,
    mut watch: impl FnMut(&Record) -> bool,
    mut remember: impl FnMut(&Memory),
) -> Result<Flown, SessionError> {
    let mut ring = Stepped::new(scenario, with_checksums, [nodes::open; 3])?;
    loop {
        if !ring.begin()? {
            return Ok(ring.over(Ended::Lost("plant".into())));
        }
        for topic in TOPICS {
            ring.answer(topic);
        }
        ring.memories().iter().for_each(&mut remember);
        if let Some(ended) = ring.end(&mut watch) {
            return Ok(ring.over(ended));
        }
    }
}
