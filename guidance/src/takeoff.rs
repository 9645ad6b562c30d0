//! Start of a flight that begins on the ground: the vehicle waits, then lifts off level.
//!
//! ```text
//! waits: sink demanded, so the mixer idles --mission above the ground--> lifts off --feet off--> follows
//! ```
//!
//! Until its feet are off, the vehicle cannot follow a reference. The attitude reference is level: at hover trim the
//! vehicle leans, and on its feet it would slide. No integral adapts, so the take-off does not depend on the length of
//! the wait.

use bytemuck::{Pod, Zeroable};

/// Time that rotors at idle need to lift the vehicle \[s\]: the lift-off begins this much before the mission is above
/// the ground.
pub const SPOOL_UP_S: f64 = 0.25;
/// Sink rate that is demanded while the vehicle waits \[m/s\].
const SINK_MPS: f64 = 0.5;
/// Climb rate that is demanded until the feet are off \[m/s\]: enough for the mixer to leave idle at once.
const LIFT_OFF_MPS: f64 = 0.5;
/// Rise after the beginning of the lift-off at which the feet are off \[m\]: more than the feet yield, and more than an
/// estimated height drifts during the lift-off.
const OFF_M: f64 = 0.03;

/// State of the take-off.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct TakeOff {
    /// 1 until the feet are off, in a flight that begins on the ground; else 0.
    stands: u64,
    /// Measured down position when the vehicle waited last \[m\].
    from_down_m: f64,
}

impl TakeOff {
    /// Begins a flight, on the ground if `stands`, at the down position `down_m`.
    pub fn new(stands: bool, down_m: f64) -> Self {
        Self { stands: stands.into(), from_down_m: down_m }
    }

    /// Updates the state by a measured down position, and by whether the mission is above the ground. Returns the
    /// vertical speed to demand, down positive \[m/s\]; `None` once the feet are off, and in a flight that begins in
    /// the air.
    pub fn observe(&mut self, down_m: f64, climbs: bool) -> Option<f64> {
        if !climbs {
            self.from_down_m = down_m;
        } else if down_m < self.from_down_m - OFF_M {
            self.stands = 0;
        }
        (self.stands == 1).then_some(if climbs { -LIFT_OFF_MPS } else { SINK_MPS })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vehicle_waits_lifts_off_and_is_off_for_good() {
        let mut take_off = TakeOff::new(true, 0.0);
        assert_eq!(take_off.observe(0.0, false), Some(SINK_MPS));
        assert_eq!(take_off.observe(-1.0, false), Some(SINK_MPS), "the height drifts while it waits");
        assert_eq!(take_off.observe(-1.02, true), Some(-LIFT_OFF_MPS));
        assert_eq!(take_off.observe(-1.04, true), None);
        assert_eq!(take_off.observe(0.0, false), None, "a landing is another thing");
    }

    #[test]
    fn a_flight_that_begins_in_the_air_follows_at_once() {
        assert_eq!(TakeOff::new(false, 0.0).observe(0.0, false), None);
    }
}
