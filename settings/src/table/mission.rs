//! `[mission]` and `[initial]`: the trajectory and the initial state.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::table::part::{MissionLimits, MissionPart};

/// Trajectory and heading reference, `[mission]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mission {
    /// Kind of trajectory; absent = `parts` for a scenario with `[[mission.part]]`.
    pub trajectory: TrajectoryKind,
    /// `survey`: velocity along each leg: seconds of ramp at both ends \[s\], at most 5 (0 = constant velocity), or
    /// `"min-jerk"`.
    pub ramp_s: Ramp,
    /// `survey`, `hover`: heading reference \[deg\], from north over east. The parts of `parts` have their own.
    pub heading_deg: f64,
    /// `parts`: limits of the curves.
    pub limits: MissionLimits,
    /// `parts`: parts in order.
    #[schemars(example = serde_json::json!([{ "kind": "takeoff", "height_m": 5.0 }]))]
    pub part: Vec<MissionPart>,
}

/// Kind of trajectory, `mission.trajectory`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TrajectoryKind {
    /// The paper's surveillance square, 8 m in 60 s, as inferred in docs/paper.md.
    Survey,
    /// Hover at the origin.
    Hover,
    /// The parts of `[[mission.part]]`, one after the other, from the initial position on.
    Parts,
}

/// Velocity along each leg of the survey, `mission.ramp_s`: seconds of ramp (0 = constant velocity), or `"min-jerk"`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected seconds or \"min-jerk\"")]
pub enum Ramp {
    /// Trapezoid of velocity with ramps this long \[s\].
    Seconds(f64),
    /// A named shape.
    Named(RampName),
}

/// Named shapes of the velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum RampName {
    /// Legs that are quintics with zero velocity and acceleration at both ends.
    #[serde(rename = "min-jerk")]
    MinJerk,
}

/// Initial state, `[initial]`, added to the hover trim, or to the state of a vehicle that stands.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Initial {
    /// Position, NED \[m\], within 500 m of the origin.
    pub position_m: [f64; 3],
    /// Velocity u, v, w, body \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Euler angles roll, pitch, yaw \[deg\]; the pitch lies between -88 and 88.
    pub attitude_deg: [f64; 3],
    /// Body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// `true` if the vehicle starts on the ground, level, with the rotors idling, instead of at hover trim.
    pub standing: bool,
}
