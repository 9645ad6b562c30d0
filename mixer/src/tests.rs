//! Direction, limits, round trips, then the independent values.

use airframe::{Actuation, MixingMatrix, Parameters};
use contract::Scenario;
use contract::message::{Controls, mixer_flags};
use contract::scenario::Profile;
use nalgebra::Vector4;
use proptest::prelude::*;

use crate::{Mixer, allocation};

fn mix(demand: [f64; 4]) -> contract::message::Actuators {
    Mixer::new(&Scenario::of(Profile::Paper)).step(&Controls { demand, ..Controls::default() })
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
fn limits_hold_and_are_told() {
    let full = mix([-1e3, 0.0, 0.0, 0.0]);
    let limits = Scenario::of(Profile::Paper).limits();
    assert_eq!(full.command.rotor_speed, limits.rotor_speed_max);
    assert_eq!(full.flags, 0b111);
    let negative = mix([4.0, 1.2, 1.5, 0.0]);
    assert_ne!(negative.flags & mixer_flags::NEGATIVE_SQUARE, 0);
    assert_eq!(mix([0.0; 4]).flags, 0);
}

#[test]
fn a_demand_that_is_not_finite_gets_trim() {
    let trim = mix([0.0; 4]).command;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let answer = mix([0.0, bad, 0.0, 0.0]);
        assert_eq!(answer.flags, mixer_flags::BAD_INPUT);
        assert!((answer.command.rotor_speed[0] - trim.rotor_speed[0]).abs() < 1e-9);
    }
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
    fn what_the_actuators_can_do_is_done_exactly(
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
    fn any_bits_at_all_give_a_command_inside_the_limits(bits in prop::array::uniform4(any::<u64>())) {
        for profile in [Profile::Paper, Profile::Robust] {
            let scenario = Scenario::of(profile);
            let limits = scenario.limits();
            let controls = Controls { demand: bits.map(f64::from_bits), ..Controls::default() };
            let command = Mixer::new(&scenario).step(&controls).command;
            prop_assert!(command.tilt_rad.abs() <= limits.tilt_max_rad);
            for (omega, max) in command.rotor_speed.iter().zip(limits.rotor_speed_max) {
                prop_assert!((limits.rotor_speed_min..=max).contains(omega));
            }
        }
    }
}
