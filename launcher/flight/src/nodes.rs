//! Nodes with the core that the settings name: a process, the ring in process and a replay open them here.

use contract::topic::Topic;
use plant::tricopter::Tricopter;
use plant::vehicle::Vehicle;
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

/// Opens the ports of `member`, which answers, with a new core for a run of `scenario`.
pub fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    if scenario.node.of(member.topic).kind() == ProgramKind::Library {
        return foreign::open(ports, member, scenario);
    }
    ring::nodes::open(ports, member, scenario)
}
