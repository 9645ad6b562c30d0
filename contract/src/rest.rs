//! Definition of a landed vehicle: at rest for one second while its rotors idle.
//!
//! The plant applies it to the true motion, the mixer to the measured one before it disarms. The limits on vertical
//! speed and rates are those of PX4's land detector (`LNDMC_Z_VEL_MAX` 0.25 m/s, `LNDMC_ROT_MAX` 20 deg/s), the first
//! here applied to the speed in any direction. The limit on tilt excludes hover trim, which leans 11 degrees.

use bytemuck::{Pod, Zeroable};

use crate::message::Kinematics;

/// Largest speed at rest \[m/s\].
pub const MAX_SPEED_MPS: f64 = 0.25;
/// Largest body rate about any axis at rest \[rad/s\]: 20 deg/s.
const MAX_RATE_RADPS: f64 = 0.35;
/// Largest angle between the body z axis and the vertical at rest \[rad\]: 5 degrees.
const MAX_TILT_RAD: f64 = 0.087;
/// Time at rest after which a vehicle has landed \[ns\].
pub const LANDED_AFTER_NS: u64 = 1_000_000_000;

/// Returns whether speed, body rates and tilt of `motion` are all within the limits of rest; `false` for NaN.
pub fn is_at_rest(motion: &Kinematics) -> bool {
    let [u, v, w] = motion.velocity_mps;
    libm::hypot(libm::hypot(u, v), w) <= MAX_SPEED_MPS
        && motion.rates_radps.iter().all(|rate| rate.abs() <= MAX_RATE_RADPS)
        && motion.tilt_rad() <= MAX_TILT_RAD
}

/// Time for which a vehicle has been at rest without thrust.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(transparent)]
pub struct Rest {
    for_ns: u64,
}

impl Rest {
    /// Rest of a vehicle that has stood long enough to count as landed.
    pub const LONG: Self = Self { for_ns: LANDED_AFTER_NS };

    /// Adds `elapsed_ns` if the vehicle was at rest without thrust during that time; starts again from zero otherwise.
    pub fn observe(&mut self, is_at_rest: bool, elapsed_ns: u64) {
        // The count stops at the limit, so that it stays below 2^62, as a snapshot requires.
        self.for_ns = if is_at_rest { self.for_ns.saturating_add(elapsed_ns).min(LANDED_AFTER_NS) } else { 0 };
    }

    /// Time at rest so far, at most [`LANDED_AFTER_NS`], to save and restore it \[ns\].
    pub fn elapsed_ns_mut(&mut self) -> &mut u64 {
        &mut self.for_ns
    }

    /// Returns whether the rest has lasted [`LANDED_AFTER_NS`].
    pub fn has_landed(self) -> bool {
        self.for_ns == LANDED_AFTER_NS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_rates_and_tilt_each_end_the_rest() {
        assert!(is_at_rest(&Kinematics::default()));
        let moving = |change: fn(&mut Kinematics)| {
            let mut motion = Kinematics::default();
            change(&mut motion);
            !is_at_rest(&motion)
        };
        assert!(moving(|motion| motion.velocity_mps = [0.2, 0.2, 0.0]), "slides");
        assert!(moving(|motion| motion.rates_radps[2] = -0.4), "turns");
        assert!(moving(|motion| motion.attitude_rad[0] = 20.0_f64.to_radians()), "leans");
        assert!(moving(|motion| motion.velocity_mps[1] = f64::NAN), "is not known");
        assert!(!moving(|motion| motion.attitude_rad[2] = 3.0), "any heading will do");
    }

    #[test]
    fn a_second_without_interruption_is_a_landing() {
        let mut rest = Rest::default();
        for _ in 0..99 {
            rest.observe(true, LANDED_AFTER_NS / 100);
        }
        assert!(!rest.has_landed());
        rest.observe(false, 1);
        rest.observe(true, LANDED_AFTER_NS - 1);
        assert!(!rest.has_landed());
        rest.observe(true, 1);
        assert!(rest.has_landed() && rest == Rest::LONG);
        rest.observe(true, u64::MAX);
        assert_eq!(rest, Rest::LONG);
    }
}
