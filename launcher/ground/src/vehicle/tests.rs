use contract::message::{Kinematics, Stamp};
use flight::event::Event;
use settings::Scenario;

use super::*;

/// A vehicle that has sent the given state.
fn vehicle(measured: Kinematics, status: PlantStatus, tick: u64) -> MavlinkVehicle {
    let mut vehicle = MavlinkVehicle::new(&Scenario::default(), Home::USUAL.parse().unwrap());
    let stamp = Stamp { tick, ..Stamp::default() };
    vehicle.state = Some(State { stamp, measured, status: status as u64, ..State::default() });
    vehicle
}

/// The text of messages, as a station puts them together.
fn joined(messages: &[MavMessage]) -> String {
    let chunk = |message: &MavMessage| match message {
        MavMessage::STATUSTEXT(of) => of.text.to_str().unwrap().to_owned(),
        other => panic!("{other:?}"),
    };
    messages.iter().map(chunk).collect()
}

#[test]
fn a_vehicle_that_heads_east_and_flies_forward_moves_east() {
    let east = std::f64::consts::FRAC_PI_2;
    let measured = Kinematics {
        position_m: [1.0, 2.0, -10.0],
        velocity_mps: [3.0, 0.0, 0.0],
        attitude_rad: [0.1, 0.0, east],
        rates_radps: [0.1, 0.2, 0.3],
    };
    let vehicle = vehicle(measured, PlantStatus::Flying, 150);
    let Some(MavMessage::LOCAL_POSITION_NED(local)) = vehicle.message(LOCAL_POSITION_NED_DATA::ID) else { panic!() };
    assert_eq!((local.time_boot_ms, local.x, local.y, local.z), (1500, 1.0, 2.0, -10.0));
    assert!(local.vx.abs() < 1e-6 && (local.vy - 3.0).abs() < 1e-6 && local.vz.abs() < 1e-6, "{local:?}");
    let Some(MavMessage::GLOBAL_POSITION_INT(global)) = vehicle.message(GLOBAL_POSITION_INT_DATA::ID) else { panic!() };
    assert_eq!((global.relative_alt, global.alt, global.hdg), (10_000, 498_000, 9_000));
    assert!(global.lat > 473_977_420 && global.lon > 85_455_940, "north and east of home: {global:?}");
    let Some(MavMessage::ATTITUDE(attitude)) = vehicle.message(ATTITUDE_DATA::ID) else { panic!() };
    assert_eq!((attitude.roll, attitude.yawspeed), (0.1, 0.3));
}

#[test]
fn the_heartbeat_follows_the_state_of_the_vehicle() {
    let state = |status, flags| {
        let mut vehicle = vehicle(Kinematics::default(), status, 0);
        vehicle.actuators = Some(Actuators { flags, ..Actuators::default() });
        let Some(MavMessage::HEARTBEAT(of)) = vehicle.message(HEARTBEAT_DATA::ID) else { panic!() };
        (of.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED), of.system_status)
    };
    assert_eq!(state(PlantStatus::Flying, 0), (true, MavState::MAV_STATE_ACTIVE));
    assert_eq!(state(PlantStatus::Flying, mixer_flags::LEVELLED), (true, MavState::MAV_STATE_CRITICAL));
    assert_eq!(state(PlantStatus::Standing, 0), (false, MavState::MAV_STATE_STANDBY));
    assert_eq!(state(PlantStatus::Landed, 0), (false, MavState::MAV_STATE_STANDBY));
    assert_eq!(state(PlantStatus::Crashed, 0), (false, MavState::MAV_STATE_EMERGENCY));
    let new = MavlinkVehicle::new(&Scenario::default(), Home::USUAL.parse().unwrap());
    let Some(MavMessage::HEARTBEAT(of)) = new.message(HEARTBEAT_DATA::ID) else { panic!() };
    assert_eq!(of.system_status, MavState::MAV_STATE_BOOT);
    assert!(new.message(ATTITUDE_DATA::ID).is_none() && new.message(SERVO_OUTPUT_RAW_DATA::ID).is_none());
}

#[test]
fn outputs_reach_from_standing_rotors_to_their_limits_and_tilt_to_both_sides() {
    let mut vehicle = vehicle(Kinematics::default(), PlantStatus::Flying, 0);
    let limits = Scenario::default().limits();
    let mut output = |rotor_speed, tilt_rad| {
        let command = contract::message::ActuationMsg { rotor_speed, tilt_rad };
        vehicle.actuators = Some(Actuators { command, ..Actuators::default() });
        let Some(MavMessage::SERVO_OUTPUT_RAW(of)) = vehicle.message(SERVO_OUTPUT_RAW_DATA::ID) else { panic!() };
        [of.servo1_raw, of.servo2_raw, of.servo3_raw, of.servo4_raw, of.servo5_raw]
    };
    assert_eq!(output([0.0; 3], -limits.tilt_max_rad), [1000, 1000, 1000, 1000, 0]);
    assert_eq!(output(limits.rotor_speed_max, limits.tilt_max_rad), [2000, 2000, 2000, 2000, 0]);
    assert_eq!(output(limits.rotor_speed_max.map(|max| max / 2.0), 0.0), [1500, 1500, 1500, 1500, 0]);
    assert_eq!(output([f64::NAN; 3], f64::NAN), [0; 5], "not used");
}

#[test]
fn events_become_texts_that_a_station_can_put_together_again() {
    let event = Event::new(250, "attitude-mpc", 2, What::Rejected).because("too far off: µ".repeat(9));
    let timed = TimedEvent { at_s: 2.5, cold: false, event };
    let messages = status_texts(&timed);
    assert!(messages.len() > 2);
    assert!(joined(&messages).starts_with("2.50 s: attitude-mpc rejected: too far off: ?"), "{}", joined(&messages));
    let chunks = messages.iter().map(|message| match message {
        MavMessage::STATUSTEXT(of) => (of.id, of.chunk_seq, of.severity),
        other => panic!("{other:?}"),
    });
    let expected = (0..messages.len()).map(|i| (251, i as u8, MavSeverity::MAV_SEVERITY_WARNING));
    assert!(chunks.eq(expected));
    let short = TimedEvent { at_s: 2.5, cold: false, event: Event::new(250, "mixer", 2, What::Started) };
    assert_eq!(joined(&status_texts(&short)), "2.50 s: mixer started");
    let full = texts(MavSeverity::MAV_SEVERITY_INFO, &"x".repeat(100), 7);
    assert_eq!((full.len(), joined(&full).len()), (3, 100), "the last chunk is not full");
}
