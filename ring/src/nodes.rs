//! The stack's own cores, by the topic on which they answer.

use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::node::{self, Node};
use runtime::ports::Ports;
use settings::Scenario;

/// Opens a new core for a run of `scenario`, with the ports of `member`; an error for the plant.
pub fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    let open = match member.topic {
        Topic::State => return Err(SessionError::UnknownNode("plant".into())), // the plant answers to no message
        Topic::Reference => node::open::<guidance::Guidance>,
        Topic::Controls => node::open::<attitude_mpc::AttitudeMpc>,
        Topic::Actuators => node::open::<mixer::Mixer>,
    };
    open(ports, member, scenario)
}
