//! Newest messages of the flight, and the MAVLink messages that are made of them.
//!
//! Position, velocity, attitude and rates are the measured ones of STATE, as an autopilot's are; times count from the
//! first sample. MAVLink uses the flight's own frames: NED, and forward-right-down for the body.

use airframe::angle::wrapped;
use contract::message::{Actuators, PlantStatus, Reference, State, mixer_flags};
use flight::event::{TimedEvent, What};
use flight::log::Record;
use mavlink::MessageData;
#[allow(clippy::wildcard_imports, reason = "the dialect's own names, all in capitals")]
use mavlink::dialects::common::*;
use nalgebra::{UnitQuaternion, Vector3};
use settings::Scenario;

use crate::home::Home;

/// Pulse width of a standing rotor, and of the largest tilt to the left \[us\].
const LOW_US: f64 = 1000.0;
/// Difference between the largest and the smallest pulse width \[us\].
const SPAN_US: f64 = 1000.0;
/// Characters of a STATUSTEXT; longer texts take several.
const TEXT_CHARS: usize = 50;

/// Vehicle as its newest messages show it.
pub struct MavlinkVehicle {
    home: Home,
    limits: airframe::ActuatorLimits,
    sample_ns: u64,
    state: Option<State>,
    reference: Option<Reference>,
    actuators: Option<Actuators>,
}

impl MavlinkVehicle {
    /// Returns the vehicle of `scenario` before its first message.
    pub fn new(scenario: &Scenario, home: Home) -> Self {
        let sample_ns = scenario.sample_ns();
        Self { home, limits: scenario.limits(), sample_ns, state: None, reference: None, actuators: None }
    }

    /// Takes a message of the ring, unless it is damaged or was not delivered to the nodes.
    pub fn observe(&mut self, record: &Record) {
        if !record.is_intact() || !record.stamped().is_some_and(|(_, stamp)| stamp.is_delivered()) {
            return;
        }
        match record {
            Record::State(state) => self.state = Some(*state),
            Record::Reference(reference) => self.reference = Some(*reference),
            Record::Actuators(actuators) => self.actuators = Some(*actuators),
            Record::Controls(_) | Record::Truth(_) => {}
        }
    }

    /// Returns the message with the number `id`; `None` if it has no source yet, or is none of this vehicle.
    pub fn message(&self, id: u32) -> Option<MavMessage> {
        match id {
            HEARTBEAT_DATA::ID => Some(self.heartbeat()),
            AUTOPILOT_VERSION_DATA::ID => Some(autopilot_version()),
            HOME_POSITION_DATA::ID => Some(self.home_position()),
            ATTITUDE_DATA::ID => self.state.as_ref().map(|state| self.attitude(state)),
            LOCAL_POSITION_NED_DATA::ID => self.state.as_ref().map(|state| self.local_position(state)),
            GLOBAL_POSITION_INT_DATA::ID => self.state.as_ref().map(|state| self.global_position(state)),
            EXTENDED_SYS_STATE_DATA::ID => self.status().map(extended_state),
            POSITION_TARGET_LOCAL_NED_DATA::ID => self.reference.as_ref().map(|of| self.position_target(of)),
            ATTITUDE_TARGET_DATA::ID => self.reference.as_ref().map(|of| self.attitude_target(of)),
            SERVO_OUTPUT_RAW_DATA::ID => self.actuators.as_ref().map(|of| self.servo_output(of)),
            _ => None,
        }
    }

    /// Returns the heartbeat after the end of the flight: disarmed.
    pub fn last_heartbeat(&self) -> MavMessage {
        let failed = self.status().is_some_and(PlantStatus::failed);
        let state = if failed { MavState::MAV_STATE_EMERGENCY } else { MavState::MAV_STATE_STANDBY };
        heartbeat(false, state)
    }

    fn status(&self) -> Option<PlantStatus> {
        PlantStatus::from_wire(self.state.as_ref()?.status)
    }

    fn heartbeat(&self) -> MavMessage {
        let is_fallback = self.actuators.as_ref().is_some_and(|of| mixer_flags::fallback(of.flags));
        match self.status() {
            None => heartbeat(false, MavState::MAV_STATE_BOOT),
            Some(status) if status.failed() => heartbeat(false, MavState::MAV_STATE_EMERGENCY),
            Some(PlantStatus::Standing) => heartbeat(false, MavState::MAV_STATE_STANDBY),
            Some(status) if status.is_last() => heartbeat(false, MavState::MAV_STATE_STANDBY),
            Some(_) if is_fallback => heartbeat(true, MavState::MAV_STATE_CRITICAL),
            Some(_) => heartbeat(true, MavState::MAV_STATE_ACTIVE),
        }
    }

    /// Returns the time of the sample of `tick`, since the first sample \[ms\].
    fn time_ms(&self, tick: u64) -> u32 {
        (tick * self.sample_ns / 1_000_000) as u32
    }

    fn attitude(&self, state: &State) -> MavMessage {
        let [roll, pitch, yaw] = state.measured.attitude_rad.map(|angle| wrapped(angle) as f32);
        let [rollspeed, pitchspeed, yawspeed] = state.measured.rates_radps.map(|rate| rate as f32);
        let time_boot_ms = self.time_ms(state.stamp.tick);
        MavMessage::ATTITUDE(ATTITUDE_DATA { time_boot_ms, roll, pitch, yaw, rollspeed, pitchspeed, yawspeed })
    }

    fn local_position(&self, state: &State) -> MavMessage {
        let [x, y, z] = state.measured.position_m.map(|axis| axis as f32);
        let [vx, vy, vz] = velocity_ned_mps(state).map(|axis| axis as f32);
        let time_boot_ms = self.time_ms(state.stamp.tick);
        MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA { time_boot_ms, x, y, z, vx, vy, vz })
    }

    fn global_position(&self, state: &State) -> MavMessage {
        let [lat, lon, alt] = self.home.at(state.measured.position_m);
        let [vx, vy, vz] = velocity_ned_mps(state).map(|axis| (axis * 1e2).round() as i16);
        let heading_deg = state.measured.attitude_rad[2].to_degrees().rem_euclid(360.0);
        MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.time_ms(state.stamp.tick),
            lat,
            lon,
            alt,
            relative_alt: (-state.measured.position_m[2] * 1e3).round() as i32,
            vx,
            vy,
            vz,
            hdg: (heading_deg * 1e2).round() as u16 % 36_000,
        })
    }

    fn home_position(&self) -> MavMessage {
        let [latitude, longitude, altitude] = self.home.at([0.0; 3]);
        let q = [1.0, 0.0, 0.0, 0.0];
        MavMessage::HOME_POSITION(HOME_POSITION_DATA { latitude, longitude, altitude, q, ..Default::default() })
    }

    fn position_target(&self, reference: &Reference) -> MavMessage {
        let [x, y, z] = reference.position_m.map(|axis| axis as f32);
        let [vx, vy, vz] = reference.velocity_mps.map(|axis| axis as f32);
        MavMessage::POSITION_TARGET_LOCAL_NED(POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: self.time_ms(reference.stamp.tick),
            x,
            y,
            z,
            vx,
            vy,
            vz,
            yaw: wrapped(reference.attitude_rad[2]) as f32,
            type_mask: PositionTargetTypemask::POSITION_TARGET_TYPEMASK_AX_IGNORE
                | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_AY_IGNORE
                | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_AZ_IGNORE
                | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE,
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            ..Default::default()
        })
    }

    fn attitude_target(&self, reference: &Reference) -> MavMessage {
        let attitude = rotation(reference.attitude_rad);
        let [body_roll_rate, body_pitch_rate, body_yaw_rate] = reference.rates_radps.map(|rate| rate as f32);
        MavMessage::ATTITUDE_TARGET(ATTITUDE_TARGET_DATA {
            time_boot_ms: self.time_ms(reference.stamp.tick),
            q: [attitude.w, attitude.i, attitude.j, attitude.k].map(|part| part as f32),
            body_roll_rate,
            body_pitch_rate,
            body_yaw_rate,
            thrust: 0.0,
            type_mask: AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE,
        })
    }

    /// Makes the pulse widths: outputs 1 to 3 are the rotors, from standstill at 1000 us to their limits at 2000 us;
    /// output 4 is the tilt of rotor 1, from the left limit at 1000 us to the right one at 2000 us.
    fn servo_output(&self, actuators: &Actuators) -> MavMessage {
        let command = actuators.command;
        let pulse = |share: f64| (LOW_US + SPAN_US * share.clamp(0.0, 1.0)).round() as u16;
        let rotor = |i: usize| pulse(command.rotor_speed[i] / self.limits.rotor_speed_max[i]);
        MavMessage::SERVO_OUTPUT_RAW(SERVO_OUTPUT_RAW_DATA {
            time_usec: self.time_ms(actuators.stamp.tick).wrapping_mul(1000),
            servo1_raw: rotor(0),
            servo2_raw: rotor(1),
            servo3_raw: rotor(2),
            servo4_raw: pulse(0.5 + 0.5 * command.tilt_rad / self.limits.tilt_max_rad),
            ..Default::default()
        })
    }
}

/// `custom_mode` of HEARTBEAT in the only mode, in which the mission of the scenario is flown; `docs/mavlink.md` has
/// the mode's name.
const SCENARIO_MODE: u32 = 0;

/// Makes the heartbeat of a vehicle that flies by itself and is stabilised, without modes that a station could choose.
/// Without the flag `CUSTOM_MODE_ENABLED` a station shows these flags; with it, some stations show mode 0 of another
/// autopilot.
fn heartbeat(armed: bool, system_status: MavState) -> MavMessage {
    let flying = MavModeFlag::MAV_MODE_FLAG_AUTO_ENABLED | MavModeFlag::MAV_MODE_FLAG_STABILIZE_ENABLED;
    let armed = if armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: SCENARIO_MODE,
        mavtype: MavType::MAV_TYPE_TRICOPTER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_GENERIC,
        base_mode: flying | armed,
        system_status,
        mavlink_version: 3,
    })
}

fn extended_state(status: PlantStatus) -> MavMessage {
    let landed_state = match status {
        PlantStatus::Flying | PlantStatus::Finished => MavLandedState::MAV_LANDED_STATE_IN_AIR,
        PlantStatus::TakingOff => MavLandedState::MAV_LANDED_STATE_TAKEOFF,
        PlantStatus::Landing => MavLandedState::MAV_LANDED_STATE_LANDING,
        PlantStatus::NonFinite | PlantStatus::TooFar | PlantStatus::TooFast => {
            MavLandedState::MAV_LANDED_STATE_UNDEFINED
        }
        _ => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
    };
    let vtol_state = MavVtolState::MAV_VTOL_STATE_UNDEFINED; // the vehicle has no wing
    MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA { vtol_state, landed_state })
}

/// Makes the version of this program, with the first characters of its commit, and the protocols whose requests are
/// answered. The bit for missions is set, because without it a station does not ask for the list of missions, which is
/// empty.
fn autopilot_version() -> MavMessage {
    let program = flight::provenance::ProgramIdentity::this();
    let mut numbers = program.version.split('.').map(|number| number.parse::<u32>().unwrap_or(0));
    let mut next = || numbers.next().unwrap_or(0) & 0xff;
    let (major, minor, patch) = (next(), next(), next());
    let mut flight_custom_version = [0; 8];
    let commit = program.git.unwrap_or_default().commit;
    flight_custom_version.iter_mut().zip(commit.bytes()).for_each(|(to, byte)| *to = byte);
    MavMessage::AUTOPILOT_VERSION(AUTOPILOT_VERSION_DATA {
        capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
        flight_sw_version: major << 24 | minor << 16 | patch << 8,
        flight_custom_version,
        ..Default::default()
    })
}

/// Returns an event as texts for the station: at most 50 characters each, numbered if there are several.
pub fn status_texts(event: &TimedEvent) -> Vec<MavMessage> {
    let of = &event.event;
    let why = of.why.as_ref().map_or(String::new(), |why| format!(": {why}"));
    let text = format!("{:.2} s: {} {}{why}", event.at_s, of.node, event.what());
    texts(severity(of.what), &text, (of.tick as u16).wrapping_add(1))
}

/// Splits `text` into messages; `id` marks the messages of one text, if there are several.
pub fn texts(severity: MavSeverity, text: &str, id: u16) -> Vec<MavMessage> {
    // The dialect allows UTF-8, but stations show ASCII.
    let bytes: Vec<u8> = text.chars().map(|c| if c.is_ascii() && !c.is_control() { c as u8 } else { b'?' }).collect();
    let is_one = bytes.len() <= TEXT_CHARS;
    let mut chunks: Vec<&[u8]> = bytes.chunks(TEXT_CHARS).collect();
    if !is_one && bytes.len().is_multiple_of(TEXT_CHARS) {
        chunks.push(&[]); // a text ends with the chunk that is not full
    }
    let message = |(chunk_seq, chunk): (usize, &&[u8])| {
        let mut text = [0; TEXT_CHARS];
        text.iter_mut().zip(*chunk).for_each(|(to, byte)| *to = *byte);
        let id = if is_one { 0 } else { id.max(1) };
        MavMessage::STATUSTEXT(STATUSTEXT_DATA { severity, text: text.into(), id, chunk_seq: chunk_seq as u8 })
    };
    chunks.iter().enumerate().map(message).collect()
}

fn severity(what: What) -> MavSeverity {
    match what {
        What::GivenUp => MavSeverity::MAV_SEVERITY_CRITICAL,
        What::Died | What::Hung | What::NotStarted | What::Returned => MavSeverity::MAV_SEVERITY_ERROR,
        What::Injected | What::Rejected | What::ShmRemoved | What::ShmCutShort => MavSeverity::MAV_SEVERITY_WARNING,
        What::TookOver | What::Kept | What::Cleared => MavSeverity::MAV_SEVERITY_NOTICE,
        What::Started | What::OnStandby => MavSeverity::MAV_SEVERITY_INFO,
    }
}

/// Returns the velocity in NED \[m/s\], rotated from the body frame of STATE.
fn velocity_ned_mps(state: &State) -> [f64; 3] {
    (rotation(state.measured.attitude_rad) * Vector3::from(state.measured.velocity_mps)).into()
}

/// Returns the rotation from the body frame to NED, for Euler angles phi, theta, psi \[rad\].
fn rotation([phi, theta, psi]: [f64; 3]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(phi, theta, psi)
}

#[cfg(test)]
mod tests;
