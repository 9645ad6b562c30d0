//! When a flight counts as failed: it diverged, or did not come back to its reference.

use view::summary::Summary;

/// In the end of a flight that is survived the vehicle is no farther from its reference \[m\].
pub const SURVIVED_M: f64 = 1.0;

/// When a flight that is over failed \[s\]: when the vehicle diverged, or at the end when it is not back at its reference.
pub fn failed_at_s(summary: &Summary) -> Option<f64> {
    let is_back = summary.metrics().final_position_error_m <= SURVIVED_M; // false for NaN
    (summary.status().diverged() || !is_back).then(|| summary.time_s())
}
