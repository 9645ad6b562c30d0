//! `[mission]` and `[initial]`: where to fly, and where to start.

use serde::{Deserialize, Serialize};

/// `[mission]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mission {
    /// Which trajectory.
    pub trajectory: TrajectoryKind,
    /// `step`: from 0 to this, NED \[m\].
    pub step_m: [f64; 3],
    /// `step`: when \[s\].
    pub step_at_s: f64,
    /// `waypoints`: NED \[m\], reached at `times_s`.
    pub waypoints_m: Vec<[f64; 3]>,
    /// `waypoints`: when each is reached \[s\].
    pub times_s: Vec<f64>,
    /// How the velocity rises and falls between waypoints.
    pub ramp_s: Ramp,
    /// `circle`: \[m\].
    pub radius_m: f64,
    /// `circle`: above the ground \[m\].
    pub height_m: f64,
    /// `circle`: mean duration of a lap \[s\].
    pub period_s: f64,
    /// `circle`: how often round. One lap is min-jerk, from rest to rest; of several, all but the first and the last half lap are
    /// flown at constant speed.
    pub laps: u32,
    /// Heading reference \[deg\], constant or steps.
    pub heading_deg: Heading,
}

/// `mission.trajectory`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TrajectoryKind {
    /// The paper's surveillance square, 8 m in 60 s, as docs/paper.md infers it.
    Survey,
    /// Stay at the origin.
    Hover,
    /// One step of the position reference.
    Step,
    /// Climb to `height_m`, `laps` of `radius_m` and `period_s`, descend; climb and descent take 10 s each.
    Circle,
    /// The scenario's own waypoints.
    Waypoints,
}

/// `mission.ramp_s`: seconds of velocity ramp (0 = constant velocity), `"min-jerk"` or `"spline"`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected seconds, \"min-jerk\" or \"spline\"")]
pub enum Ramp {
    /// Trapezoid of velocity with ramps this long \[s\].
    Seconds(f64),
    /// A named shape.
    Named(RampName),
}

/// The named shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RampName {
    /// Each leg a quintic with zero velocity and acceleration at both ends.
    #[serde(rename = "min-jerk")]
    MinJerk,
    /// One curve of least jerk through all waypoints, at rest at the first and the last only.
    #[serde(rename = "spline")]
    Spline,
}

/// `mission.heading_deg`: one value, or `[[t_s, deg], ...]` steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected degrees, or steps [[t_s, deg], ...]")]
pub enum Heading {
    /// Constant \[deg\].
    Constant(f64),
    /// From each time \[s\] on, this heading \[deg\].
    Steps(Vec<(f64, f64)>),
}

/// `[initial]`: added to hover trim, or to standing still.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Initial {
    /// NED \[m\].
    pub position_m: [f64; 3],
    /// Body \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Roll, pitch, yaw \[deg\].
    pub attitude_deg: [f64; 3],
    /// Body rates \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Whether the vehicle stands: level, with the rotors idling, not at hover trim.
    pub standing: bool,
}
