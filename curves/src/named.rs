//! Missions with a name: survey and hover, each of one part that begins at the origin.

use crate::plan::PartMotion;

/// Waypoints of the surveillance square after the origin, NED \[m\]: up 8 m, around, down (inferred in docs/paper.md).
const SURVEY_M: [[f64; 3]; 6] =
    [[0.0, 0.0, -8.0], [8.0, 0.0, -8.0], [8.0, 8.0, -8.0], [0.0, 8.0, -8.0], [0.0, 0.0, -8.0], [0.0, 0.0, 0.0]];
/// Duration of each leg of the survey \[s\].
pub const SURVEY_LEG_S: f64 = 10.0;

/// Returns the survey with ramps of `ramp_s`, at most half a leg \[s\]; `None` = min-jerk.
pub fn survey(ramp_s: Option<f64>) -> PartMotion {
    let times_s = (1..).map(|i| f64::from(i) * SURVEY_LEG_S).take(SURVEY_M.len()).collect();
    PartMotion::Legs { points_m: SURVEY_M.to_vec(), times_s, ramp_s }
}

/// Returns the hover.
pub fn hover() -> PartMotion {
    PartMotion::Rest { at_m: None, duration_s: 0.0 }
}
