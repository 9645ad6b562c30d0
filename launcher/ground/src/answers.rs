//! Answers to a ground station. A station can ask, and choose the rates of messages; nothing that it sends changes the
//! flight.
//!
//! QGroundControl asks for `AUTOPILOT_VERSION`, component metadata, standard modes, all parameters and the mission, one
//! after the other, and retries where no answer comes. So what there is not is refused at once.

use std::time::Instant;

use mavlink::MavHeader;
use mavlink::MessageData;
#[allow(clippy::wildcard_imports, reason = "the dialect's own names, all in capitals")]
use mavlink::dialects::common::*;

use crate::link::{COMPONENT, SYSTEM};
use crate::parameters::Parameters;
use crate::streams::Streams;
use crate::vehicle::{Vehicle, texts};

/// Everything that a station can ask for.
pub struct Station {
    pub vehicle: Vehicle,
    pub parameters: Parameters,
    pub streams: Streams,
}

impl Station {
    /// Returns the answers to `request`; none if it is for another system, or asks for nothing.
    pub fn answer(&mut self, from: MavHeader, request: &MavMessage) -> Vec<MavMessage> {
        let is_ours = |system: u8, component: u8| [0, SYSTEM].contains(&system) && [0, COMPONENT].contains(&component);
        match request {
            MavMessage::PARAM_REQUEST_LIST(of) if is_ours(of.target_system, of.target_component) => {
                self.parameters.all()
            }
            MavMessage::PARAM_REQUEST_READ(of) if is_ours(of.target_system, of.target_component) => {
                let name = of.param_id.to_str().unwrap_or_default();
                self.parameters.find(name, of.param_index).into_iter().collect()
            }
            MavMessage::PARAM_SET(of) if is_ours(of.target_system, of.target_component) => self.refuse(of),
            MavMessage::COMMAND_LONG(of) if is_ours(of.target_system, of.target_component) => {
                self.command(from, of.command, [of.param1, of.param2])
            }
            MavMessage::COMMAND_INT(of) if is_ours(of.target_system, of.target_component) => {
                self.command(from, of.command, [of.param1, of.param2])
            }
            MavMessage::MISSION_REQUEST_LIST(of) if is_ours(of.target_system, of.target_component) => {
                let (target_system, target_component) = (from.system_id as u8, from.component_id);
                let mission_type = of.mission_type; // the missions of a scenario are no lists of waypoints
                vec![MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                    count: 0,
                    target_system,
                    target_component,
                    mission_type,
                    opaque_id: 0,
                })]
            }
            _ => vec![],
        }
    }

    /// Answers an attempt to set a parameter with its value, as the protocol has it, and a text.
    fn refuse(&self, of: &PARAM_SET_DATA) -> Vec<MavMessage> {
        let name = of.param_id.to_str().unwrap_or_default();
        let Some(value) = self.parameters.find(name, -1) else { return vec![] };
        let text = format!("{name} is read-only: a flight keeps its settings");
        [vec![value], texts(MavSeverity::MAV_SEVERITY_WARNING, &text, 1)].concat()
    }

    /// Carries out a command, which is acknowledged first.
    #[expect(deprecated, reason = "MAVROS asks for the version by the command of before 2019")]
    fn command(&mut self, from: MavHeader, command: MavCmd, [first, second]: [f32; 2]) -> Vec<MavMessage> {
        let (mut message, mut result) = (None, MavResult::MAV_RESULT_UNSUPPORTED);
        match command {
            MavCmd::MAV_CMD_REQUEST_MESSAGE => message = self.vehicle.message(first as u32),
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => {
                message = self.vehicle.message(AUTOPILOT_VERSION_DATA::ID);
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL if self.streams.set(first as u32, second, Instant::now()) => {
                result = MavResult::MAV_RESULT_ACCEPTED;
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {}
            // Arming, take-off, modes: the flight has its own commands for what can be done to it.
            _ => result = MavResult::MAV_RESULT_DENIED,
        }
        if message.is_some() {
            result = MavResult::MAV_RESULT_ACCEPTED;
        }
        let acknowledged = MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
            command,
            result,
            progress: 0,
            result_param2: 0,
            target_system: from.system_id as u8,
            target_component: from.component_id,
        });
        [acknowledged].into_iter().chain(message).collect()
    }
}
