//! The way back after a silence: the reference is limited for a while, because the vehicle has drifted off and a step
//! of that size is not to be answered with all that the limits allow.
//!
//! ```text
//! |angles| <= 15 deg + 5 deg/s t        about trim, t since the first state after a silence of more than 100 ms,
//! |climb|  <= 1 m/s  + 1 m/s2  t        for 3 s; the settings' own limits hold all the while
//! ```
//!
//! After a silence the vehicle falls, turns and tilts, and its rotors are near their limits: what they spend on a distant
//! reference is missing for levelling it.

/// Longest gap between two states that is no silence \[s\].
const MAX_GAP_S: f64 = 0.1;
/// How long the way back takes \[s\].
const REENTRY_S: f64 = 3.0;
/// Largest angle about trim at its beginning \[deg\].
const MAX_ANGLE_DEG: f64 = 15.0;
/// How fast that grows \[deg/s\].
const MAX_ANGLE_DPS: f64 = 5.0;
/// Largest climb at its beginning \[m/s\].
const MAX_CLIMB_MPS: f64 = 1.0;
/// How fast that grows \[m/s2\].
const MAX_CLIMB_MPS2: f64 = 1.0;

/// What a reference may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Angles about trim \[rad\].
    pub angle_rad: f64,
    /// Climb, up or down \[m/s\].
    pub climb_mps: f64,
}

impl Limits {
    /// These limits `since_s` after the end of a silence, if there was one.
    #[must_use]
    pub fn after_silence(self, since_s: Option<f64>) -> Self {
        let Some(t) = since_s.filter(|since_s| *since_s < REENTRY_S) else { return self };
        Self {
            angle_rad: self.angle_rad.min((MAX_ANGLE_DEG + MAX_ANGLE_DPS * t).to_radians()),
            climb_mps: self.climb_mps.min(MAX_CLIMB_MPS + MAX_CLIMB_MPS2 * t),
        }
    }
}

/// Whether a gap of `elapsed_s` between two states is a silence.
pub fn is_silence(elapsed_s: f64) -> bool {
    elapsed_s > MAX_GAP_S
}
