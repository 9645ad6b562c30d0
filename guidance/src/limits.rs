//! Limits of the reference. After a silence the limits are narrower for a while (re-entry), because the position error
//! has become large and would otherwise use the full range of the settings' limits.
//!
//! ```text
//! |angles| <= 15 deg + 5 deg/s t        about trim, t since the first state after a silence of more than 100 ms,
//! |climb|  <= 1 m/s  + 1 m/s2  t        for 3 s; the settings' own limits hold too
//! ```
//!
//! After a silence the vehicle falls, turns and tilts, and its rotors are near their limits: thrust used to reach a
//! distant reference is not available to level the vehicle.

use nalgebra::{Vector2, Vector3};

/// Longest gap between two states that does not count as a silence \[s\].
const MAX_GAP_S: f64 = 0.1;
/// Duration of the re-entry \[s\].
const REENTRY_S: f64 = 3.0;
/// Largest angle about trim at the beginning of the re-entry \[deg\].
const MAX_ANGLE_DEG: f64 = 15.0;
/// Growth of the largest angle \[deg/s\].
const MAX_ANGLE_DPS: f64 = 5.0;
/// Largest climb at the beginning of the re-entry \[m/s\].
const MAX_CLIMB_MPS: f64 = 1.0;
/// Growth of the largest climb \[m/s2\].
const MAX_CLIMB_MPS2: f64 = 1.0;

/// Limits of a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceLimits {
    /// Largest angles about trim \[rad\].
    pub angle_rad: f64,
    /// Largest climb, up or down \[m/s\].
    pub climb_mps: f64,
}

impl ReferenceLimits {
    /// Reduces the limits `since_s` after the end of a silence; `None` if there was no silence.
    #[must_use]
    pub fn after_silence(self, since_s: Option<f64>) -> Self {
        let Some(t) = since_s.filter(|since_s| *since_s < REENTRY_S) else { return self };
        Self {
            angle_rad: self.angle_rad.min((MAX_ANGLE_DEG + MAX_ANGLE_DPS * t).to_radians()),
            climb_mps: self.climb_mps.min(MAX_CLIMB_MPS + MAX_CLIMB_MPS2 * t),
        }
    }
}

/// Returns whether a gap of `elapsed_s` between two states is a silence.
pub fn is_silence(elapsed_s: f64) -> bool {
    elapsed_s > MAX_GAP_S
}

/// Shortens a horizontal vector that is longer than `bound` to `bound`, and keeps its direction.
pub fn within(horizontal: &Vector2<f64>, bound: f64) -> Vector2<f64> {
    if horizontal.x.abs() + horizontal.y.abs() <= bound {
        return *horizontal; // the length is at most this sum; nearly always this check suffices
    }
    let length = libm::hypot(horizontal.x, horizontal.y);
    if length > bound { horizontal * (bound / length) } else { *horizontal }
}

/// Shortens the horizontal part of an integral to `bound`, and clamps the vertical part to +-`bound`.
pub fn bounded(integral: &Vector3<f64>, bound: f64) -> Vector3<f64> {
    within(&integral.xy(), bound).push(integral.z.clamp(-bound, bound))
}

/// Clamps `value` to +-`bound`, and sets `flag` in `flags` if that changes the value.
pub fn limit(value: f64, bound: f64, flag: u64, flags: &mut u64) -> f64 {
    let inside = value.clamp(-bound, bound);
    if inside != value {
        *flags |= flag;
    }
    inside
}
