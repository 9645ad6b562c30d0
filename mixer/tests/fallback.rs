//! Flights without the controller and with a dead rotor: the mixer alone with the plant's equations of motion.

#![allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion")]

use airframe::Trim;
use contract::actuation::Actuation;
use contract::message::{Actuators, Controls, Kinematics, Stamp, State, mixer_flags as flags};
use mixer::Mixer;
use nalgebra::Vector3;
use plant::dynamics::{self, Dynamics, StateVector, Surroundings};
use plant::integrator;
use plant::rotors::Condition;
use runtime::node::Core;
use settings::{BrokenVehicle, Profile, Scenario};

/// Vehicle that only the mixer controls.
struct Flight {
    scenario: Scenario,
    mixer: Mixer,
    vehicle: Dynamics,
    x: StateVector,
    command: Actuation,
    /// Angle at which the tilt servo is stuck \[rad\].
    stuck_rad: Option<f64>,
    tick: u64,
}

impl Flight {
    /// Starts at trim, displaced by an attitude \[rad\] and rates \[rad/s\].
    fn start(profile: Profile, rate_hz: u32, attitude_rad: [f64; 3], rates_radps: [f64; 3]) -> Self {
        let mut scenario = Scenario::from(profile);
        scenario.run.rate_hz = rate_hz;
        Self::of(scenario, attitude_rad, rates_radps)
    }

    /// Starts at trim, with a vehicle that descends when it is broken.
    fn breakable(profile: Profile, rate_hz: u32) -> Self {
        let mut scenario = Scenario::from(profile);
        scenario.run.rate_hz = rate_hz;
        scenario.mixer.broken_vehicle = BrokenVehicle::Descend;
        Self::of(scenario, [0.0; 3], [0.0; 3])
    }

    fn of(scenario: Scenario, attitude_rad: [f64; 3], rates_radps: [f64; 3]) -> Self {
        let Trim { roll_rad, actuation } = Trim::solve(&scenario.airframe, false);
        let mut motion = Kinematics { attitude_rad, rates_radps, ..Kinematics::default() };
        motion.attitude_rad[0] += roll_rad;
        Self {
            mixer: Mixer::new(&scenario),
            vehicle: Dynamics::new(&scenario),
            x: dynamics::assemble(&motion, &actuation),
            command: actuation,
            stuck_rad: None,
            tick: 0,
            scenario,
        }
    }

    /// Flies one period under an outside influence. With `hover` every tick has a demand to hover, else only tick 0.
    fn turn(&mut self, hover: bool, outside: &Surroundings) -> Actuators {
        let stamp = |tick| Stamp { tick, sequence: tick + 1, ..Stamp::default() };
        let mut state = State { measured: dynamics::kinematics(&self.x), ..State::default() };
        (state.stamp, state.command_in_force) = (stamp(self.tick), self.command.into());
        let heard = Controls { stamp: stamp(if hover { self.tick } else { 0 }), ..Controls::default() };
        let actuators = self.mixer.step(self.tick, &heard, &state);
        self.command = actuators.command.into();
        let mut clipped = self.vehicle.clip(&self.command);
        clipped.tilt_rad = self.stuck_rad.unwrap_or(clipped.tilt_rad);
        let steps = self.scenario.sample_ns() / self.scenario.substep_ns();
        for _ in 0..steps {
            let whole = Condition::default();
            let derivative = |_: f64, x: &StateVector| self.vehicle.derivative(x, &clipped, &whole, outside);
            self.x = integrator::step(&self.x, self.scenario.substep_ns() as f64 / 1e9, derivative);
        }
        self.tick += 1;
        actuators
    }

    fn time_s(&self) -> f64 {
        self.tick as f64 * self.scenario.sample_s()
    }

    fn tilt_deg(&self) -> f64 {
        let [phi, theta, _] = dynamics::kinematics(&self.x).attitude_rad;
        (phi.cos() * theta.cos()).acos().to_degrees()
    }

    fn down_mps(&self) -> f64 {
        let [phi, theta, psi] = dynamics::kinematics(&self.x).attitude_rad;
        let rotation = nalgebra::Rotation3::from_euler_angles(phi, theta, psi);
        (rotation * Vector3::from(dynamics::kinematics(&self.x).velocity_mps)).z
    }

    /// Takes all thrust from a rotor.
    fn kill(&mut self, rotor: usize) {
        self.scenario.plant.rotor_effectiveness[rotor] = 0.0;
        self.vehicle = Dynamics::new(&self.scenario);
    }
}

const PROFILES: [Profile; 2] = [Profile::Paper, Profile::Robust];
const RATES_HZ: [u32; 4] = [50, 100, 500, 2000];

#[test]
fn a_second_without_demands_in_gusts_never_tilts_far() {
    for (profile, rate_hz) in PROFILES.into_iter().flat_map(|profile| RATES_HZ.map(|rate_hz| (profile, rate_hz))) {
        for turn in 0..8 {
            let (sin, cos) = (f64::from(turn) * std::f64::consts::FRAC_PI_4).sin_cos();
            let mut flight =
                Flight::start(profile, rate_hz, [0.15 * cos, 0.15 * sin, 0.0], [0.5 * cos, 0.5 * sin, 0.3]);
            let mut worst_deg = 0.0_f64;
            while flight.time_s() < 1.0 {
                // A push on force and moments that changes its sign every 250 ms.
                let sign = if ((flight.time_s() * 4.0) as u64).is_multiple_of(2) { 1.0 } else { -1.0 };
                let gust = Surroundings {
                    force_n: Vector3::new(2.0 * cos, 2.0 * sin, 1.0) * sign,
                    moment_nm: Vector3::new(0.05 * cos, 0.05 * sin, 0.02) * sign,
                    ..Surroundings::default()
                };
                flight.turn(false, &gust);
                worst_deg = worst_deg.max(flight.tilt_deg());
            }
            assert!(worst_deg < 35.0, "{profile:?} {rate_hz} Hz: {worst_deg} deg");
            assert!(flight.down_mps().abs() < 1.0, "{profile:?} {rate_hz} Hz: {} m/s", flight.down_mps());
        }
    }
}

#[test]
fn the_vehicle_levels_holds_its_height_and_then_descends() {
    for (profile, rate_hz) in PROFILES.into_iter().flat_map(|profile| RATES_HZ.map(|rate_hz| (profile, rate_hz))) {
        let mut flight = Flight::start(profile, rate_hz, [0.3, -0.3, 0.5], [1.0, -1.0, 1.0]);
        while flight.time_s() < 1.99 {
            flight.turn(false, &Surroundings::default());
        }
        let Kinematics { position_m, attitude_rad, rates_radps, .. } = dynamics::kinematics(&flight.x);
        let roll_trim_rad = Trim::solve(&flight.scenario.airframe, false).roll_rad;
        let miss = (attitude_rad[0] - roll_trim_rad).hypot(attitude_rad[1]);
        assert!(
            miss < 0.01 && rates_radps[2].abs() < 0.01,
            "{profile:?} {rate_hz} Hz: {attitude_rad:?} {rates_radps:?}"
        );
        assert!(position_m[2].abs() < 0.3, "{profile:?} {rate_hz} Hz: {} m", position_m[2]);
        while flight.time_s() < 6.0 {
            assert_eq!(flight.turn(false, &Surroundings::default()).flags & flags::CUT, 0);
        }
        assert!((flight.down_mps() - 0.7).abs() < 0.01, "{profile:?} {rate_hz} Hz: {} m/s", flight.down_mps());
    }
}

#[test]
fn a_dead_rotor_ends_the_flight_within_300_ms_and_for_good() {
    for (profile, rate_hz) in PROFILES.into_iter().flat_map(|profile| RATES_HZ.map(|rate_hz| (profile, rate_hz))) {
        for rotor in 0..3 {
            let mut flight = Flight::start(profile, rate_hz, [0.0; 3], [0.0; 3]);
            while flight.time_s() < 0.5 {
                assert_eq!(flight.turn(true, &Surroundings::default()).flags, 0);
            }
            flight.kill(rotor);
            while flight.turn(true, &Surroundings::default()).flags & flags::TERMINATED == 0 {
                assert!(flight.time_s() < 0.8, "{profile:?} {rate_hz} Hz rotor {rotor} was not noticed");
            }
            let after = flight.turn(true, &Surroundings::default());
            assert_eq!((after.flags, after.command.rotor_speed), (flags::CUT | flags::TERMINATED, [0.0; 3]));

            let mut candidate = Mixer::new(&flight.scenario);
            assert!(candidate.restore(&flight.mixer.snapshot()));
            flight.mixer = candidate;
            assert_eq!(flight.turn(true, &Surroundings::default()).flags, flags::CUT | flags::TERMINATED);
        }
    }
}

/// Flies on until the vehicle has sunk by 8 m, 15 s at most; returns the flags of the last command.
fn sink_by_8_m(flight: &mut Flight) -> u64 {
    let until_s = flight.time_s() + 15.0;
    loop {
        let flags = flight.turn(true, &Surroundings::default()).flags;
        if dynamics::kinematics(&flight.x).position_m[2] >= 8.0 || flight.time_s() >= until_s {
            return flags;
        }
    }
}

#[test]
fn without_rotor_1_the_vehicle_comes_down_in_a_spin_at_a_fraction_of_the_speed_of_a_fall() {
    for profile in PROFILES {
        let mut flight = Flight::breakable(profile, 100);
        flight.kill(0);
        let flags = sink_by_8_m(&mut flight);
        assert_eq!(flags & !0b111, flags::DESCENDING | flags::YAW_GIVEN_UP, "{profile:?}");
        assert!(flight.down_mps() < 3.0, "{profile:?}: {} m/s", flight.down_mps());
        assert!(flight.tilt_deg() < 30.0, "{profile:?}: {} deg", flight.tilt_deg());
        assert!(dynamics::kinematics(&flight.x).rates_radps[2] > 15.0, "{profile:?}");
        let [north_mps, east_mps, _] = dynamics::kinematics(&flight.x).velocity_ned_mps();
        assert!(north_mps.hypot(east_mps) < 4.0, "{profile:?}: {north_mps} {east_mps} m/s");
    }
}

#[test]
fn without_a_rear_rotor_thrust_is_cut_as_no_spin_has_thrust_to_spare() {
    for rotor in [1, 2] {
        let mut flight = Flight::breakable(Profile::Robust, 100);
        flight.kill(rotor);
        assert_eq!(sink_by_8_m(&mut flight), flags::CUT | flags::TERMINATED);
    }
}

#[test]
fn with_a_stuck_servo_the_vehicle_descends_level_and_spins_no_faster_than_its_inertia_allows() {
    for (stuck_deg, profile) in [19.0_f64, 20.0, 41.0, 42.0].into_iter().flat_map(|deg| PROFILES.map(|p| (deg, p))) {
        let mut flight = Flight::breakable(profile, 100);
        flight.stuck_rad = Some(stuck_deg.to_radians());
        let flags = sink_by_8_m(&mut flight);
        let what = format!("{profile:?} {stuck_deg}");
        assert_eq!(flags & !0b111, flags::DESCENDING | flags::YAW_GIVEN_UP, "{what}");
        assert!((flight.down_mps() - 0.7).abs() < 0.3, "{what}: {} m/s", flight.down_mps());
        assert!(flight.tilt_deg() < 26.0, "{what}: {} deg", flight.tilt_deg());
        assert!(dynamics::kinematics(&flight.x).rates_radps[2].abs() < 30.0, "{what}");
    }
}

#[test]
fn a_mixer_that_takes_over_from_a_broken_vehicle_continues_its_descent_bit_for_bit() {
    for (dead, stuck_deg) in [(Some(0), None), (None, Some(22.0_f64))] {
        let fly = |swapped: bool| {
            let mut flight = Flight::breakable(Profile::Robust, 100);
            flight.stuck_rad = stuck_deg.map(f64::to_radians);
            if let Some(rotor) = dead {
                flight.kill(rotor);
            }
            for tick in 0..200 {
                flight.turn(true, &Surroundings::default());
                if swapped && tick % 7 == 0 {
                    let mut candidate = Mixer::new(&flight.scenario);
                    assert!(candidate.restore(&flight.mixer.snapshot()));
                    flight.mixer = candidate;
                }
            }
            flight.x.map(f64::to_bits)
        };
        assert_eq!(fly(true), fly(false));
    }
}
