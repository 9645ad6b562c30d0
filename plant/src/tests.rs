#![expect(clippy::float_cmp, reason = "what is only copied, or flown twice alike, must agree to the last bit")]

use airframe::Trim;
use contract::actuation::Actuation;
use contract::message::{ActuationMsg, Kinematics};
use proptest::prelude::*;
use serde_json::Value;
use settings::Profile;

use super::dynamics::StateVector;
use super::tricopter::divergence;
use super::*;

const MS: u64 = 1_000_000;

fn scenario() -> Scenario {
    Scenario::from(Profile::Paper)
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().expect("a number in the reference"))
}

fn message(sequence: u64, command: [f64; 4]) -> Actuators {
    let [o1, o2, o3, mu] = command;
    Actuators {
        stamp: Stamp { sequence, ..Stamp::default() },
        command: ActuationMsg { rotor_speed: [o1, o2, o3], tilt_rad: mu },
        flags: 0,
    }
}

/// Command of hover trim with every rotor faster by `share`.
fn faster(share: f64) -> [f64; 4] {
    let Actuation { rotor_speed: [o1, o2, o3], tilt_rad } = Trim::solve(&scenario().airframe, false).actuation;
    [o1 * (1.0 + share), o2 * (1.0 + share), o3 * (1.0 + share), tilt_rad]
}

/// Converts a state of the reference, which has 16 numbers with Euler angles.
fn from_euler(state: &[f64; 16]) -> StateVector {
    let three = |from: usize| [state[from], state[from + 1], state[from + 2]];
    let motion =
        Kinematics { position_m: three(0), velocity_mps: three(3), attitude_rad: three(6), rates_radps: three(9) };
    dynamics::assemble(&motion, &Actuation { rotor_speed: three(12), tilt_rad: state[15] })
}

fn to_euler(x: &StateVector) -> [f64; 16] {
    let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = dynamics::kinematics(x);
    let Actuation { rotor_speed, tilt_rad } = dynamics::actuation(x);
    let numbers = [position_m, velocity_mps, attitude_rad, rates_radps, rotor_speed, [tilt_rad, 0.0, 0.0]];
    std::array::from_fn(|i| numbers.as_flattened()[i])
}

/// Largest difference, relative to each number's size where that is above 1.
fn difference(got: &[f64; 16], expected: &[f64; 16]) -> f64 {
    got.iter().zip(expected).map(|(g, e)| (g - e).abs() / e.abs().max(1.0)).fold(0.0, f64::max)
}

#[test]
fn val_plant_cases() {
    let reference: Value =
        serde_json::from_str(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference/reference.json")))
            .expect("the reference is JSON");
    let cases = reference["plant_cases"].as_array().expect("the reference has plant cases");
    assert_eq!(cases.len(), 5);
    for case in cases {
        let mut scenario = scenario();
        let number = |key: &str| case["plant"][key].as_f64().expect("a plant setting");
        scenario.plant.rotor_lag_s = number("tau_m");
        scenario.plant.servo_lag_s = number("tau_s");
        scenario.plant.rotor_rate_limit = number("rate_m");
        scenario.plant.servo_rate_limit_radps = number("rate_s");
        scenario.plant.drag_linear_nspm = numbers(&case["plant"]["drag_lin"]);
        scenario.plant.drag_quadratic_ns2pm2 = number("cda");
        scenario.plant.tilt_reaction = case["plant"]["tilt_reaction"] == true;
        scenario.plant.wind_ned_mps = vec![(0.0, numbers(&case["wind_ned"]))];
        let mut plant = Plant::new(&scenario);
        plant.vehicle.x = from_euler(&numbers(&case["x0"]));
        let duration_s = case["T"].as_f64().expect("a duration");
        for period in 1..=(duration_s / 0.01).round() as u64 {
            plant.command(&message(period, numbers(&case["cmd"])), 0);
            plant.advance(1).unwrap();
        }

        let name = case["name"].as_str().expect("a name");
        let same_method = difference(&to_euler(&plant.vehicle.x), &numbers(&case["x_rk4_1ms"]));
        let exact = difference(&to_euler(&plant.vehicle.x), &numbers(&case["x_dop853"]));
        let tolerance = if name.starts_with("rate_limited") { 1e-5 } else { 1e-6 };
        assert!(same_method < 1e-9, "{name}: {same_method:e} from the same method with Euler angles");
        assert!(exact < tolerance, "{name}: {exact:e} from the exact solution");
    }
}

#[test]
fn hover_stays_put() {
    for tilt_reaction in [false, true] {
        let mut scenario = scenario();
        scenario.plant.tilt_reaction = tilt_reaction;
        let mut plant = Plant::new(&scenario);
        let start = plant.vehicle.x;
        for period in 1..=200 {
            plant.command(&message(period, [start[13], start[14], start[15], start[16]]), 0);
            assert_eq!(plant.advance(1).unwrap(), PlantStatus::Flying);
        }
        assert!(difference(&to_euler(&plant.vehicle.x), &to_euler(&start)) < 1e-9);
    }
}

#[test]
fn the_vehicle_starts_at_trim_plus_the_initial_displacement() {
    let mut scenario = scenario();
    scenario.initial.position_m = [1.0, 2.0, -3.0];
    scenario.initial.velocity_mps = [0.1, 0.2, 0.3];
    scenario.initial.attitude_deg = [10.0, -20.0, 90.0];
    scenario.initial.rates_radps = [0.4, 0.5, 0.6];
    let mut plant = Plant::new(&scenario);
    let (state, truth) = (plant.sample(), plant.truth());
    let trim = Trim::solve(&scenario.airframe, false);
    assert_eq!(truth.actual.position_m, [1.0, 2.0, -3.0]);
    assert_eq!(truth.actual.velocity_mps, [0.1, 0.2, 0.3]);
    assert_eq!(truth.actual.rates_radps, [0.4, 0.5, 0.6]);
    let [roll, pitch, yaw] = truth.actual.attitude_rad.map(f64::to_degrees);
    assert!((roll - trim.roll_rad.to_degrees() - 10.0).abs() < 1e-12);
    assert!((pitch + 20.0).abs() < 1e-12 && (yaw - 90.0).abs() < 1e-12);
    assert_eq!(state.measured, truth.actual);
    assert_eq!(Actuation::from(truth.actuators), trim.actuation);
    assert_eq!(Actuation::from(state.command_in_force), trim.actuation);
    assert_eq!((state.stamp.tick, state.applied_sequence, state.applied_age_ns), (0, 0, 0));
    assert_eq!(PlantStatus::from_wire(state.status), Some(PlantStatus::Flying));
}

#[test]
fn state_names_the_command_that_was_in_force_up_to_it() {
    let mut scenario = scenario();
    scenario.run.command_delay_ms = 10.0;
    let mut plant = Plant::new(&scenario);
    plant.sample();
    plant.command(&message(1, faster(0.01)), 0);
    plant.advance(1).unwrap();
    let at_effect = plant.sample();
    assert_eq!(at_effect.applied_sequence, 0, "it takes effect at this very instant, not before");
    plant.advance(1).unwrap();
    let after = plant.sample();
    assert_eq!((after.applied_sequence, after.applied_age_ns), (1, 10 * MS));
    assert_eq!(after.command_in_force, message(1, faster(0.01)).command);
}

#[test]
fn a_command_acts_from_its_arrival_on() {
    // The rotor lag has a closed form, so that the speed shows for how long the command has been in force.
    for arrival_ns in [0, 3 * MS, 3_141_593, 9_999_999] {
        let mut plant = Plant::new(&scenario());
        let from = plant.truth().actuators.rotor_speed[0];
        plant.command(&message(1, faster(0.05)), arrival_ns);
        plant.advance(1).unwrap();
        let acted_s = (10 * MS - arrival_ns) as f64 / 1e9;
        let expected = from * (1.05 - 0.05 * (-acted_s / 0.03).exp());
        let state = plant.sample();
        assert!((plant.truth().actuators.rotor_speed[0] - expected).abs() < 1e-6 * from);
        assert_eq!((state.applied_sequence, state.applied_age_ns), (1, arrival_ns));
    }
}

#[test]
fn a_command_may_arrive_periods_later() {
    let mut plant = Plant::new(&scenario());
    plant.command(&message(1, faster(0.05)), 25 * MS);
    plant.advance(2).unwrap();
    assert_eq!(plant.sample().applied_sequence, 0);
    assert_eq!(plant.vehicle.x[13].to_bits(), faster(0.0)[0].to_bits());
    plant.advance(1).unwrap();
    assert_eq!((plant.sample().applied_sequence, plant.sample().applied_age_ns), (1, 25 * MS));
}

#[test]
fn a_delay_of_whole_substeps_adds_no_integration_steps() {
    // Commands at a multiple of the substep do not change the grid of steps: the flight has the same bits as a flight
    // whose commands arrive later by the delay.
    let fly = |delay_ms: u64, arrival_ms: u64| {
        let mut scenario = scenario();
        scenario.run.command_delay_ms = delay_ms as f64;
        let mut plant = Plant::new(&scenario);
        for k in 0..20 {
            plant.command(&message(k + 1, faster(0.01 * k as f64)), arrival_ms * MS);
            plant.advance(1).unwrap();
        }
        plant.vehicle.x
    };
    assert_eq!(fly(7, 0), fly(0, 7));
    assert_eq!(fly(23, 4), fly(0, 27));
}

#[test]
fn several_periods_at_once_are_the_same_flight() {
    let mut one_by_one = Plant::new(&scenario());
    let mut at_once = one_by_one.clone();
    for plant in [&mut one_by_one, &mut at_once] {
        plant.command(&message(1, faster(0.02)), 4 * MS);
    }
    for _ in 0..7 {
        one_by_one.advance(1).unwrap();
    }
    at_once.advance(7).unwrap();
    // A sample reports the commands since the previous sample, which was seven periods ago for `at_once`.
    let (one, other) = (one_by_one.sample(), at_once.sample());
    assert_eq!((one.arrived, other.arrived, other.arrivals[0].after_ns), (0, 1, 4 * MS));
    assert_eq!(one, State { arrivals: one.arrivals, arrived: one.arrived, ..other });
}

#[test]
fn a_command_beyond_the_limits_is_followed_to_the_limit() {
    let mut plant = Plant::new(&scenario());
    plant.command(&message(1, [1e6, -1e6, 1e6, 9.0]), 0);
    for _ in 0..20 {
        plant.advance(1).unwrap();
    }
    let limits = scenario().limits();
    let actuators = plant.truth().actuators;
    assert!(actuators.rotor_speed[0] <= limits.rotor_speed_max[0] && actuators.rotor_speed[1] >= 0.0);
    assert!(actuators.tilt_rad <= limits.tilt_max_rad);
    assert_eq!(plant.sample().command_in_force.tilt_rad, 9.0, "STATE echoes the command as it was given");
}

#[test]
fn the_run_finishes_on_its_last_sample() {
    let mut scenario = scenario();
    scenario.run.duration_s = 0.05;
    let mut plant = Plant::new(&scenario);
    let status: Vec<PlantStatus> = (0..5).map(|_| plant.advance(1).unwrap()).collect();
    assert!(status[..4].iter().all(|s| *s == PlantStatus::Flying));
    assert_eq!(status[4], PlantStatus::Finished);
    assert_eq!(plant.sample().status, PlantStatus::Finished as u64);
}

#[test]
fn a_flight_that_has_ended_stays_ended() {
    let mut scenario = scenario();
    scenario.initial.rates_radps = [0.0, 99.0, 0.0];
    scenario.plant.disturbance = vec![(0.0, [0.0; 3], [0.0, 1.0, 0.0])];
    let mut plant = Plant::new(&scenario);
    let ticks = (1..100).find(|_| plant.advance(1).unwrap().diverged()).expect("it turns ever faster");
    let (state, truth) = (plant.sample(), plant.truth());
    assert_eq!(PlantStatus::from_wire(state.status), Some(PlantStatus::TooFast));
    assert_eq!((state.stamp.tick, truth.tick), (ticks, ticks));
    assert!(plant.vehicle.x.iter().all(|value| value.is_finite()));
    assert_eq!(plant.advance(3).unwrap(), PlantStatus::TooFast);
    let later = plant.truth();
    assert_eq!((later.tick, later.actual), (ticks + 3, truth.actual), "time passes and nothing moves");
}

#[test]
fn every_divergence_has_its_own_status() {
    let lost = |index: usize, value: f64| {
        let mut x = Plant::new(&scenario()).vehicle.x;
        x[index] = value;
        divergence(&x)
    };
    assert_eq!(lost(1, -500.1), Some(PlantStatus::TooFar));
    assert_eq!(lost(1, 499.9), None);
    assert_eq!(lost(12, 100.1), Some(PlantStatus::TooFast));
    assert_eq!(lost(12, -99.9), None);
    for bad in [f64::NAN, f64::INFINITY] {
        assert!((0..17).all(|index| lost(index, bad) == Some(PlantStatus::NonFinite)));
    }
}

proptest! {
    /// For any stream of commands the plant does not panic, and a state that is not finite has a diverged status.
    #[test]
    fn any_command_leaves_the_state_finite_or_diverged(
        commands in prop::collection::vec((prop::array::uniform4(prop::num::f64::ANY), 0u64..30 * MS), 1..40),
        substep_s in 0.0005..0.02,
    ) {
        let mut scenario = scenario();
        scenario.plant.substep_s = substep_s;
        let mut plant = Plant::new(&scenario);
        for (k, (command, arrival_ns)) in commands.into_iter().enumerate() {
            plant.command(&message(k as u64 + 1, command), arrival_ns);
            let status = plant.advance(1).unwrap();
            let finite = plant.vehicle.x.iter().all(|value| value.is_finite());
            prop_assert!(finite || status.diverged());
        }
    }

    /// Equal scenario, seed and commands give equal bits.
    #[test]
    fn a_flight_repeats_bit_for_bit(seed in any::<u64>(), thrust in -0.02..0.02) {
        let mut scenario = scenario();
        scenario.run.seed = seed;
        scenario.run.command_jitter_ms = 8.0;
        scenario.run.command_drop_probability = 0.3;
        scenario.plant.noise.position_m = 0.01;
        let fly = || {
            let mut plant = Plant::new(&scenario);
            (0..20).map(|k| {
                plant.command(&message(k + 1, faster(thrust)), MS);
                plant.advance(1).unwrap();
                plant.sample()
            }).collect::<Vec<State>>()
        };
        prop_assert_eq!(fly(), fly());
    }
}

/// Velocity after 0.1 s in the wind, from a hover at the reference height above the ground plane, NED \[m/s\].
fn blown(roughness_m: f64, ground_m: Option<f64>, wind_ned_mps: [f64; 3]) -> [f64; 3] {
    let mut scenario = scenario();
    scenario.plant.drag_linear_nspm = [1.0; 3];
    scenario.plant.wind_roughness_m = roughness_m;
    scenario.plant.wind_ned_mps = vec![(0.0, wind_ned_mps)];
    if let Some(down_m) = ground_m {
        (scenario.plant.ground.present, scenario.plant.ground.down_m) = (true, down_m);
    }
    scenario.initial.position_m = [0.0, 0.0, ground_m.unwrap_or(0.0) - turbulence::REFERENCE_HEIGHT_M];
    let mut plant = Plant::new(&scenario);
    plant.advance(10).unwrap();
    dynamics::velocity_ned_mps(&plant.vehicle.x).into()
}

#[test]
fn shear_is_measured_from_the_ground_plane() {
    let [whole, bare] = [0.0, 0.05].map(|roughness_m| blown(roughness_m, None, [5.0, 0.0, 0.0])[0]);
    assert!(whole > 0.1 && (bare / whole - 1.0).abs() < 1e-3, "{bare} of {whole}: the reference height");
    let ground = blown(0.05, Some(-40.0), [5.0, 0.0, 0.0])[0];
    assert!((ground / bare - 1.0).abs() < 1e-6, "{ground} over ground, {bare} without");
}

#[test]
fn shear_leaves_the_vertical_wind_alone() {
    let mut scenario = scenario();
    scenario.plant.drag_linear_nspm = [1.0; 3];
    scenario.plant.wind_ned_mps = vec![(0.0, [0.0, 0.0, 5.0])];
    let sink = |roughness_m: f64| {
        let mut scenario = scenario.clone();
        scenario.plant.wind_roughness_m = roughness_m;
        let mut plant = Plant::new(&scenario);
        plant.advance(10).unwrap();
        dynamics::velocity_ned_mps(&plant.vehicle.x).z
    };
    assert!(sink(0.0) > 0.1 && sink(0.05) == sink(0.0), "{} and {}", sink(0.05), sink(0.0));
}

/// Scenarios in which, taken together, every part of a plant has a memory.
fn vehicles() -> Vec<Scenario> {
    let load = |name: &str, more: &[&str]| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenarios/{name}.toml"));
        let more: Vec<String> = more.iter().map(|setting| (*setting).to_owned()).collect();
        settings::load(Some(&path), &more).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    let faults = "fault=[{at_s=0.2,target='rotor1',kind='stuck'},{at_s=0.2,target='rates',kind='stuck',for_s=0.1},\
                  {at_s=0.2,target='attitude',kind='slow',for_s=0.1},{at_s=1.1,target='position',kind='delayed',ms=50},\
                  {at_s=1.2,target='velocity',kind='noise'}]";
    let of_unit = "fault=[{at_s=0.2,target='rates',kind='stuck',imu=1,for_s=0.1},{at_s=0.2,target='acceleration',\
                   kind='slow'},{at_s=0.3,target='position',kind='delayed',ms=200},{at_s=0.9,target='field',kind='noise'}]";
    vec![
        load("survey", &["run.command_jitter_ms=5", "run.command_drop_probability=0.2", "run.command_delay_ms=25"]),
        load("dryden", &["plant.battery.energy_wh=20"]),
        load("typical-sensors", &["plant.sensors.flow.rate_hz=20", "run.mode=inprocess"]),
        load("take-off-and-land", &["run.mode=realtime"]),
        load("typical-sensors", &["run.mode=realtime", of_unit]),
        largest(),
        load("survey", &[faults, "run.mode=inprocess"]),
    ]
}

/// Scenario with the largest memory that the settings allow.
fn largest() -> Scenario {
    let settings = "run={mode='realtime',rate_hz=1000,duration_s=20}\nmission.trajectory='hover'\n\
                    plant.sensors={preset='typical',imu={rate_hz=1000},receiver={latency_ms=500},flow={rate_hz=1000}}\n\
                    fault=[{at_s=0.2,target='rates',kind='delayed',ms=1000}]";
    settings::load_text(settings, "the largest", &[]).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_largest_memory_that_the_settings_allow_has_room() {
    let mut plant = Plant::new(&largest());
    plant.advance(1500).unwrap();
    let length = plant.memory(&mut vec![0; PLANT_WORDS]);
    assert!(length.is_some_and(|length| length > PLANT_WORDS / 2), "{length:?}");
}

#[test]
fn a_vehicle_with_the_memory_of_another_continues_its_flight_bit_for_bit() {
    for scenario in vehicles() {
        let mut plant = Plant::new(&scenario);
        let (mut successors, mut memory) = (vec![], vec![0; PLANT_WORDS]);
        for tick in 0..150 {
            let state = plant.sample();
            for (since, successor) in &mut successors {
                let successor: &mut Plant = successor;
                assert!(
                    successor.sample() == state,
                    "{} {:?}: at {tick}, since {since}",
                    scenario.name,
                    scenario.run.mode
                );
            }
            if [40, 100].contains(&tick)
                && let Some(length) = plant.memory(&mut memory)
            {
                let memory = &memory[..length];
                let mut successor = Plant::new(&scenario);
                assert!(successor.restore(tick, memory), "{}", scenario.name);
                let mut again = vec![0; PLANT_WORDS];
                assert_eq!(successor.memory(&mut again), Some(length), "{}", scenario.name);
                assert!(again[..length] == *memory, "{}", scenario.name);
                assert!(!Plant::new(&scenario).restore(tick + 1, memory), "of another sample");
                successors.push((tick, successor));
            }
            let mut command = message(tick + 1, faster(0.02 * (tick as f64 / 7.0).sin()));
            command.stamp.tick = tick;
            for plant in std::iter::once(&mut plant).chain(successors.iter_mut().map(|(_, successor)| successor)) {
                plant.command(&command, 2 * MS);
                plant.advance(1).unwrap();
            }
        }
        assert!(!successors.is_empty(), "{}", scenario.name);
    }
}

proptest! {
    #[test]
    fn no_memory_makes_a_vehicle_panic_or_hang(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), prop_oneof![any::<u64>(), 0..5_u64, Just(u64::MAX)]), 1..4),
        which in 0..7_usize,
    ) {
        let scenario = &vehicles()[which];
        let mut plant = Plant::new(scenario);
        plant.advance(40).unwrap();
        plant.sample();
        let mut memory = vec![0; PLANT_WORDS];
        let length = plant.memory(&mut memory).expect("room");
        for (at, word) in changes {
            memory[at.index(length)] = word;
        }
        if plant.restore(40, &memory) {
            plant.advance(20).unwrap();
            plant.sample();
        }
    }
}

#[test]
fn quaternion_and_velocity_of_a_message_are_those_of_the_rotation() {
    for attitude_rad in [[0.0; 3], [0.3, 0.0, 0.0], [0.0, -0.7, 0.0], [0.1, 0.2, 3.0], [-2.5, 1.2, -1.9]] {
        let [roll, pitch, yaw] = attitude_rad;
        let rotation = nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let [w, x, y, z] = contract::message::quaternion(attitude_rad);
        let same = nalgebra::Quaternion::new(w, x, y, z);
        assert!((rotation.quaternion() - same).norm() < 1e-12, "{attitude_rad:?}");
        let motion = Kinematics { attitude_rad, velocity_mps: [3.0, -2.0, 0.5], ..Kinematics::default() };
        let expected = rotation * nalgebra::Vector3::from(motion.velocity_mps);
        assert!((nalgebra::Vector3::from(motion.velocity_ned_mps()) - expected).norm() < 1e-12, "{attitude_rad:?}");
    }
}
