//! Tests of directions, limits and round trips, and values of the independent simulator.

use airframe::envelope::Envelope;
use airframe::projection::{Projection, WEIGHTS};
use airframe::{DemandSet, MixingMatrix, Parameters};
use contract::actuation::Actuation;
use contract::message::{Actuators, Controls, Stamp, State, mixer_flags};
use nalgebra::{Matrix4, Vector4};
use proptest::prelude::*;
use settings::{Profile, Scenario};

use crate::{Mixer, allocation};

mod ladder;

/// Demand at tick 0.
fn fresh(demand: [f64; 4]) -> Controls {
    Controls { stamp: Stamp { sequence: 1, ..Stamp::default() }, demand, ..Controls::default() }
}

/// Answer of a new mixer to a fresh demand.
fn answer(scenario: &Scenario, demand: [f64; 4]) -> Actuators {
    Mixer::new(scenario).step(0, &fresh(demand), &State::default())
}

fn mix(demand: [f64; 4]) -> Actuators {
    answer(&Scenario::from(Profile::Paper), demand)
}

#[test]
fn demands_move_the_right_actuators() {
    let trim = mix([0.0; 4]).command;
    let climb = mix([-1.0, 0.0, 0.0, 0.0]).command;
    assert!(climb.rotor_speed.iter().zip(trim.rotor_speed).all(|(c, t)| *c > t), "up is negative");
    let nose_up = mix([0.0, 0.1, 0.0, 0.0]).command;
    assert!(nose_up.rotor_speed[0] > trim.rotor_speed[0] && nose_up.rotor_speed[1] < trim.rotor_speed[1]);
    let right_down = mix([0.0, 0.0, 0.1, 0.0]).command;
    assert!(right_down.rotor_speed[2] > right_down.rotor_speed[1]);
    assert!(mix([0.0, 0.0, 0.0, 0.1]).command.tilt_rad > trim.tilt_rad, "nose right by tilting right");
}

#[test]
fn limits_hold_and_raise_their_flags() {
    let full = mix([-1e3, 0.0, 0.0, 0.0]);
    let limits = Scenario::from(Profile::Paper).limits();
    assert_eq!(full.command.rotor_speed, limits.rotor_speed_max);
    assert_eq!(full.flags, 0b111);
    let negative = mix([4.0, 1.2, 1.5, 0.0]);
    assert_ne!(negative.flags & mixer_flags::NEGATIVE_SQUARE, 0);
    assert_eq!(mix([0.0; 4]).flags, 0);
}

#[test]
fn a_square_of_exactly_zero_stops_its_rotor_and_is_not_negative() {
    let identity = MixingMatrix {
        inverse: Matrix4::identity(),
        trim: Vector4::zeros(),
        ..MixingMatrix::new(&Parameters::default(), false)
    };
    for (u, is_negative) in [
        ([0.0, 1.0, 0.0, 0.0], false),
        ([0.0, 1.0, -1e-300, 4.0], true),
        ([0.0, 1.0, 4.0, -1e-300], true),
        ([0.0, 1.0, -1.0, -1.0], true),
    ] {
        let (actuation, negative) = allocation::allocate(&identity, &Vector4::from(u));
        let [_, omega2, omega3] = actuation.rotor_speed;
        assert_eq!((omega2, omega3), (u[2].max(0.0).sqrt(), u[3].max(0.0).sqrt()));
        assert_eq!(negative, is_negative, "{u:?}");
    }
}

#[test]
fn each_actuator_beyond_its_limit_raises_its_own_flag_beside_those_given() {
    let mut mixer = Mixer::new(&Scenario::from(Profile::Paper));
    let mixing = MixingMatrix::new(&Parameters::default(), false);
    let mut flags = |rotor_speed: [f64; 3], tilt_rad: f64| {
        mixer.allocate(&mixing.deviation(&Actuation { rotor_speed, tilt_rad }), mixer_flags::HELD).flags
    };
    let trim = mix([0.0; 4]).command;
    assert_eq!(flags(trim.rotor_speed, trim.tilt_rad), mixer_flags::HELD);
    for rotor in 0..3 {
        let mut speed = trim.rotor_speed;
        speed[rotor] *= 2.1; // the limit is twice the trim speed
        assert_eq!(flags(speed, trim.tilt_rad), mixer_flags::HELD | mixer_flags::ROTOR_SATURATED << rotor);
    }
    assert_eq!(flags(trim.rotor_speed, 1.6), mixer_flags::HELD | mixer_flags::TILT_SATURATED);
}

#[test]
fn val_mixer_cases() {
    let reference = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference/reference.json"));
    let reference: serde_json::Value = serde_json::from_str(reference).unwrap();
    let mixing = MixingMatrix::new(&Parameters::default(), false);
    let cases = reference["mixer_cases"].as_array().unwrap();
    assert!(cases.len() >= 4);
    for case in cases {
        let numbers = |key: &str| -> Vec<f64> { serde_json::from_value(case[key].clone()).unwrap() };
        let (actuation, negative) = allocation::allocate(&mixing, &Vector4::from_vec(numbers("d_udelta")));
        let [o1, o2, o3] = actuation.rotor_speed;
        for (ours, theirs) in [o1, o2, o3, actuation.tilt_rad].iter().zip(numbers("omega_mu_naive")) {
            assert!((ours - theirs).abs() <= 1e-9 * theirs.abs().max(1.0), "{}: {ours} {theirs}", case["name"]);
        }
        assert_eq!(negative, case["clamped_negative"], "{}", case["name"]);
    }
}

proptest! {
    #[test]
    fn a_demand_within_the_limits_is_produced_exactly(
        omega in prop::array::uniform3(250.0_f64..2600.0), tilt in -1.0_f64..1.0, reaction: bool
    ) {
        let mixing = MixingMatrix::new(&Parameters::default(), reaction);
        let demand = mixing.deviation(&Actuation { rotor_speed: omega, tilt_rad: tilt });
        let (back, negative) = allocation::allocate(&mixing, &demand);
        prop_assert!(!negative);
        prop_assert!((back.tilt_rad - tilt).abs() < 1e-9);
        prop_assert!(back.rotor_speed.iter().zip(omega).all(|(b, o)| (b - o).abs() < 1e-6));
    }

    #[test]
    fn any_bits_at_all_give_a_command_inside_the_limits(scenario in scenario(), demand in any_demand(), projection: bool) {
        let mut scenario = scenario;
        scenario.mixer.projection = projection;
        let limits = scenario.limits();
        let Actuators { command, flags, .. } = answer(&scenario, demand);
        if !demand.iter().all(|u| u.is_finite()) {
            prop_assert_eq!(flags, mixer_flags::BAD_INPUT | mixer_flags::CUT, "neither demand nor state");
            return Ok(());
        }
        prop_assert!(command.tilt_rad.abs() <= limits.tilt_max_rad);
        for (omega, max) in command.rotor_speed.iter().zip(limits.rotor_speed_max) {
            prop_assert!((limits.rotor_speed_min..=max).contains(omega));
        }
        prop_assert!(!projection || !mixer_flags::saturated(flags), "{flags:b}");
        prop_assert!(projection || flags & mixer_flags::PROJECTED == 0);
    }

    #[test]
    fn clipping_never_comes_nearer_than_the_projection(scenario in scenario(), demand in moderate_demand()) {
        let envelope = Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits());
        let set = DemandSet::exact(&envelope);
        let demand = Vector4::from(demand);
        let wanted = allocation::allocate(&envelope.mixing, &demand).0;
        let attainable = demand.zip_zip_map(&set.lower, &set.upper, f64::clamp);
        let clipped = envelope.mixing.deviation(&envelope.limits.clip(&wanted));
        prop_assume!(set.violation(&clipped) <= 1e-12);
        if let Some(nearest) = Projection::new(set, &WEIGHTS).nearest(&demand) {
            let miss = |of: &Vector4<f64>| (of - attainable).component_mul(&(of - attainable)).dot(&Vector4::from(WEIGHTS));
            let (ours, theirs) = (miss(&nearest), miss(&clipped));
            prop_assert!(ours <= theirs + 1e-6 * theirs.max(1.0), "{ours} is more than {theirs}");
        }
    }

    #[test]
    fn at_a_limit_rounding_clips_nothing(
        scenario in scenario(), speeds in prop::array::uniform3(range_with_ends()), tilt in range_with_ends(),
    ) {
        let limits = scenario.limits();
        let idle = limits.rotor_speed_min;
        let rotor_speed = std::array::from_fn(|i| idle + speeds[i] * (limits.rotor_speed_max[i] - idle));
        let wanted = Actuation { rotor_speed, tilt_rad: (2.0 * tilt - 1.0) * limits.tilt_max_rad };
        let demand = MixingMatrix::new(&scenario.airframe, scenario.mixer.tilt_reaction).deviation(&wanted);
        let flags = answer(&scenario, demand.into()).flags;
        prop_assert!(flags & !mixer_flags::PROJECTED == 0, "{flags:b}");
    }

    #[test]
    fn the_projection_leaves_demands_within_the_limits_unchanged(scenario in scenario(), demand in moderate_demand()) {
        let mut scenario = scenario;
        let [with, without] = [true, false].map(|projection| {
            scenario.mixer.projection = projection;
            answer(&scenario, demand)
        });
        if with.flags == 0 {
            prop_assert_eq!(with, without);
        } else {
            prop_assert_eq!(with.flags, mixer_flags::PROJECTED);
        }
    }
}

/// Vehicles of different strength, with and without idle speed and tilt reaction, with the projection.
fn scenario() -> impl Strategy<Value = Scenario> {
    let idle = prop_oneof![Just(0.0), 0.0..600.0_f64];
    (idle, 1.15..3.0_f64, 35.0..=90.0_f64, any::<bool>()).prop_map(|(idle, ratio, tilt_max_deg, tilt_reaction)| {
        let mut scenario = Scenario::from(Profile::Robust);
        scenario.plant.rotor_speed_min = idle;
        scenario.plant.rotor_speed_max_ratio = ratio;
        scenario.plant.tilt_max_deg = tilt_max_deg;
        scenario.mixer.tilt_reaction = tilt_reaction;
        scenario
    })
}

/// Numbers from 0 to 1, often 0 or 1.
fn range_with_ends() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(1.0), 0.0..1.0_f64]
}

/// Demands inside the actuators' set, near its border and far outside.
fn moderate_demand() -> impl Strategy<Value = [f64; 4]> {
    (prop::array::uniform4(-1.0..1.0_f64), -1.0..3.0_f64).prop_map(|(direction, decades)| {
        let size = 10_f64.powf(decades);
        direction.map(|share| share * size)
    })
}

/// Demands of any kind: moderate demands, every class of number, and raw bytes.
fn any_demand() -> impl Strategy<Value = [f64; 4]> {
    let number = |bytes: [u8; 8]| f64::from_le_bytes(bytes);
    prop_oneof![
        moderate_demand(),
        prop::array::uniform4(prop::num::f64::ANY),
        any::<[[u8; 8]; 4]>().prop_map(move |bytes| bytes.map(number)),
    ]
}
