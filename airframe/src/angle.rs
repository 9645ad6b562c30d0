//! Wrapping of angles such as headings.

use std::f64::consts::TAU;

/// Wraps `angle_rad` into (-pi, pi]. An angle in that range keeps its bits.
pub fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - TAU * (angle_rad / TAU - 0.5).ceil()
}

/// Signed angle from `from_rad` to `to_rad` the short way, in (-pi, pi].
pub fn difference(to_rad: f64, from_rad: f64) -> f64 {
    wrapped(to_rad - from_rad)
}

/// Shifts `angle_rad` by whole turns to within half a turn of `at_rad`. An angle already in this range keeps its
/// bits.
pub fn nearest(angle_rad: f64, at_rad: f64) -> f64 {
    angle_rad - TAU * ((angle_rad - at_rad) / TAU - 0.5).ceil()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn angles_are_wrapped_to_half_a_turn() {
        assert_eq!([0.3, -3.1, PI, 0.0].map(wrapped).map(f64::to_bits), [0.3, -3.1, PI, 0.0].map(f64::to_bits));
        assert!((wrapped(-PI) - PI).abs() < 1e-15);
        assert!((wrapped(7.0) - (7.0 - TAU)).abs() < 1e-15 && (wrapped(-20.0) - (3.0 * TAU - 20.0)).abs() < 1e-14);
        assert!((difference((-170_f64).to_radians(), 170_f64.to_radians()) - 20_f64.to_radians()).abs() < 1e-14);
        assert!((nearest(-3.0, 3.2) - (TAU - 3.0)).abs() < 1e-15);
        assert_eq!(nearest(0.1, -0.2).to_bits(), 0.1_f64.to_bits());
    }
}
