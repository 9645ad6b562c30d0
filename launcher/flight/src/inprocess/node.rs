//! Nodes in process: the nodes of the ring with the ports that a process of them would have, over queues.

use contract::scenario::Scenario;
use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::node::{Node, Wired};
use runtime::ports::Ports;

/// Opens the ports of `member`, with a new core for a run of `scenario`.
pub fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    Ok(match member.topic {
        Topic::State => return Err(SessionError::UnknownNode("plant".into())), // it samples, and answers to nothing
        Topic::Reference => Box::new(guidance::Node::open(ports, member, scenario)?),
        Topic::Controls => Box::new(attitude_mpc::Node::open(ports, member, scenario)?),
        Topic::Actuators => Box::new(mixer::Node::open(ports, member, scenario)?),
    })
}
