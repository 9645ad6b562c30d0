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
    /// How each leg's velocity rises and falls.
    pub ramp_s: Ramp,
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
    /// Climb 10 m, one lap of 5 m radius, descend.
    Circle,
    /// The scenario's own waypoints.
    Waypoints,
}

/// `mission.ramp_s`: seconds of velocity ramp (0 = constant velocity), or `"min-jerk"`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected seconds, or \"min-jerk\"")]
pub enum Ramp {
    /// Trapezoid of velocity with ramps this long \[s\].
    Seconds(f64),
    /// A named shape.
    Named(RampName),
}

/// The named velocity shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RampName {
    /// Quintic: zero velocity and acceleration at both ends.
    #[serde(rename = "min-jerk")]
    MinJerk,
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
