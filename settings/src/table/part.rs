//! `[[mission.part]]` and `[mission.limits]`: a mission of parts, flown one after the other.
//!
//! Each part begins where the part before ends. The check refuses a key that the kind of a part does not use
//! ([`MissionPart::keys`]).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::words::given_keys;

/// One `[[mission.part]]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MissionPart {
    /// Kind of the part, which decides the keys that it has.
    pub kind: PartKind,
    /// `takeoff`: height gained \[m\], 0.1 to 500.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// `waypoints`: positions to pass, NED \[m\], at most 50, or 1000 along a curve that needs `times_s`; the curve
    /// begins where the part before ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points_m: Option<Vec<[f64; 3]>>,
    /// `waypoints`: time since the beginning of the part at which each point is passed \[s\], rising; absent, for
    /// `min-snap` and `quintic` only = as early as the limits allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times_s: Option<Vec<f64>>,
    /// `waypoints`: kind of the curve; absent = min-snap.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<CurveKind>,
    /// `waypoints` along a `trapezoid`: ramp of the velocity at both ends of each leg \[s\], from 0.01 to half a leg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ramp_s: Option<f64>,
    /// `jump`: position to which the reference steps, NED \[m\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point_m: Option<[f64; 3]>,
    /// `circle`, `helix`: radius; `figure-eight`: length of each loop \[m\], 0.1 to 250.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// `circle`, `helix`, `figure-eight`: mean duration of a lap \[s\], 0.1 to 86400; absent = as short as the limits
    /// allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// `circle`, `helix`, `figure-eight`: number of laps, 1 to 10000; absent = 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laps: Option<u32>,
    /// `helix`: height gained by all laps together \[m\], negative = down, at most 500 either way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub climb_m: Option<f64>,
    /// `circle`, `helix`: direction of the centre; `figure-eight`: direction of the first loop \[deg\], from north over
    /// east, -360 to 360; absent = 90.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction_deg: Option<f64>,
    /// `loiter`, `jump`, `takeoff`: duration \[s\], 0.1 to 86400; a take-off without a duration is as fast as the
    /// limits allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// `landing`: sink rate \[m/s\], 0.1 to 10; absent = 0.7.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sink_mps: Option<f64>,
    /// Heading \[deg\], from north over east, -360 to 360: one value, one per point of `waypoints`, steps
    /// `[[t_s, deg], ...]` since the beginning of the part, `"along-track"`, or `"centre"` of a figure; absent = the
    /// heading stays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_deg: Option<PartHeading>,
}

/// Kind of a part, `mission.part.kind`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PartKind {
    /// Straight up, as the first part.
    Takeoff,
    /// Through points, along a curve.
    Waypoints,
    /// One step of the position reference, and rest there.
    Jump,
    /// Laps of a circle.
    Circle,
    /// Laps of a lemniscate that begin at its crossing.
    FigureEight,
    /// Laps of a circle that climb.
    Helix,
    /// Rest.
    #[default]
    Loiter,
    /// Straight down to the ground, as the last part.
    Landing,
}

/// Kind of a curve through points, `mission.part.curve`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CurveKind {
    /// Curve of the seventh degree between points, of least snap.
    #[default]
    MinSnap,
    /// Curve of the fifth degree between points, of least jerk.
    Quintic,
    /// Straight legs at constant velocity, which steps at each point.
    Line,
    /// Straight legs, each with a trapezoid of velocity from rest to rest.
    Trapezoid,
    /// Straight legs, each of least jerk from rest to rest.
    MinJerk,
    /// The curve of `quintic` at any times, also beyond the limits of the vehicle.
    Spline,
}

/// Heading of a part, `mission.part.heading_deg`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected degrees, a list of degrees, steps [[t_s, deg], ...], \"along-track\" or \"centre\""
)]
pub enum PartHeading {
    /// One heading \[deg\].
    Constant(f64),
    /// Heading at each point \[deg\].
    Points(Vec<f64>),
    /// Times since the beginning of the part \[s\], each with the heading from then on \[deg\].
    Steps(Vec<(f64, f64)>),
    /// A named rule.
    Named(HeadingRule),
}

/// Named rules of the heading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingRule {
    /// Direction of flight; below 0.5 m/s of horizontal speed, the next direction above this speed, or else the last.
    AlongTrack,
    /// Direction to the centre of the circle, helix or figure eight.
    Centre,
}

/// Limits of the curves of a mission, `[mission.limits]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MissionLimits {
    /// Share of the vehicle's tilt, thrust, vertical speed and body rate beyond hover that curves without given times
    /// use; the rest is for control. Given times may use all.
    pub share: f64,
    /// Largest speed \[m/s\]; absent = the vehicle's, which drag limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_mps: Option<f64>,
    /// Largest acceleration \[m/s2\]; absent = the vehicle's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration_mps2: Option<f64>,
}

impl Default for MissionLimits {
    fn default() -> Self {
        Self { share: 0.7, speed_mps: None, acceleration_mps2: None }
    }
}

impl MissionPart {
    /// Makes a part without keys.
    pub fn new(kind: PartKind) -> Self {
        Self { kind, ..Self::default() }
    }

    /// Returns whether the part may ask for more than the vehicle has, which is then a warning and no error.
    pub fn may_exceed(&self) -> bool {
        use CurveKind as C;
        matches!(self.curve, Some(C::Line | C::Trapezoid | C::MinJerk | C::Spline)) || self.kind == PartKind::Jump
    }

    /// Keys that a part of this kind must have, and keys that it may have besides `heading_deg`.
    pub fn keys(&self) -> [&'static [&'static str]; 2] {
        match (self.kind, self.curve) {
            (PartKind::Takeoff, _) => [&["height_m"], &["duration_s"]],
            (PartKind::Waypoints, None | Some(CurveKind::MinSnap | CurveKind::Quintic)) => {
                [&["points_m"], &["times_s", "curve"]]
            }
            (PartKind::Waypoints, Some(CurveKind::Trapezoid)) => [&["points_m", "times_s", "ramp_s", "curve"], &[]],
            (PartKind::Waypoints, Some(_)) => [&["points_m", "times_s", "curve"], &[]],
            (PartKind::Jump, _) => [&["point_m", "duration_s"], &[]],
            (PartKind::Circle | PartKind::FigureEight, _) => [&["radius_m"], &["period_s", "laps", "direction_deg"]],
            (PartKind::Helix, _) => [&["radius_m", "climb_m"], &["period_s", "laps", "direction_deg"]],
            (PartKind::Loiter, _) => [&["duration_s"], &[]],
            (PartKind::Landing, _) => [&[], &["sink_mps"]],
        }
    }

    /// Keys that were given, except `heading_deg`.
    pub fn given(&self) -> Vec<String> {
        given_keys(self, &["kind", "heading_deg"])
    }
}
