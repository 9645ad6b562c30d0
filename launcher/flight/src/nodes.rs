//! Nodes with the core that the settings name, the launcher's own or a library: a process, the ring in one thread and a
//! replay open them here.

use contract::topic::Topic;
use plant::tricopter::Tricopter;
use plant::vehicle::Vehicle;
pub use ring::stepped::Stepped;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::node::Node;
use runtime::ports::Ports;
use settings::{ProgramKind, Scenario};

/// Builds the vehicle of the plant for a run of `scenario`.
pub fn vehicle(scenario: &Scenario) -> Result<Box<dyn Vehicle>, SessionError> {
    if scenario.node.of(Topic::State).kind() == ProgramKind::Library {
        return foreign::vehicle(scenario);
    }
    Ok(Box::new(Tricopter::new(scenario)))
}

/// Opens the ports of `member`, a process of any node but the plant, with a new core for a run of `scenario`.
pub fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    if scenario.node.of(member.topic).kind() == ProgramKind::Library {
        return foreign::open(ports, member, scenario);
    }
    ring::nodes::open(ports, member, scenario)
}

/// Builds the ring of a flight of `scenario` in one thread.
///
/// # Errors
/// Something derived from `scenario`, such as the gain of the controller, does not exist. Only the values of `scenario`
/// itself need to have been checked.
pub fn ring(scenario: &Scenario, with_checksums: bool) -> Result<Stepped, SessionError> {
    Stepped::new(scenario, vehicle(scenario)?, with_checksums, [open; Topic::OF_CONTROLLERS.len()])
}
