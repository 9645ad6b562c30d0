//! The land detector: when the rotors idle on the ground, and when they stop for good.
//!
//! Three stages, like those of PX4's (ground contact, maybe landed, landed), from what is measured and what was asked for:
//! it is not told where the ground is. `a` is the acceleration downwards that is asked for, before any disturbance.
//!
//! | stage | begins | is flown |
//! |---|---|---|
//! | free | with a climb faster than 0.3 m/s, or as a flight that begins in the air | the demand |
//! | contact | when `a` > 1 m/s2 for 0.5 s does not make the vehicle sink: something carries it | rotors at idle |
//! | landed | when the vehicle is then [at rest](contract::rest) for 1 s | no thrust, for good: disarmed |
//!
//! Contact is a guess that tests itself: a vehicle that the ground does not carry falls as soon as its rotors idle. Where it
//! sinks faster than 0.5 m/s, by its velocity, or has sunk by 0.3 m, by its position, or is asked to climb, the contact is over:
//! two sensors must agree, so that one that is stuck disarms no vehicle in flight. Before the first climb nothing is detected:
//! a vehicle may stand as long as it likes.
//!
//! The detector works over a ground only (`plant.ground.present`): elsewhere nothing can be landed on.

use bytemuck::{Pod, Zeroable};
use contract::Scenario;
use contract::message::Kinematics;
use contract::rest::{Rest, is_at_rest};

/// From this acceleration downwards on the vehicle should sink \[m/s2\]; from it upwards on a climb is asked for. A vehicle a
/// tenth lighter than its model hovers on that of a descent.
const INTENT_MPS2: f64 = 1.0;
/// A vehicle that sinks slower does not sink \[m/s\].
const HELD_UP_MPS: f64 = 0.2;
/// Drop in height meanwhile that is still level \[m\].
const LEVEL_M: f64 = 0.15;
/// Time without sinking after which that is the ground \[ns\]; in free air it sinks faster after 0.4 s at most.
const CONTACT_NS: u64 = 500_000_000;
/// A vehicle on the ground does not sink as fast \[m/s\].
const FALLING_MPS: f64 = 0.5;
/// Nor as far \[m\].
const FALLEN_M: f64 = 0.3;
/// A vehicle that climbs as fast has taken off \[m/s\].
const CLIMBING_MPS: f64 = 0.3;

/// What the detector remembers.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Landing {
    /// 1 once the vehicle has flown.
    has_flown: u64,
    /// For how long it has not sunk though it should \[ns\], up to the time that makes a contact.
    held_up_ns: u64,
    /// Where it was when that began, down \[m\].
    from_down_m: f64,
    /// Its rest in contact.
    rest: Rest,
}

/// What is known of the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Nothing.
    Free,
    /// Something carries the vehicle.
    Contact,
    /// It stands.
    Landed,
}

impl Landing {
    /// Before the first sample of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        Self { has_flown: u64::from(!scenario.initial.standing), ..Self::zeroed() }
    }

    /// The present stage.
    pub fn stage(&self) -> Stage {
        if self.rest.has_landed() {
            Stage::Landed
        } else if self.held_up_ns == CONTACT_NS {
            Stage::Contact
        } else {
            Stage::Free
        }
    }

    /// Takes in a sample `elapsed_ns` after the one before, with the acceleration downwards that was asked for since.
    pub fn observe(&mut self, measured: &Kinematics, wanted_mps2: f64, elapsed_ns: u64) {
        let sink_mps = measured.sink_mps();
        if self.held_up_ns == 0 {
            self.from_down_m = measured.position_m[2];
        }
        let sunk_m = measured.position_m[2] - self.from_down_m;
        self.has_flown |= u64::from(sink_mps < -CLIMBING_MPS);
        match self.stage() {
            Stage::Free => {
                let is_level = sink_mps.abs() < HELD_UP_MPS && sunk_m.abs() < LEVEL_M;
                let is_held_up = self.has_flown != 0 && wanted_mps2 > INTENT_MPS2 && is_level;
                self.held_up_ns =
                    if is_held_up { self.held_up_ns.saturating_add(elapsed_ns).min(CONTACT_NS) } else { 0 };
            }
            Stage::Contact if sink_mps > FALLING_MPS || sunk_m > FALLEN_M || wanted_mps2 < -INTENT_MPS2 => {
                (self.held_up_ns, self.rest) = (0, Rest::default());
            }
            Stage::Contact => self.rest.observe(is_at_rest(measured), elapsed_ns),
            Stage::Landed => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_NS: u64 = 10_000_000;

    fn in_flight() -> Landing {
        Landing::new(&Scenario::default())
    }

    /// So many ticks of a level vehicle that sinks like this while it is asked to accelerate like that.
    fn go(landing: &mut Landing, ticks: u32, sink_mps: f64, wanted_mps2: f64) -> Stage {
        let measured = Kinematics { velocity_mps: [0.0, 0.0, sink_mps], ..Kinematics::default() };
        (0..ticks).for_each(|_| landing.observe(&measured, wanted_mps2, TICK_NS));
        landing.stage()
    }

    #[test]
    fn a_vehicle_that_does_not_sink_when_asked_to_has_landed() {
        let mut landing = in_flight();
        assert_eq!(go(&mut landing, 49, 0.0, 1.4), Stage::Free);
        assert_eq!(go(&mut landing, 1, 0.0, 1.4), Stage::Contact);
        assert_eq!(go(&mut landing, 99, 0.0, 1.4), Stage::Contact);
        assert_eq!(go(&mut landing, 1, 0.0, 1.4), Stage::Landed);
        assert_eq!(go(&mut landing, 100, -3.0, -9.0), Stage::Landed, "for good");
    }

    #[test]
    fn a_hover_a_descent_and_a_slow_start_of_one_are_no_contact() {
        for (ticks, sink_mps, wanted_mps2) in [(1000, 0.0, 0.1), (1000, 0.7, 1.4), (40, 0.1, 1.4), (1000, 0.0, -2.0)] {
            assert_eq!(go(&mut in_flight(), ticks, sink_mps, wanted_mps2), Stage::Free);
        }
    }

    #[test]
    fn a_vehicle_that_nothing_carries_flies_on() {
        for (sink_mps, wanted_mps2) in [(0.6, 1.4), (0.0, -2.0)] {
            let mut landing = in_flight();
            assert_eq!(go(&mut landing, 60, 0.0, 1.4), Stage::Contact);
            assert_eq!(go(&mut landing, 1, sink_mps, wanted_mps2), Stage::Free);
            assert_eq!(go(&mut landing, 49, 0.0, 1.4), Stage::Free, "from the beginning");
        }
    }

    #[test]
    fn a_velocity_that_is_stuck_disarms_no_vehicle_that_sinks() {
        let mut landing = in_flight();
        for tick in 0..1000 {
            let position_m = [0.0, 0.0, 0.007 * f64::from(tick)];
            landing.observe(&Kinematics { position_m, ..Kinematics::default() }, 1.4, TICK_NS);
            assert_eq!(landing.stage(), Stage::Free, "tick {tick}");
        }
    }

    #[test]
    fn a_vehicle_that_slides_or_leans_does_not_disarm() {
        for (velocity_mps, roll_rad) in [([5.0, 0.0, 0.0], 0.0), ([0.0; 3], 0.35)] {
            let mut landing = in_flight();
            let measured = Kinematics { velocity_mps, attitude_rad: [roll_rad, 0.0, 0.0], ..Kinematics::default() };
            (0..500).for_each(|_| landing.observe(&measured, 1.4, TICK_NS));
            assert_eq!(landing.stage(), Stage::Contact);
        }
    }

    #[test]
    fn a_vehicle_that_stands_before_its_first_climb_does_not_disarm() {
        let mut scenario = Scenario::default();
        scenario.initial.standing = true;
        let mut landing = Landing::new(&scenario);
        assert_eq!(go(&mut landing, 1000, 0.0, 5.0), Stage::Free);
        go(&mut landing, 10, -0.5, -1.0);
        assert_eq!(go(&mut landing, 50, 0.0, 5.0), Stage::Contact);
    }
}
