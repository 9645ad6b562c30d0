//! The ring in one thread ([`ring::stepped`]) with the nodes that the settings name, the launcher's own or libraries.

use ring::stepped::Stepped;
pub use ring::stepped::{self, Flown};
use runtime::error::SessionError;
use settings::Scenario;

use crate::log::Record;
use crate::nodes;

/// Flies a checked `scenario` to its end, or until `watch`, which gets every message, returns false.
pub fn fly(scenario: &Scenario, watch: impl FnMut(&Record) -> bool) -> Flown {
    let flown = ring(scenario, true).and_then(|ring| ring.fly(watch, |_| {}));
    flown.unwrap_or_else(|error| panic!("cannot fly a checked scenario in process: {error}"))
}

/// Returns whether a fault or a swap may change a message. If so, receivers accept or refuse it by its checksum, and
/// without, a flight of which no message is kept needs no checksums.
pub fn changes_messages(scenario: &Scenario) -> bool {
    !scenario.swap.is_empty() || scenario.fault.iter().any(|fault| fault.target.topic().is_some())
}

/// Builds the ring of a flight of `scenario`.
///
/// # Errors
/// Something derived from `scenario`, such as the gain of the controller, does not exist. Only the values of `scenario`
/// itself need to have been checked.
pub fn ring(scenario: &Scenario, with_checksums: bool) -> Result<Stepped, SessionError> {
    Stepped::new(scenario, nodes::vehicle(scenario)?, with_checksums, [nodes::open; 3])
}
