//! Land detector: decides when the rotors idle on the ground, and when they stop for good.
//!
//! Three stages, like the stages of PX4's detector (ground contact, maybe landed, landed), follow from measurements and
//! demands; the detector does not know the height of the ground. `a` is the demanded acceleration downwards, without
//! the share that cancels the disturbance.
//!
//! | stage | begins | command |
//! |---|---|---|
//! | free | at the start in the air, and when a contact ends | the demand |
//! | contact | at the start on the ground, and if `a` > 1 m/s2 for 0.5 s does not make the vehicle sink | rotors at idle |
//! | landed | if the vehicle is then [at rest](contract::rest) for 1 s | no thrust, for good: disarmed |
//!
//! A wrong contact shows at once: a vehicle that the ground does not carry falls as soon as its rotors idle. The
//! contact ends if the measured velocity shows a sink faster than 0.5 m/s, if the measured position has sunk by 0.3 m,
//! or if a climb is demanded. Two sensors must agree on a landing, so that one stuck sensor disarms no vehicle in
//! flight. In a flight that begins on the ground only the demand to climb ends the first contact, and nothing is
//! detected before the first climb faster than 0.3 m/s.
//!
//! The detector is used only if the scenario has a ground (`plant.ground.present`).

use bytemuck::{Pod, Zeroable};
use contract::message::Kinematics;
use contract::rest::{Rest, is_at_rest};
use settings::Scenario;

/// Demanded acceleration downwards above which the vehicle should sink \[m/s2\]; upwards, above which it should climb.
/// A vehicle a tenth lighter than its model hovers at this demand downwards.
const INTENT_MPS2: f64 = 1.0;
/// Vertical speed below which the vehicle does not sink \[m/s\].
const HELD_UP_MPS: f64 = 0.2;
/// Change of height below which the vehicle does not sink \[m\].
const LEVEL_M: f64 = 0.15;
/// Time without sinking that makes a contact \[ns\]; in free air the vehicle sinks faster than `HELD_UP_MPS` after 0.4
/// s at most.
const CONTACT_NS: u64 = 500_000_000;
/// Sink rate above which a contact ends \[m/s\].
const FALLING_MPS: f64 = 0.5;
/// Drop in height above which a contact ends \[m\].
const FALLEN_M: f64 = 0.3;
/// Climb rate above which the vehicle has taken off \[m/s\].
const CLIMBING_MPS: f64 = 0.3;

/// State of the detector.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LandDetector {
    /// 1 once the vehicle has flown, else 0.
    has_flown: u64,
    /// Time for which the vehicle has not sunk although it should \[ns\], at most [`CONTACT_NS`].
    held_up_ns: u64,
    /// Down position at the beginning of `held_up_ns` \[m\].
    from_down_m: f64,
    /// Time at rest during the contact.
    rest: Rest,
}

/// Stage of a landing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LandingStage {
    /// No contact detected.
    Free,
    /// The ground carries the vehicle.
    Contact,
    /// The vehicle stands on the ground.
    Landed,
}

impl LandDetector {
    /// Starts the detector before the first sample of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let stands = scenario.initial.standing;
        Self { has_flown: u64::from(!stands), held_up_ns: if stands { CONTACT_NS } else { 0 }, ..Self::zeroed() }
    }

    /// Present stage.
    pub fn stage(&self) -> LandingStage {
        if self.rest.has_landed() {
            LandingStage::Landed
        } else if self.held_up_ns == CONTACT_NS {
            LandingStage::Contact
        } else {
            LandingStage::Free
        }
    }

    /// Updates the stage by a sample `elapsed_ns` after the last one, with the demanded acceleration downwards
    /// \[m/s2\].
    pub fn observe(&mut self, measured: &Kinematics, wanted_mps2: f64, elapsed_ns: u64) {
        let sink_mps = measured.sink_mps();
        if self.held_up_ns == 0 {
            self.from_down_m = measured.position_m[2];
        }
        let sunk_m = measured.position_m[2] - self.from_down_m;
        self.has_flown |= u64::from(sink_mps < -CLIMBING_MPS);
        match self.stage() {
            LandingStage::Free => {
                let is_level = sink_mps.abs() < HELD_UP_MPS && sunk_m.abs() < LEVEL_M;
                let is_held_up = self.has_flown != 0 && wanted_mps2 > INTENT_MPS2 && is_level;
                self.held_up_ns =
                    if is_held_up { self.held_up_ns.saturating_add(elapsed_ns).min(CONTACT_NS) } else { 0 };
            }
            LandingStage::Contact if wanted_mps2 < -INTENT_MPS2 => (self.held_up_ns, self.rest) = (0, Rest::default()),
            LandingStage::Contact if self.has_flown == 0 => {} // the vehicle waits for its first climb
            LandingStage::Contact if sink_mps > FALLING_MPS || sunk_m > FALLEN_M => {
                (self.held_up_ns, self.rest) = (0, Rest::default());
            }
            LandingStage::Contact => self.rest.observe(is_at_rest(measured), elapsed_ns),
            LandingStage::Landed => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_NS: u64 = 10_000_000;

    fn in_flight() -> LandDetector {
        LandDetector::new(&Scenario::default())
    }

    /// Stage after `ticks` of a level vehicle that sinks at `sink_mps` under the demand `wanted_mps2`.
    fn go(landing: &mut LandDetector, ticks: u32, sink_mps: f64, wanted_mps2: f64) -> LandingStage {
        let measured = Kinematics { velocity_mps: [0.0, 0.0, sink_mps], ..Kinematics::default() };
        (0..ticks).for_each(|_| landing.observe(&measured, wanted_mps2, TICK_NS));
        landing.stage()
    }

    #[test]
    fn a_vehicle_that_does_not_sink_when_asked_to_has_landed() {
        let mut landing = in_flight();
        assert_eq!(go(&mut landing, 49, 0.0, 1.4), LandingStage::Free);
        assert_eq!(go(&mut landing, 1, 0.0, 1.4), LandingStage::Contact);
        assert_eq!(go(&mut landing, 99, 0.0, 1.4), LandingStage::Contact);
        assert_eq!(go(&mut landing, 1, 0.0, 1.4), LandingStage::Landed);
        assert_eq!(go(&mut landing, 100, -3.0, -9.0), LandingStage::Landed, "for good");
    }

    #[test]
    fn a_hover_a_descent_and_a_slow_start_of_one_are_no_contact() {
        for (ticks, sink_mps, wanted_mps2) in [(1000, 0.0, 0.1), (1000, 0.7, 1.4), (40, 0.1, 1.4), (1000, 0.0, -2.0)] {
            assert_eq!(go(&mut in_flight(), ticks, sink_mps, wanted_mps2), LandingStage::Free);
        }
    }

    #[test]
    fn a_contact_ends_when_the_vehicle_sinks_or_is_to_climb() {
        for (sink_mps, wanted_mps2) in [(0.6, 1.4), (0.0, -2.0)] {
            let mut landing = in_flight();
            assert_eq!(go(&mut landing, 60, 0.0, 1.4), LandingStage::Contact);
            assert_eq!(go(&mut landing, 1, sink_mps, wanted_mps2), LandingStage::Free);
            assert_eq!(go(&mut landing, 49, 0.0, 1.4), LandingStage::Free, "from the beginning");
        }
    }

    #[test]
    fn a_velocity_that_is_stuck_disarms_no_vehicle_that_sinks() {
        let mut landing = in_flight();
        for tick in 0..1000 {
            let position_m = [0.0, 0.0, 0.007 * f64::from(tick)];
            landing.observe(&Kinematics { position_m, ..Kinematics::default() }, 1.4, TICK_NS);
            assert_eq!(landing.stage(), LandingStage::Free, "tick {tick}");
        }
    }

    #[test]
    fn a_vehicle_that_slides_or_leans_does_not_disarm() {
        for (velocity_mps, roll_rad) in [([5.0, 0.0, 0.0], 0.0), ([0.0; 3], 0.35)] {
            let mut landing = in_flight();
            let measured = Kinematics { velocity_mps, attitude_rad: [roll_rad, 0.0, 0.0], ..Kinematics::default() };
            (0..500).for_each(|_| landing.observe(&measured, 1.4, TICK_NS));
            assert_eq!(landing.stage(), LandingStage::Contact);
        }
    }

    #[test]
    fn a_vehicle_that_stands_idles_until_it_is_to_climb_and_does_not_disarm() {
        let mut scenario = Scenario::default();
        scenario.initial.standing = true;
        let mut landing = LandDetector::new(&scenario);
        assert_eq!(go(&mut landing, 60_000, 0.0, 5.0), LandingStage::Contact);
        assert_eq!(go(&mut landing, 1000, 0.6, 0.0), LandingStage::Contact, "its sensors drift");
        assert_eq!(go(&mut landing, 1, 0.0, -1.1), LandingStage::Free);
        assert_eq!(go(&mut landing, 1000, 0.0, 5.0), LandingStage::Free, "it has not flown yet");
        go(&mut landing, 10, -0.5, -1.0);
        assert_eq!(go(&mut landing, 50, 0.0, 5.0), LandingStage::Contact);
    }
}
