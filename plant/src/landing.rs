//! True take-off and landing, from which the outcome of the flight is determined.
//!
//! ```text
//! standing --rotors above idle--> taking off --no foot down--> flying <--------> landing --at rest, 1 s--> landed
//!                                      ^                         a foot down                                 |
//!                                      +--------------------------rotors above idle--------------------------+
//! ```
//!
//! Every phase changes to flying when no foot is down, and a take-off that stays on the ground changes back to
//! standing.
//!
//! A vehicle has landed if it [is at rest](contract::rest) for a second with all feet on the ground and its rotors no
//! faster than idle, and its feet have slid no farther than `MAX_SLIDE_M` since they came down. The vehicle stays
//! landed until its rotors drive it again, something lifts it, or its feet slide that far once more. So the outcome
//! does not depend on how long the flight is recorded. The vehicle itself relies on the mixer's land detector.

use contract::message::{Kinematics, PlantStatus};
use contract::rest::{Rest, is_at_rest};
use settings::Scenario;

use crate::memory::Tape;

/// Multiple of the idle speed up to which a rotor counts as idling: a rotor with a lag only approaches the idle speed.
const IDLES: f64 = 1.1;

/// Longest slide of a landing \[m\]; after a longer slide the vehicle does not count as landed.
const MAX_SLIDE_M: f64 = 1.0;

/// Phase of a flight, from standing to landed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Standing,
    TakingOff,
    Flying,
    Landing,
    Landed,
}

impl Phase {
    const ALL: [Self; 5] = [Self::Standing, Self::TakingOff, Self::Flying, Self::Landing, Self::Landed];
}

/// Number of feet on the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Footing {
    /// No foot is on the ground.
    None,
    /// One or two feet are on the ground.
    Some,
    /// All feet are on the ground.
    All,
}

/// Take-off and landing in a flight with a ground.
#[derive(Debug, Clone)]
pub struct Landing {
    phase: Phase,
    rest: Rest,
    /// `true` if the vehicle was at rest at the newest step, with or without thrust.
    is_still: bool,
    /// Distance that the feet have slid in this landing, or since the vehicle landed \[m\].
    slid_m: f64,
    idle_speed: f64,
}

impl Landing {
    /// Builds the landing of `scenario`; `None` without a ground.
    pub fn new(scenario: &Scenario) -> Option<Self> {
        let standing = scenario.initial.standing;
        scenario.plant.ground.present.then(|| Self {
            phase: if standing { Phase::Standing } else { Phase::Flying },
            rest: if standing { Rest::LONG } else { Rest::default() },
            is_still: standing,
            slid_m: 0.0,
            idle_speed: IDLES * scenario.idle_speed(),
        })
    }

    /// Writes or reads phase, rest and slide.
    pub fn remember(&mut self, tape: &mut Tape) {
        let mut phase = self.phase as usize;
        tape.count(&mut phase, Phase::ALL.len() - 1);
        self.phase = Phase::ALL[phase];
        tape.value(self.rest.elapsed_ns_mut());
        tape.flag(&mut self.is_still);
        tape.value(&mut self.slid_m);
    }

    /// Updates the phase by a step of `dt_ns`, in which the feet have slid by `slid_m` and which ends with this motion,
    /// footing and rotor speeds.
    pub fn observe(&mut self, motion: &Kinematics, footing: Footing, slid_m: f64, rotor_speed: [f64; 3], dt_ns: u64) {
        let idles = rotor_speed.iter().all(|speed| *speed <= self.idle_speed);
        self.is_still = footing == Footing::All && is_at_rest(motion);
        self.rest.observe(self.is_still && idles, dt_ns);
        if matches!(self.phase, Phase::Landing | Phase::Landed) {
            self.slid_m += slid_m;
        }
        self.phase = match self.phase {
            _ if footing == Footing::None => Phase::Flying,
            Phase::Flying | Phase::Landing if self.rest.has_landed() => {
                if !self.has_slid() {
                    self.slid_m = 0.0;
                }
                Phase::Landed
            }
            Phase::Flying | Phase::Landing => Phase::Landing,
            Phase::Standing | Phase::Landed if !idles => {
                self.slid_m = 0.0;
                Phase::TakingOff
            }
            Phase::TakingOff if self.rest.has_landed() => Phase::Standing,
            same => same,
        };
    }

    fn has_slid(&self) -> bool {
        self.slid_m > MAX_SLIDE_M
    }

    /// Status before the end of the run.
    pub fn in_flight(&self) -> PlantStatus {
        match self.phase {
            Phase::Standing | Phase::Landed => PlantStatus::Standing,
            Phase::TakingOff => PlantStatus::TakingOff,
            Phase::Flying => PlantStatus::Flying,
            Phase::Landing => PlantStatus::Landing,
        }
    }

    /// Status if the flight ends now.
    pub fn at_the_end(&self) -> PlantStatus {
        match self.phase {
            Phase::Flying => PlantStatus::Finished,
            Phase::Landed if !self.has_slid() => PlantStatus::Landed,
            Phase::Landing if !self.has_slid() && self.is_still => PlantStatus::NotLanded,
            Phase::Landing | Phase::Landed => PlantStatus::Slid,
            Phase::Standing | Phase::TakingOff => PlantStatus::NotLanded,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_NS: u64 = 1_000_000;

    fn scenario(standing: bool) -> Scenario {
        let mut scenario = Scenario::default();
        (scenario.plant.ground.present, scenario.initial.standing) = (true, standing);
        scenario
    }

    struct Vehicle(Landing, f64);

    impl Vehicle {
        fn new(standing: bool) -> Self {
            let scenario = scenario(standing);
            Self(Landing::new(&scenario).expect("there is a ground"), scenario.idle_speed())
        }

        /// Observes `seconds` at this footing and speed and returns the status, with the rotors at `idle` times their
        /// idle speed.
        fn go(&mut self, seconds: f64, footing: Footing, speed_mps: f64, idle: f64) -> PlantStatus {
            let motion = Kinematics { velocity_mps: [speed_mps, 0.0, 0.0], ..Kinematics::default() };
            for _ in 0..(seconds * 1e3).round() as u32 {
                let slid_m = if footing == Footing::None { 0.0 } else { speed_mps * STEP_NS as f64 / 1e9 };
                self.0.observe(&motion, footing, slid_m, [self.1 * idle; 3], STEP_NS);
            }
            self.0.in_flight()
        }
    }

    #[test]
    fn a_flight_goes_from_standing_to_standing() {
        let mut vehicle = Vehicle::new(true);
        assert_eq!(vehicle.go(0.5, Footing::All, 0.0, 1.0), PlantStatus::Standing);
        assert_eq!(vehicle.0.at_the_end(), PlantStatus::NotLanded, "it never took off");
        assert_eq!(vehicle.go(0.5, Footing::All, 0.0, 5.0), PlantStatus::TakingOff);
        assert_eq!(vehicle.go(5.0, Footing::None, 0.0, 5.0), PlantStatus::Flying);
        assert_eq!(vehicle.0.at_the_end(), PlantStatus::Finished);
        assert_eq!(vehicle.go(0.3, Footing::Some, 0.5, 5.0), PlantStatus::Landing);
        assert_eq!(vehicle.go(0.9, Footing::All, 0.0, 1.0), PlantStatus::Landing);
        assert_eq!(vehicle.0.at_the_end(), PlantStatus::NotLanded, "not yet");
        assert_eq!(vehicle.go(0.2, Footing::All, 0.0, 1.0), PlantStatus::Standing);
        assert_eq!(vehicle.0.at_the_end(), PlantStatus::Landed);
        assert_eq!(vehicle.go(0.1, Footing::All, 0.0, 5.0), PlantStatus::TakingOff, "and again");
    }

    #[test]
    fn a_vehicle_with_thrust_on_one_foot_or_in_motion_has_not_landed() {
        for (footing, speed_mps, idle, end) in [
            (Footing::All, 0.0, 5.0, PlantStatus::NotLanded),
            (Footing::Some, 0.0, 1.0, PlantStatus::Slid),
            (Footing::All, 5.0, 1.0, PlantStatus::Slid),
        ] {
            let mut vehicle = Vehicle::new(false);
            vehicle.go(1.0, Footing::None, 0.0, 5.0);
            vehicle.go(3.0, footing, speed_mps, idle);
            assert_eq!((vehicle.0.in_flight(), vehicle.0.at_the_end()), (PlantStatus::Landing, end));
        }
    }

    #[test]
    fn a_long_slide_is_no_landing_even_when_it_ends() {
        let mut vehicle = Vehicle::new(false);
        vehicle.go(1.0, Footing::None, 0.0, 5.0);
        vehicle.go(MAX_SLIDE_M * 0.6, Footing::All, 1.0, 1.0);
        vehicle.go(0.2, Footing::None, 1.0, 1.0);
        assert_eq!(
            vehicle.go(MAX_SLIDE_M * 0.6, Footing::All, 1.0, 1.0),
            PlantStatus::Landing,
            "a bounce interrupts it"
        );
        assert_eq!(vehicle.go(2.0, Footing::All, 0.0, 0.0), PlantStatus::Standing);
        assert_eq!(vehicle.0.at_the_end(), PlantStatus::Slid);
    }

    #[test]
    fn a_landing_lasts_until_the_feet_slide_as_far_again_or_something_lifts_the_vehicle() {
        let landed = || {
            let mut vehicle = Vehicle::new(false);
            vehicle.go(1.0, Footing::None, 0.0, 5.0);
            vehicle.go(MAX_SLIDE_M * 0.8, Footing::All, 1.0, 1.0);
            vehicle.go(1.5, Footing::All, 0.0, 0.0);
            assert_eq!(vehicle.0.at_the_end(), PlantStatus::Landed);
            vehicle
        };
        let mut waits = landed();
        waits.go(600.0, Footing::All, 0.0, 0.0);
        waits.go(0.01, Footing::Some, 0.5, 0.0); // a gust rocks the vehicle
        assert_eq!(waits.0.at_the_end(), PlantStatus::Landed);
        for (seconds, end) in [(0.9, PlantStatus::Landed), (1.1, PlantStatus::Slid)] {
            let mut blown = landed();
            blown.go(seconds * MAX_SLIDE_M, Footing::All, 1.0, 0.0);
            assert_eq!(blown.0.at_the_end(), end);
        }
        let mut lifted = landed();
        lifted.go(0.5, Footing::None, 0.0, 0.0);
        assert_ne!(lifted.0.at_the_end(), PlantStatus::Landed);
    }

    #[test]
    fn without_a_ground_there_is_no_landing() {
        assert!(Landing::new(&Scenario::default()).is_none());
    }
}
