//! The definition of a vehicle that has landed: at rest for a second while its rotors idle.
//!
//! The plant judges by it what is true, and the mixer what is measured before it disarms. The limits are those of PX4's land
//! detector for vertical speed and rates (`LNDMC_Z_VEL_MAX` 0.25 m/s, `LNDMC_ROT_MAX` 20 deg/s), the first taken for the speed
//! in any direction; hover trim leans 11 degrees, which is no attitude to stand in.

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

/// Returns true if `motion` is that of a vehicle at rest; false with a NaN.
pub fn is_at_rest(motion: &Kinematics) -> bool {
    let [u, v, w] = motion.velocity_mps;
    libm::hypot(libm::hypot(u, v), w) <= MAX_SPEED_MPS
        && motion.rates_radps.iter().all(|rate| rate.abs() <= MAX_RATE_RADPS)
        && motion.tilt_rad() <= MAX_TILT_RAD
}

/// For how long a vehicle has been at rest without thrust.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(transparent)]
pub struct Rest {
    for_ns: u64,
}

impl Rest {
    /// The rest of a vehicle that has stood for long.
    pub const LONG: Self = Self { for_ns: LANDED_AFTER_NS };

    /// Takes in `elapsed_ns` during which the vehicle was at rest without thrust, or was not.
    pub fn observe(&mut self, is_at_rest: bool, elapsed_ns: u64) {
        // It counts no further than it matters, so that a snapshot of it stays small.
        self.for_ns = if is_at_rest { self.for_ns.saturating_add(elapsed_ns).min(LANDED_AFTER_NS) } else { 0 };
    }

    /// Time at rest so far, for a memory of it \[ns\].
    pub fn elapsed_ns_mut(&mut self) -> &mut u64 {
        &mut self.for_ns
    }

    /// Returns true if it has lasted long enough.
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
