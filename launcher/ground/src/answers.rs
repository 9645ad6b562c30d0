//! Answers to a ground station. A station can ask, and choose the rates of messages; nothing that it sends changes the
//! flight.
//!
//! QGroundControl asks for `AUTOPILOT_VERSION`, component metadata, standard modes, all parameters and the mission, one
//! after the other, and retries if no answer comes. So requests for anything that does not exist are refused at once.

use std::time::Instant;

#[allow(clippy::wildcard_imports, reason = "the dialect's own names, all in capitals")]
use mavlink::dialects::common::*;
use mavlink::types::CharArray;
use mavlink::{MavHeader, Message, MessageData};

use crate::link::{COMPONENT, SYSTEM};
use crate::parameters::MavlinkParameters;
use crate::streams::Streams;
use crate::vehicle::{MavlinkVehicle, texts};

/// Everything that a station can ask for.
pub struct Station {
    pub vehicle: MavlinkVehicle,
    pub parameters: MavlinkParameters,
    pub streams: Streams,
}

impl Station {
    /// Returns the answers to `request`; none if it is for another system or component, or needs no answer.
    #[expect(deprecated, reason = "MISSION_REQUEST and MISSION_ITEM are the requests of stations before 2020")]
    pub fn answer(&mut self, from: MavHeader, request: &MavMessage) -> Vec<MavMessage> {
        let is_ours = |target: Option<u8>, own: u8| target.is_some_and(|target| [0, own].contains(&target));
        if !is_ours(request.target_system_id(), SYSTEM) || !is_ours(request.target_component_id(), COMPONENT) {
            return vec![];
        }
        let refused = |mission| vec![mission_ack(from, mission, MavMissionResult::MAV_MISSION_DENIED)];
        let no_such_item = |mission| vec![mission_ack(from, mission, MavMissionResult::MAV_MISSION_INVALID_SEQUENCE)];
        match request {
            MavMessage::PARAM_REQUEST_LIST(_) => self.parameters.all(),
            MavMessage::PARAM_REQUEST_READ(of) => {
                let value = self.parameters.find(of.param_id.to_str().unwrap_or_default(), of.param_index);
                let missing = MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST;
                vec![value.unwrap_or_else(|| param_error(from, of.param_id, of.param_index, missing))]
            }
            MavMessage::PARAM_SET(of) => self.refuse(from, of),
            MavMessage::COMMAND_LONG(of) => self.command(from, of.command, [of.param1, of.param2]),
            MavMessage::COMMAND_INT(of) => self.command(from, of.command, [of.param1, of.param2]),
            MavMessage::MISSION_REQUEST_LIST(of) => vec![mission_count(from, of.mission_type)],
            MavMessage::MISSION_REQUEST_INT(of) => no_such_item(of.mission_type),
            MavMessage::MISSION_REQUEST(of) => no_such_item(of.mission_type),
            MavMessage::MISSION_REQUEST_PARTIAL_LIST(of) => no_such_item(of.mission_type),
            MavMessage::MISSION_COUNT(of) => refused(of.mission_type),
            MavMessage::MISSION_CLEAR_ALL(of) => refused(of.mission_type),
            MavMessage::MISSION_WRITE_PARTIAL_LIST(of) => refused(of.mission_type),
            MavMessage::MISSION_ITEM_INT(of) => refused(of.mission_type),
            MavMessage::MISSION_ITEM(of) => refused(of.mission_type),
            // The protocol answers MISSION_SET_CURRENT with a text, not with a MISSION_ACK.
            MavMessage::MISSION_SET_CURRENT(_) => {
                texts(MavSeverity::MAV_SEVERITY_WARNING, "a flight keeps the mission of its scenario", 1)
            }
            _ => vec![],
        }
    }

    /// Answers an attempt to set a parameter: the error comes first, since a station acts on the first answer. The
    /// present value is for stations that do not know `PARAM_ERROR`, the text for people.
    fn refuse(&self, from: MavHeader, of: &PARAM_SET_DATA) -> Vec<MavMessage> {
        let name = of.param_id.to_str().unwrap_or_default();
        let Some(value) = self.parameters.find(name, -1) else {
            return vec![param_error(from, of.param_id, -1, MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST)];
        };
        let error = param_error(from, of.param_id, -1, MavParamError::MAV_PARAM_ERROR_READ_ONLY);
        let text = format!("{name} is read-only: a flight keeps its settings");
        [vec![error, value], texts(MavSeverity::MAV_SEVERITY_WARNING, &text, 1)].concat()
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
            // Arming, take-off, modes: a flight is controlled only by commands of `trefoil`.
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

/// Makes the number of items of a mission: 0, since the missions of a scenario are no lists of waypoints.
fn mission_count(to: MavHeader, mission_type: MavMissionType) -> MavMessage {
    MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
        count: 0,
        target_system: to.system_id as u8,
        target_component: to.component_id,
        mission_type,
        opaque_id: 0,
    })
}

fn mission_ack(to: MavHeader, mission_type: MavMissionType, result: MavMissionResult) -> MavMessage {
    MavMessage::MISSION_ACK(MISSION_ACK_DATA {
        target_system: to.system_id as u8,
        target_component: to.component_id,
        mavtype: result,
        mission_type,
        opaque_id: 0,
    })
}

/// Makes the error for a parameter, with the name and the index of the request.
fn param_error(to: MavHeader, param_id: CharArray<16>, param_index: i16, error: MavParamError) -> MavMessage {
    MavMessage::PARAM_ERROR(PARAM_ERROR_DATA {
        param_index,
        target_system: to.system_id as u8,
        target_component: to.component_id,
        param_id,
        error,
    })
}

#[cfg(test)]
mod tests;
