//! Settings of the flight as parameters, which stations can list but not change.
//!
//! A parameter's name has at most 16 characters, so a table maps each name to the key of its setting. Values are 32-bit
//! numbers: a setting is rounded to about seven digits. A switch is 0 or 1. A setting that the scenario leaves out, or
//! that is a word, has no parameter.

use mavlink::dialects::common::{MavMessage, MavParamType, PARAM_VALUE_DATA};
use settings::{Scenario, to_toml};
use toml::{Table, Value};

/// Parameters by name, with the key of the setting; a number in a key is a place in a list.
#[rustfmt::skip]
pub const NAMES: [(&str, &str); 63] = [
    ("RUN_RATE_HZ", "run.rate_hz"), ("RUN_DURATION_S", "run.duration_s"), ("RUN_SEED", "run.seed"),
    ("RUN_DELAY_MS", "run.command_delay_ms"), ("RUN_JITTER_MS", "run.command_jitter_ms"),
    ("RUN_DROP_PROB", "run.command_drop_probability"),
    ("AF_MASS_KG", "airframe.mass_kg"), ("AF_IXX_KGM2", "airframe.ixx_kgm2"), ("AF_IYY_KGM2", "airframe.iyy_kgm2"),
    ("AF_IZZ_KGM2", "airframe.izz_kgm2"), ("AF_L1_M", "airframe.l1_m"), ("AF_L2_M", "airframe.l2_m"),
    ("AF_L3_M", "airframe.l3_m"), ("AF_KF", "airframe.kf"), ("AF_KM", "airframe.km"),
    ("PL_SUBSTEP_S", "plant.substep_s"), ("PL_ROTOR_LAG_S", "plant.rotor_lag_s"), ("PL_SERVO_LAG_S", "plant.servo_lag_s"),
    ("PL_ROTOR_MIN", "plant.rotor_speed_min"), ("PL_ROTOR_RATIO", "plant.rotor_speed_max_ratio"),
    ("PL_TILT_MAX_DEG", "plant.tilt_max_deg"),
    ("GD_KP_PHI", "guidance.kp_phi"), ("GD_KI_PHI", "guidance.ki_phi"), ("GD_KD_PHI", "guidance.kd_phi"),
    ("GD_KP_THETA", "guidance.kp_theta"), ("GD_KI_THETA", "guidance.ki_theta"), ("GD_KD_THETA", "guidance.kd_theta"),
    ("GD_KP_W", "guidance.kp_w"), ("GD_KI_W", "guidance.ki_w"), ("GD_KD_W", "guidance.kd_w"),
    ("GD_ANGLE_DEG", "guidance.angle_limit_deg"), ("GD_CLIMB_MPS", "guidance.climb_limit_mps"),
    ("GD_HEADING_DPS", "guidance.heading_rate_limit_dps"), ("GD_INT_LIMIT", "guidance.integral_limit"),
    ("MPC_NP_S", "attitude.mpc.prediction_horizon_s"), ("MPC_NU_S", "attitude.mpc.control_horizon_s"),
    ("MPC_Q1", "attitude.mpc.q.0"), ("MPC_Q2", "attitude.mpc.q.1"), ("MPC_Q3", "attitude.mpc.q.2"),
    ("MPC_Q4", "attitude.mpc.q.3"), ("MPC_Q5", "attitude.mpc.q.4"), ("MPC_Q6", "attitude.mpc.q.5"), ("MPC_Q7", "attitude.mpc.q.6"),
    ("MPC_R1", "attitude.mpc.r.0"), ("MPC_R2", "attitude.mpc.r.1"), ("MPC_R3", "attitude.mpc.r.2"),
    ("MPC_R4", "attitude.mpc.r.3"),
    ("MPC_MAX_ITER", "attitude.mpc.max_iterations"), ("MPC_TIME_MS", "attitude.mpc.time_limit_ms"),
    ("MPC_LAG_S", "attitude.actuator_lag_model_s"),
    ("MPC_DELAY_COMP", "attitude.delay_compensation"), ("MPC_DIST_GAIN", "attitude.disturbance_gain"),
    ("MX_PROJECTION", "mixer.projection"), ("MX_TILT_REACT", "mixer.tilt_reaction"),
    ("RT_PRIORITY", "realtime.priority"), ("RT_LOCK_MEMORY", "realtime.lock_memory"), ("RT_RTTIME_MS", "realtime.rttime_ms"),
    ("DL_END_MS", "deadline.end_to_end_ms"), ("DL_MPC_MS", "node.attitude-mpc.deadline_ms"),
    ("SV_HANG_MS", "supervision.hang_ms"),
    ("SV_START_S", "supervision.start_limit_s"),
    ("BD_ERROR_M", "bounds.max_position_error_m"), ("BD_FALLBACK_S", "bounds.max_fallback_s"),
];

/// Parameters of one flight.
pub struct MavlinkParameters(Vec<(&'static str, f32)>);

impl MavlinkParameters {
    /// Reads the settings of `scenario`.
    pub fn of(scenario: &Scenario) -> Self {
        let table: Table = to_toml(scenario).parse().unwrap_or_default(); // written settings always parse
        let table = Value::Table(table);
        Self(NAMES.iter().filter_map(|(name, key)| Some((*name, number(&table, key)?))).collect())
    }

    /// Returns all parameters, in order.
    pub fn all(&self) -> Vec<MavMessage> {
        (0..self.0.len()).filter_map(|index| self.at(index)).collect()
    }

    /// Returns the parameter at `index`, or named `name` if `index` is negative; `None` if there is none.
    pub fn find(&self, name: &str, index: i16) -> Option<MavMessage> {
        let of_name = || self.0.iter().position(|(of, _)| *of == name);
        self.at(usize::try_from(index).ok().or_else(of_name)?)
    }

    fn at(&self, index: usize) -> Option<MavMessage> {
        let (name, param_value) = self.0.get(index)?;
        Some(MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value: *param_value,
            param_count: self.0.len() as u16,
            param_index: index as u16,
            param_id: (*name).into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        }))
    }
}

/// Returns the number or switch at `key`; `None` if it is absent, or of another type.
fn number<'a>(table: &'a Value, key: &str) -> Option<f32> {
    let step = |value: &'a Value, word: &str| match word.parse::<usize>() {
        Ok(place) => value.get(place),
        Err(_) => value.get(word),
    };
    match key.split('.').try_fold(table, step)? {
        Value::Integer(number) => Some(*number as f32),
        Value::Float(number) => Some(*number as f32),
        Value::Boolean(is_on) => Some(f32::from(u8::from(*is_on))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use settings::DelayCompensation;

    use super::*;

    #[test]
    fn every_name_fits_is_unique_and_has_a_setting_where_the_scenario_gives_one() {
        let mut scenario = Scenario::default();
        // The default, "measured", is a word, and no parameter can show it.
        scenario.attitude.delay_compensation = DelayCompensation::Sample(true);
        (scenario.deadline.end_to_end_ms, scenario.node.attitude_mpc.deadline_ms) = (Some(9.0), Some(7.0));
        (scenario.bounds.max_position_error_m, scenario.bounds.max_fallback_s) = (Some(0.5), Some(2.0));
        let parameters = MavlinkParameters::of(&scenario);
        let names: Vec<&str> = parameters.0.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, NAMES.map(|(name, _)| name), "all settings are found");
        assert!(names.iter().all(|name| name.len() <= 16), "{names:?}");
        let unique: std::collections::BTreeSet<&str> = names.iter().copied().collect();
        assert_eq!(unique.len(), names.len());
        let value = |name: &str| parameters.0.iter().find(|(of, _)| *of == name).map(|(_, value)| *value);
        assert_eq!([value("DL_MPC_MS"), value("MPC_Q1")], [Some(7.0), Some(scenario.attitude.mpc.q[0] as f32)]);
        assert_eq!(value("RT_LOCK_MEMORY"), Some(1.0));
    }

    #[test]
    fn settings_that_are_left_out_have_no_parameter() {
        let parameters = MavlinkParameters::of(&Scenario::default());
        assert!(parameters.find("DL_END_MS", -1).is_none());
        assert!(parameters.find("MPC_DELAY_COMP", -1).is_none(), "a word is no number");
        assert!(parameters.find("RUN_RATE_HZ", -1).is_some() && parameters.find("", 0).is_some());
        assert!(parameters.find("", parameters.all().len() as i16).is_none() && parameters.find("NO", -1).is_none());
    }
}
