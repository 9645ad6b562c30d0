use settings::Scenario;

use super::*;
use crate::home::Home;

const GROUND: MavHeader = MavHeader { system_id: 255, component_id: 190, sequence: 0 };

fn station() -> Station {
    let scenario = Scenario::default();
    let vehicle = MavlinkVehicle::new(&scenario, Home::USUAL.parse().unwrap());
    Station { vehicle, parameters: MavlinkParameters::of(&scenario), streams: Streams::new(Instant::now()) }
}

/// Answers of a new station to `request` for system 1, component 1.
fn answers(mut request: MavMessage) -> Vec<MavMessage> {
    *request.target_system_id_mut().expect("a request has a target") = SYSTEM;
    *request.target_component_id_mut().expect("a request has a target") = COMPONENT;
    station().answer(GROUND, &request)
}

/// Requested place, name and error of the `PARAM_ERROR` that comes first, and its target.
fn error(answers: &[MavMessage]) -> (i16, &str, MavParamError, (u8, u8)) {
    let Some(MavMessage::PARAM_ERROR(of)) = answers.first() else { panic!("{answers:?}") };
    (of.param_index, of.param_id.to_str().unwrap(), of.error, (of.target_system, of.target_component))
}

#[test]
fn a_parameter_that_is_not_there_is_an_error_with_the_name_or_place_that_was_asked_for() {
    let read = |param_index: i16, name: &str| {
        answers(MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index,
            param_id: name.into(),
            ..Default::default()
        }))
    };
    let missing = MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST;
    assert_eq!(error(&read(-1, "SYSID_THISMAV")), (-1, "SYSID_THISMAV", missing, (255, 190)));
    assert_eq!(error(&read(-1, "SIXTEEN_LETTERS_")), (-1, "SIXTEEN_LETTERS_", missing, (255, 190)), "without a NUL");
    assert_eq!(error(&read(999, "")), (999, "", missing, (255, 190)));
    assert!(matches!(read(-1, "MPC_NP_S")[..], [MavMessage::PARAM_VALUE(_)]), "one that is there is its value");
    let not_text = PARAM_REQUEST_READ_DATA { param_index: -1, param_id: [0xff; 16].into(), ..Default::default() };
    let Some(MavMessage::PARAM_ERROR(of)) = answers(MavMessage::PARAM_REQUEST_READ(not_text)).pop() else { panic!() };
    assert_eq!((of.error, of.param_id), (missing, [0xff; 16].into()));
}

#[test]
fn no_parameter_can_be_set_and_the_error_says_why() {
    let set = |name: &str| {
        answers(MavMessage::PARAM_SET(PARAM_SET_DATA {
            param_value: 99.0,
            param_id: name.into(),
            ..Default::default()
        }))
    };
    let known = set("MPC_NP_S");
    assert_eq!(error(&known), (-1, "MPC_NP_S", MavParamError::MAV_PARAM_ERROR_READ_ONLY, (255, 190)));
    assert!(matches!(&known[1], MavMessage::PARAM_VALUE(of) if of.param_value == 0.2), "{known:?}");
    assert!(matches!(known[2], MavMessage::STATUSTEXT(_)));
    let unknown = set("NO");
    assert_eq!(error(&unknown), (-1, "NO", MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST, (255, 190)));
    assert_eq!(unknown.len(), 1);
}

/// Result and mission type of the only answer, a `MISSION_ACK` to the asking station.
fn acknowledged(request: MavMessage) -> (MavMissionResult, MavMissionType) {
    let answers = answers(request);
    let [MavMessage::MISSION_ACK(of)] = &answers[..] else { panic!("{answers:?}") };
    assert_eq!((of.target_system, of.target_component, of.opaque_id), (255, 190, 0));
    (of.mavtype, of.mission_type)
}

#[test]
#[expect(deprecated, reason = "stations before 2020 send MISSION_REQUEST and MISSION_ITEM")]
fn requests_for_missions_are_refused_with_the_reason() {
    for mission_type in [MavMissionType::MAV_MISSION_TYPE_MISSION, MavMissionType::MAV_MISSION_TYPE_FENCE] {
        let denied = (MavMissionResult::MAV_MISSION_DENIED, mission_type);
        for count in [0, 3] {
            let upload = MISSION_COUNT_DATA { count, mission_type, ..Default::default() };
            assert_eq!(acknowledged(MavMessage::MISSION_COUNT(upload)), denied);
        }
        let item = MISSION_ITEM_INT_DATA { mission_type, ..Default::default() };
        let old_item = MISSION_ITEM_DATA { mission_type, ..Default::default() };
        let part = MISSION_WRITE_PARTIAL_LIST_DATA { mission_type, ..Default::default() };
        for request in [
            MavMessage::MISSION_ITEM_INT(item),
            MavMessage::MISSION_ITEM(old_item),
            MavMessage::MISSION_WRITE_PARTIAL_LIST(part),
        ] {
            assert_eq!(acknowledged(request), denied);
        }
        let no_such_item = (MavMissionResult::MAV_MISSION_INVALID_SEQUENCE, mission_type);
        let request = MISSION_REQUEST_INT_DATA { mission_type, ..Default::default() };
        let old_request = MISSION_REQUEST_DATA { mission_type, ..Default::default() };
        let part = MISSION_REQUEST_PARTIAL_LIST_DATA { mission_type, ..Default::default() };
        for request in [
            MavMessage::MISSION_REQUEST_INT(request),
            MavMessage::MISSION_REQUEST(old_request),
            MavMessage::MISSION_REQUEST_PARTIAL_LIST(part),
        ] {
            assert_eq!(acknowledged(request), no_such_item);
        }
    }
    let all = MISSION_CLEAR_ALL_DATA { mission_type: MavMissionType::MAV_MISSION_TYPE_ALL, ..Default::default() };
    let denied = (MavMissionResult::MAV_MISSION_DENIED, MavMissionType::MAV_MISSION_TYPE_ALL);
    assert_eq!(acknowledged(MavMessage::MISSION_CLEAR_ALL(all)), denied);
    let jump = answers(MavMessage::MISSION_SET_CURRENT(MISSION_SET_CURRENT_DATA::default()));
    assert!(matches!(jump[..], [MavMessage::STATUSTEXT(_)]), "{jump:?}");
}

#[test]
fn every_announced_capability_is_answered() {
    let Some(MavMessage::AUTOPILOT_VERSION(of)) = station().vehicle.message(AUTOPILOT_VERSION_DATA::ID) else {
        panic!()
    };
    let has = |bit| of.capabilities.contains(bit);
    assert!(has(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_INT), "{of:?}");
    let list = answers(MavMessage::MISSION_REQUEST_LIST(MISSION_REQUEST_LIST_DATA::default()));
    assert!(matches!(&list[..], [MavMessage::MISSION_COUNT(of)] if of.count == 0), "{list:?}");
    acknowledged(MavMessage::MISSION_REQUEST_INT(MISSION_REQUEST_INT_DATA::default()));
    assert!(has(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT), "{of:?}");
    let command = answers(MavMessage::COMMAND_INT(COMMAND_INT_DATA::default()));
    assert!(matches!(command[..], [MavMessage::COMMAND_ACK(_)]), "{command:?}");
    assert!(!has(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_FENCE));
}

#[test]
fn requests_to_another_system_or_component_have_no_answer() {
    for (target_system, target_component, answered) in [(1, 1, true), (0, 0, true), (7, 1, false), (1, 100, false)] {
        let clear = MISSION_CLEAR_ALL_DATA { target_system, target_component, ..Default::default() };
        let read = PARAM_REQUEST_READ_DATA { target_system, target_component, param_index: 999, ..Default::default() };
        for request in [MavMessage::MISSION_CLEAR_ALL(clear), MavMessage::PARAM_REQUEST_READ(read)] {
            assert_eq!(!station().answer(GROUND, &request).is_empty(), answered, "{request:?}");
        }
    }
    assert!(station().answer(GROUND, &MavMessage::HEARTBEAT(HEARTBEAT_DATA::default())).is_empty());
}
