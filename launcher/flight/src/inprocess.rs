//! The ring in one thread ([`ring::stepped`]) with the nodes that the settings name, the launcher's own or libraries.

use contract::scenario::Scenario;
use ring::stepped::Stepped;
pub use ring::stepped::{self, Flown};
use runtime::error::SessionError;

use crate::log::{Memory, Record};
use crate::nodes;

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
    watch: impl FnMut(&Record) -> bool,
    remember: impl FnMut(&Memory),
) -> Result<Flown, SessionError> {
    ring(scenario, with_checksums)?.fly(watch, remember)
}

/// Builds the ring of a flight of `scenario`.
///
/// # Errors
/// Something derived from `scenario`, such as the gain of the controller, does not exist.
pub fn ring(scenario: &Scenario, with_checksums: bool) -> Result<Stepped, SessionError> {
    Stepped::new(scenario, nodes::vehicle(scenario)?, with_checksums, [nodes::open; 3])
}
