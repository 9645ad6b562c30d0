//! `[mission]` and `[initial]`: the trajectory and the initial state.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::part::{MissionLimits, Part};

/// Trajectory and heading reference, `[mission]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mission {
    /// Kind of trajectory.
    pub trajectory: TrajectoryKind,
    /// `step`: position reference after the step from the origin, NED \[m\].
    pub step_m: [f64; 3],
    /// `step`: time of the step \[s\].
    pub step_at_s: f64,
    /// `waypoints`: positions NED \[m\], reached at `times_s`.
    pub waypoints_m: Vec<[f64; 3]>,
    /// `waypoints`: time at which each is reached \[s\], rising.
    pub times_s: Vec<f64>,
    /// Shape of the velocity between waypoints: seconds of ramp \[s\] (0 = constant velocity), `"min-jerk"` or
    /// `"spline"`.
    pub ramp_s: Ramp,
    /// `circle`: radius \[m\].
    pub radius_m: f64,
    /// `circle`: height above the origin \[m\].
    pub height_m: f64,
    /// `circle`: mean duration of a lap \[s\].
    pub period_s: f64,
    /// `circle`: number of laps. A single lap is min-jerk, from rest to rest. Several laps are flown at constant speed,
    /// except for the first and the last half lap.
    pub laps: u32,
    /// Heading reference \[deg\], from north over east: one value, or steps `[[t_s, deg], ...]`. The parts of `parts`
    /// have their own.
    pub heading_deg: Heading,
    /// `parts`: limits of the curves.
    pub limits: MissionLimits,
    /// `parts`: parts in order.
    pub part: Vec<Part>,
}

/// Kind of trajectory, `mission.trajectory`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TrajectoryKind {
    /// The paper's surveillance square, 8 m in 60 s, as inferred in docs/paper.md.
    Survey,
    /// Hover at the origin.
    Hover,
    /// One step of the position reference.
    Step,
    /// Climb to `height_m`, `laps` circles of `radius_m` and `period_s`, descent; climb and descent take 10 s each.
    Circle,
    /// The scenario's own waypoints.
    Waypoints,
    /// The parts of `[[mission.part]]`, one after the other, from the initial position on.
    Parts,
}

/// Shape of the velocity, `mission.ramp_s`: seconds of ramp (0 = constant velocity), `"min-jerk"` or `"spline"`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected seconds, \"min-jerk\" or \"spline\"")]
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
    /// One curve of least jerk through all waypoints, at rest at the first and the last only.
    #[serde(rename = "spline")]
    Spline,
}

/// Heading reference, `mission.heading_deg`: one value, or `[[t_s, deg], ...]` steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected degrees, or steps [[t_s, deg], ...]")]
pub enum Heading {
    /// Constant heading \[deg\].
    Constant(f64),
    /// Start times \[s\], each with the heading from then on \[deg\].
    Steps(Vec<(f64, f64)>),
}

/// Initial state, `[initial]`, added to hover trim, or to standing still.
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
