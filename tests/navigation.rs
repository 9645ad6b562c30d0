//! The estimator in whole flights: its errors are as large as it expects, with every error of the shipped sensors. Its
//! filter equals a second implementation.

use std::fmt::Write as _;
use std::process::Command;

use contract::Topic;
use contract::message::{Kinematics, Navigation, State, Truth};
use nalgebra::{DVector, UnitQuaternion, Vector2, Vector3};
use navigation::state::{ATTITUDE, POSITION, VELOCITY};
use navigation::{Aiding, Constants, ExpectedNoise, Filter, Imu, InitialErrors, Source, Wander};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use settings::{SensorPreset, SensorsSettings};

use crate::harness::{fly, python_with, top};

/// Number of components of an error: position and velocity in NED, attitude as turns about the body axes.
const ERRORS: usize = 9;

/// Returns the error of the estimate in a sample, and the standard deviations that the unit expects.
fn error(state: &State, truth: &Truth) -> [(f64, f64); ERRORS] {
    let parts = |motion: &Kinematics| {
        let [roll, pitch, yaw] = motion.attitude_rad;
        let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        (Vector3::from(motion.position_m), attitude * Vector3::from(motion.velocity_mps), attitude)
    };
    let (estimated, actual) = (parts(&state.measured), parts(&truth.actual));
    let off = [estimated.0 - actual.0, estimated.1 - actual.1, (actual.2.inverse() * estimated.2).scaled_axis()];
    let of = &state.navigation;
    let expected = [of.position_m, of.velocity_mps, of.attitude_rad];
    std::array::from_fn(|i| (off[i / 3][i % 3], expected[i / 3][i % 3]))
}

#[test]
fn val_errors_stay_inside_three_deviations_with_the_shipped_sensors() {
    for (scenario, preset) in [("dryden", "typical"), ("fast-legs", "typical"), ("dryden", "good")] {
        let mut samples = 0.0;
        let mut inside = [0.0; ERRORS];
        let mut squares = [(0.0, 0.0); ERRORS];
        for seed in 1..=5 {
            let [file, sensors, seed] = [
                format!("scenarios/{scenario}.toml"),
                format!("plant.sensors.preset={preset}"),
                format!("run.seed={seed}"),
            ];
            let of = ["--mode", "inprocess", "--set", "bounds.max_position_error_m=inf", "--set", "run.duration_s=30"];
            let outcome = fly(&[&[file.as_str(), "--set", &sensors, "--set", &seed], &of[..]].concat());
            let log = flight::log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
            for (state, truth) in log.states.iter().zip(&log.truths) {
                samples += 1.0;
                for (i, (off, expected)) in error(state, truth).into_iter().enumerate() {
                    inside[i] += f64::from(u8::from(off.abs() <= 3.0 * expected));
                    squares[i] = (squares[i].0 + off * off, squares[i].1 + expected * expected);
                }
                assert_eq!(state.navigation.resets, 0);
            }
        }
        for (i, (inside, (found, expected))) in inside.into_iter().zip(squares).enumerate() {
            let (share, ratio) = (inside / samples, (found / expected).sqrt());
            let words = format!("{scenario}, {preset}, error {i}: {share:.3} inside, {ratio:.2} of the expected size");
            // Constant errors are drawn once a flight, so five flights tell little of their size.
            assert!(share > 0.95 && (0.05..1.6).contains(&ratio), "{words}");
        }
    }
}

/// Times at which the errors of the long hover are checked \[s\]; the last one ends the flight.
const CHECKS_S: [u64; 4] = [30, 60, 300, 600];
/// Parts of the error, each with its first state and the number of its states.
const PARTS: [(&str, usize, usize); 4] =
    [("all", 0, ERRORS), ("position", POSITION, 3), ("velocity", VELOCITY, 3), ("attitude", ATTITUDE, 3)];

/// Hovers for ten minutes in the gusts of `dryden`. Returns NEES = e' P^-1 e of the error e of each part at each check,
/// and NIS = y' S^-1 y of the last innovation y of each source.
fn ten_minutes(preset: SensorPreset, seed: u64) -> ([[f64; PARTS.len()]; CHECKS_S.len()], [f64; Source::ALL.len()]) {
    let gusts = std::fs::read_to_string(top().join("scenarios/dryden.toml")).expect("the file is readable");
    let hover = ["run.mode='inprocess'", "run.duration_s=600", "mission.trajectory='hover'"];
    let mut scenario = settings::load_text(&gusts, "dryden", &hover.map(str::to_owned)).expect("a valid scenario");
    (scenario.run.seed, scenario.plant.sensors) = (seed, SensorsSettings::from(preset));
    let mut ring = flight::nodes::ring(&scenario, false).expect("the nodes open");
    let (mut nees, mut nis) = ([[0.0; PARTS.len()]; CHECKS_S.len()], [0.0; Source::ALL.len()]);
    while ring.begin().expect("a sample") {
        ring.answer(&Topic::OF_CONTROLLERS);
        let now_ns = ring.sample().stamp.tick * scenario.sample_ns();
        if let Some(check) = CHECKS_S.iter().position(|at_s| at_s * 1_000_000_000 == now_ns) {
            let unit = ring.plant().navigation().expect("the presets have the EKF");
            let covariance = unit.covariance(now_ns);
            let off = error(ring.sample(), &ring.plant().truth()).map(|(off, _)| off);
            nees[check] = PARTS.map(|(_, from, states)| {
                let of_part = covariance.view((from, from), (states, states)).into_owned();
                let off = DVector::from_column_slice(&off[from..from + states]);
                of_part.cholesky().map_or(f64::INFINITY, |of_part| off.dot(&of_part.solve(&off)))
            });
            let records = Source::ALL.map(|source| unit.navigation().filter().record(source));
            nis = records.map(|record| record.nis);
            assert_eq!(records.map(|record| record.resets), [0.0; Source::ALL.len()], "resets, seed {seed}");
        }
        ring.end(|_| true);
    }
    (nees, nis)
}

/// The mean over 100 seeds is within 4 standard deviations of a chi-square mean: Bar-Shalom, Li and Kirubarajan,
/// *Estimation with applications to tracking and navigation* (2001), section 5.4. Each mean takes one number of each
/// seed, because the numbers of one flight are correlated.
#[test]
#[allow(clippy::disallowed_macros, reason = "a developer reads the means")]
#[ignore = "200 flights of ten minutes: cargo test --release --test stack ten_minutes -- --ignored --nocapture"]
fn val_in_ten_minutes_the_filter_errs_as_it_says() {
    const SEEDS: u64 = 100;
    for preset in [SensorPreset::Typical, SensorPreset::Good] {
        let flown: Vec<_> = (1..=SEEDS).into_par_iter().map(|seed| ten_minutes(preset, seed)).collect();
        let check = |what: String, freedom: usize, of: &[f64]| {
            let (mean, expected) = (of.iter().sum::<f64>() / of.len() as f64, freedom as f64);
            let bound = 4.0 * (2.0 * expected / of.len() as f64).sqrt();
            println!("{preset:?}: {what}: {mean:.2} for {expected:.0} +- {bound:.2}");
            assert!((mean - expected).abs() <= bound, "{preset:?}: {what}: {mean:.2}");
        };
        for (i, at_s) in CHECKS_S.iter().enumerate() {
            for (part, (name, _, states)) in PARTS.iter().enumerate() {
                let of: Vec<f64> = flown.iter().map(|(nees, _)| nees[i][part]).collect();
                check(format!("NEES, {name}, {at_s} s"), *states, &of);
            }
        }
        for source in Source::ALL {
            let of: Vec<f64> = flown.iter().map(|(_, nis)| nis[source as usize]).collect();
            if of.iter().any(|nis| *nis > 0.0) {
                check(format!("NIS, {source:?}"), source.components(), &of);
            }
        }
    }
}

#[test]
fn without_the_kalman_filter_no_errors_are_reported() {
    let outcome = fly(&["scenarios/dryden.toml", "--mode", "inprocess", "--set", "run.duration_s=1"]);
    let log = flight::log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    assert!(!log.states.is_empty() && log.states.iter().all(|state| state.navigation == Navigation::default()));
}

/// Flies `dryden` with the sensors `typical` and these faults, and returns the largest position error \[m\], the
/// largest speed \[m/s\], and the last sample.
fn flown_with(faults: &str) -> (f64, f64, State) {
    let faults = format!("fault=[{faults}]");
    let set = ["plant.sensors.preset=typical", "bounds.max_position_error_m=inf", "run.duration_s=40", &faults];
    let set = set.iter().flat_map(|setting| ["--set", setting]);
    let outcome = fly(&["scenarios/dryden.toml", "--mode", "inprocess"].into_iter().chain(set).collect::<Vec<_>>());
    let log = flight::log::read(&outcome.out.join("flight.mcap")).expect("the log reads");
    let speed = |truth: &Truth| Vector3::from(truth.actual.velocity_mps).norm();
    let fastest = log.truths.iter().map(speed).fold(0.0, f64::max);
    (outcome.metric("max_position_error_m"), fastest, *log.states.last().expect("a flight"))
}

#[test]
fn a_fix_that_jumps_and_stays_moves_neither_the_estimate_nor_the_vehicle() {
    let (_, without_mps, _) = flown_with("");
    let (most_m, fastest_mps, last) = flown_with("{at_s=10, target='position', kind='wrong', how='bias', value=100}");
    assert!(most_m < 1.0 && fastest_mps < without_mps + 0.2, "{most_m} m, {fastest_mps} m/s of {without_mps}");
    assert!(last.navigation.resets >= 1, "the drift was reset");
}

#[test]
fn no_fault_of_one_imu_costs_much() {
    for target in ["rates", "acceleration"] {
        for kind in ["off", "stuck", "garbage", "wrong", "noise"] {
            let (most_m, _, last) = flown_with(&format!("{{at_s=10, target='{target}', kind='{kind}', imu=1}}"));
            assert!(most_m < 0.7, "{target} {kind}: {most_m} m");
            assert!(last.navigation.imu == 2 || kind == "noise", "{target} {kind}: {:?}", last.navigation);
        }
    }
}

#[test]
fn a_fault_of_every_imu_is_reported() {
    let (_, _, last) = flown_with("{at_s=10, target='acceleration', kind='stuck'}");
    assert_eq!(last.navigation.imus_sound, 0);
}

/// Errors that the filter of the test expects; `tests/python/ekf.py` has the same numbers.
const NOISE: ExpectedNoise = ExpectedNoise {
    specific_force_mps2: 0.3,
    rates_radps: 0.001,
    acceleration_bias_walk: 0.002,
    rates_bias_walk: 0.0002,
    position_m: Vector3::new(0.15, 0.15, 0.25),
    velocity_mps: Vector3::new(0.05, 0.05, 0.1),
    height_m: 0.1,
    wind_pressure: 0.5,
    field: 0.02,
    inclination_rad: 1.138_3, // of a field (0.42, 0, 0.91)
    flow_mps: 0.1,
    antenna_m: 0.05,
    clock_s: 0.01,
    drift: [
        Wander { start: 0.5, walk: 0.1, time_s: 50.0 },
        Wander { start: 0.5, walk: 0.1, time_s: 50.0 },
        Wander { start: 0.0, walk: 0.05, time_s: f64::INFINITY },
    ],
    barometer: Wander { start: 0.2, walk: 0.05, time_s: 30.0 },
    hard_iron: Wander { start: 0.02, walk: 0.004, time_s: 40.0 },
};
const START: InitialErrors = InitialErrors {
    position_m: 0.1,
    velocity_mps: 0.05,
    tilt_rad: 0.01,
    heading_rad: 0.03,
    constants: Constants {
        acceleration_bias_mps2: Vector3::new(0.05, 0.05, 0.02),
        rates_bias_radps: Vector3::new(0.01, 0.01, 0.01),
        declination_rad: 0.01,
    },
};
const SAMPLE_S: f64 = 0.005;
const DELAY: usize = 20;

/// Makes sample `k` of a vehicle that turns in its place from `attitude` on, and sets `attitude` to the attitude at the
/// end of the sample. The receiver is silent from 6 to 10 s, and shows a position 3 m off from then on, and once
/// before; the field turns at 12 s, and the height jumps at 13 s.
fn turning(k: u32, attitude: &mut UnitQuaternion<f64>, random: &mut ChaCha8Rng) -> (Imu, Aiding) {
    let t_s = f64::from(k) * SAMPLE_S;
    let mut noisy = |size: f64, value: Vector3<f64>| value.map(|value| value + size * (random.random::<f64>() - 0.5));
    let rates_radps = Vector3::new(0.8 * (1.1 * t_s).cos(), 0.6 * (0.9 * t_s).cos(), 0.3);
    let half = UnitQuaternion::from_scaled_axis(rates_radps * (SAMPLE_S / 2.0));
    let force = (*attitude * half).inverse() * Vector3::new(0.0, 0.0, -9.81);
    *attitude = *attitude * half * half;
    let imu = Imu {
        specific_force_mps2: noisy(1.0, force + Vector3::new(0.0, 0.05, 0.0)),
        rates_radps: noisy(0.003, rates_radps),
    };
    let (has_fix, has_slow) = (k.is_multiple_of(20) && !(6.0..10.0).contains(&t_s), k.is_multiple_of(10));
    let away = Vector3::new(if t_s < 10.0 && k != 600 { 0.0 } else { 3.0 }, 0.0, 0.0);
    let aiding = Aiding {
        position_m: has_fix.then(|| noisy(0.5, away)),
        velocity_mps: has_fix.then(|| noisy(0.2, Vector3::zeros())),
        height_m: has_slow.then(|| noisy(0.3, Vector3::repeat(if t_s < 13.0 { 0.0 } else { 8.0 })).x),
        field: has_slow.then(|| {
            let east = if t_s < 12.0 { 0.0 } else { 0.4 };
            noisy(0.06, attitude.inverse() * Vector3::new(0.42, east, 0.91) + Vector3::new(0.02, -0.01, 0.03))
        }),
        flow_mps: (has_slow && t_s < 8.0).then(|| noisy(0.3, Vector3::zeros()).xy()),
    };
    (imu, aiding)
}

#[test]
fn a_second_implementation_of_the_filter_estimates_the_same() {
    let Some(python) = python_with(&["numpy"]) else { return };
    let state = navigation::State::default();
    let covariance = START.covariance(&state.attitude, &NOISE);
    let mut unit =
        navigation::Navigation::new([Filter::new(state, covariance, NOISE, 9.81)], START.constants, SAMPLE_S, DELAY);
    let (mut random, mut attitude) = (ChaCha8Rng::seed_from_u64(1), state.attitude);
    let (mut inputs, mut outputs) = (String::new(), String::new());
    for k in 0..4000 {
        let (imu, aiding) = turning(k, &mut attitude, &mut random);
        let told = |values: Option<&[f64]>, count: usize| match values {
            Some(values) => values.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(","),
            None => ",".repeat(count - 1),
        };
        let cells = [
            told(Some(imu.specific_force_mps2.as_slice()), 3),
            told(Some(imu.rates_radps.as_slice()), 3),
            told(aiding.position_m.as_ref().map(Vector3::as_slice), 3),
            told(aiding.velocity_mps.as_ref().map(Vector3::as_slice), 3),
            told(aiding.height_m.as_ref().map(std::slice::from_ref), 1),
            told(aiding.field.as_ref().map(Vector3::as_slice), 3),
            told(aiding.flow_mps.as_ref().map(Vector2::as_slice), 2),
        ];
        let _ = writeln!(inputs, "{}", cells.join(","));
        unit.update(&[imu; navigation::IMUS], &aiding);
        let (estimate, _) = unit.estimate(0.0);
        let turned = estimate.attitude.to_rotation_matrix().matrix().transpose(); // row by row
        let mut numbers =
            [estimate.position_m.as_slice(), estimate.velocity_mps.as_slice(), turned.as_slice()].concat();
        let navigation::State { acceleration_bias_mps2, rates_bias_radps, drift_m, hard_iron, .. } = estimate;
        numbers.extend(acceleration_bias_mps2.iter().chain(&rates_bias_radps).chain(&drift_m));
        numbers.extend([estimate.barometer_bias_m].iter().chain(&hard_iron).chain(&[estimate.declination_rad]));
        numbers.extend(unit.filter().covariance.diagonal().iter());
        let records = Source::ALL.map(|source| unit.filter().record(source));
        numbers.extend(records.iter().flat_map(|record| [record.accepted, record.refused, record.resets]));
        let _ = writeln!(outputs, "{}", told(Some(&numbers), 0));
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("inputs.csv"), inputs).expect("written");
    std::fs::write(folder.path().join("outputs.csv"), outputs).expect("written");
    let second = Command::new(python).arg(top().join("tests/python/ekf.py")).arg(folder.path()).output();
    let second = second.expect("python starts");
    let [printed, failed] = [&second.stdout, &second.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    let numbers: Vec<f64> = printed.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let [apart, spread, missed, refused, resets] = numbers[..] else { panic!("{printed}{failed}") };
    assert!(apart < 1e-9 && spread < 1e-9 && missed == 0.0, "{printed}");
    assert!(refused > 0.0 && resets > 0.0, "there was something to refuse: {printed}");
}
