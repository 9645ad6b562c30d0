//! Tests of trim, mixing, linear model and actuators: properties, and values of the independent simulator.

use std::f64::consts::FRAC_PI_2;

use contract::actuation::Actuation;
use nalgebra::{DMatrix, Matrix4, Vector4};
use proptest::prelude::*;
use serde_json::Value;

use crate::linear::{Continuous, lag_rates};
use crate::{ActuatorLaw, ActuatorLimits, MixingMatrix, Parameters, Trim};

pub(crate) fn reference() -> Value {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference/reference.json"));
    serde_json::from_str(text).unwrap()
}

fn matrix(rows: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(rows.clone()).unwrap();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

pub(crate) fn vector(value: &Value) -> Vector4<f64> {
    Vector4::from_vec(serde_json::from_value(value.clone()).unwrap())
}

/// Asserts equality to 1e-9, relative to the largest number of `expected`.
#[track_caller]
pub(crate) fn assert_close(got: &[f64], expected: &[f64]) {
    assert_eq!(got.len(), expected.len());
    let scale = expected.iter().fold(0.0, |max: f64, e| max.max(e.abs()));
    for (g, e) in got.iter().zip(expected) {
        assert!((g - e).abs() <= 1e-9 * scale, "{g} is not {e}");
    }
}

/// Limits of the paper, (52)-(53).
pub(crate) fn paper_limits() -> ActuatorLimits {
    ActuatorLimits::new(&Parameters::default(), 0.0, 2.0, FRAC_PI_2)
}

fn law() -> ActuatorLaw {
    ActuatorLaw {
        limits: paper_limits(),
        rotor_lag_s: 0.03,
        servo_lag_s: 0.02,
        rotor_rate_limit: 20_000.0,
        servo_rate_limit_radps: 10.5,
    }
}

#[test]
fn more_weight_needs_more_speed_and_the_same_attitude() {
    let light = Trim::solve(&Parameters::default(), false);
    let heavy = Trim::solve(&Parameters { mass_kg: 1.3, ..Parameters::default() }, false);
    for (h, l) in heavy.actuation.rotor_speed.iter().zip(light.actuation.rotor_speed) {
        assert!((h / l - (1.3f64 / 1.1).sqrt()).abs() < 1e-12);
    }
    assert_close(&[heavy.roll_rad, heavy.actuation.tilt_rad], &[light.roll_rad, light.actuation.tilt_rad]);
}

#[test]
fn a_tilt_to_the_right_is_balanced_by_a_roll_to_the_left() {
    for tilt_reaction in [false, true] {
        let trim = Trim::solve(&Parameters::default(), tilt_reaction);
        assert!(trim.actuation.tilt_rad > 0.0 && trim.roll_rad < 0.0);
    }
}

#[test]
fn trim_produces_the_weight_and_no_moment() {
    let vehicle = Parameters::default();
    for tilt_reaction in [false, true] {
        let trim = Trim::solve(&vehicle, tilt_reaction);
        let mixing = MixingMatrix::new(&vehicle, tilt_reaction);
        let weight = vehicle.mass_kg * vehicle.g_mps2;
        let produced = mixing.forward * mixing.trim;
        assert!((produced - Vector4::new(-weight * trim.roll_rad.cos(), 0.0, 0.0, 0.0)).amax() < 1e-14 * weight);
        let side = vehicle.kf * mixing.trim[0];
        assert!((side + weight * trim.roll_rad.sin()).abs() < 1e-14 * weight, "the roll carries the side force");
        assert!(mixing.deviation(&trim.actuation).amax() < 1e-14);
    }
}

#[test]
fn val_trim() {
    let r = &reference()["reference"];
    let vehicle = Parameters::default();
    let cases = [
        ("trim", vehicle, false),
        ("trim_g980", Parameters { g_mps2: 9.80, ..vehicle }, false),
        ("trim_tilt_reaction", vehicle, true),
    ];
    for (name, vehicle, tilt_reaction) in cases {
        let Trim { roll_rad, actuation } = Trim::solve(&vehicle, tilt_reaction);
        let expected = ["phi", "mu", "Om1", "Om2", "Om2"].map(|key| r[name][key].as_f64().unwrap());
        let [o1, o2, o3] = actuation.rotor_speed;
        for (got, expected) in [roll_rad, actuation.tilt_rad, o1, o2, o3].into_iter().zip(expected) {
            assert_close(&[got], &[expected]);
        }
    }
    // The digits of Table II are truncated.
    let table = Trim::solve(&vehicle, false).actuation.rotor_speed.map(f64::floor);
    assert_close(&table, &[1441.0, 1338.0, 1338.0]);
}

#[test]
fn val_mixing_matrix() {
    let r = &reference()["reference"];
    let paper = MixingMatrix::new(&Parameters::default(), false);
    let exact = MixingMatrix::new(&Parameters::default(), true);
    assert_close(paper.forward.as_slice(), matrix(&r["M"]).as_slice());
    assert_close(paper.inverse.as_slice(), matrix(&r["Minv"]).as_slice());
    assert_close(exact.forward.as_slice(), matrix(&r["M_tilt_reaction"]).as_slice());
    assert_close(paper.trim.as_slice(), vector(&r["trim"]["u"]).as_slice());
    assert_close(exact.trim.as_slice(), vector(&r["trim_tilt_reaction"]["u"]).as_slice());
    assert_close((paper.forward * paper.trim).as_slice(), vector(&r["trim"]["udelta"]).as_slice());
    assert!((exact.forward * exact.inverse - Matrix4::identity()).amax() < 1e-12);
}

#[test]
fn val_linear_model() {
    let r = &reference()["reference"];
    let vehicle = Parameters::default();
    let model = Continuous::hover(&vehicle, &Trim::solve(&vehicle, false));
    assert_close(model.a.as_slice(), matrix(&r["A"]).as_slice());
    assert_close(model.b.as_slice(), matrix(&r["B"]).as_slice());
    let plain = model.discretise(0.01);
    assert_close(plain.a.as_slice(), matrix(&r["Ad"]).as_slice());
    assert_close(plain.b.as_slice(), matrix(&r["Bd"]).as_slice());
    let lagged = model.discretise_with_lag(&Matrix4::from_diagonal_element(1.0 / 0.03), 0.01);
    assert_close(lagged.a.as_slice(), matrix(&r["Ad_lag30"]).as_slice());
    assert_close(lagged.b.as_slice(), matrix(&r["Bd_lag30"]).as_slice());
}

#[test]
fn two_short_samples_are_one_long_one() {
    let vehicle = Parameters::default();
    let model = Continuous::hover(&vehicle, &Trim::solve(&vehicle, false));
    let (mixing, actuation) = (MixingMatrix::new(&vehicle, false), Trim::solve(&vehicle, false).actuation);
    for lags_s in [[0.03, 0.03], [0.03, 0.3]] {
        let rates = lag_rates(lags_s, &mixing, &actuation);
        let [short, long] = [0.01, 0.02].map(|sample_s| model.discretise_with_lag(&rates, sample_s));
        assert!((&short.a * &short.a - &long.a).amax() < 1e-13);
        assert!((&short.a * &short.b + &short.b - &long.b).amax() < 1e-13);
    }
}

#[test]
fn clipping_maps_nan_and_infinity_into_the_limits() {
    let limits = ActuatorLimits::new(&Parameters::default(), 200.0, 2.0, 1.0);
    let wild = Actuation { rotor_speed: [f64::NAN, f64::INFINITY, -5.0], tilt_rad: f64::NAN };
    let clipped = limits.clip(&wild);
    assert_close(&clipped.rotor_speed, &[200.0, limits.rotor_speed_max[1], 200.0]);
    assert_close(&[clipped.tilt_rad + 1.0], &[1.0]);
    let left = limits.clip(&Actuation { tilt_rad: f64::NEG_INFINITY, ..wild });
    assert_close(&[left.tilt_rad], &[-1.0]);
}

#[test]
fn without_lag_only_the_rate_limits_hold_the_actuators_back() {
    let law = ActuatorLaw { rotor_lag_s: 0.0, servo_lag_s: 0.0, ..law() };
    let trim = Trim::solve(&Parameters::default(), false).actuation;
    let [o1, o2, o3] = trim.rotor_speed;
    let command = Actuation { rotor_speed: [o1 + 100.0, o2, o3 + 900.0], tilt_rad: trim.tilt_rad - 0.2 };
    let after = law.advance(&trim, &command, 0.01);
    assert_close(&after.rotor_speed, &[o1 + 100.0, o2, o3 + 200.0]);
    assert_close(&[after.tilt_rad], &[trim.tilt_rad - 0.105]);
}

pub(crate) fn actuation() -> impl Strategy<Value = Actuation> {
    (prop::array::uniform3(0.0..2600.0f64), -1.5..1.5f64)
        .prop_map(|(rotor_speed, tilt_rad)| Actuation { rotor_speed, tilt_rad })
}

fn flat(a: &Actuation) -> [f64; 4] {
    let [o1, o2, o3] = a.rotor_speed;
    [o1, o2, o3, a.tilt_rad]
}

proptest! {
    #[test]
    fn the_closed_form_follows_the_rate_law(
        start in actuation(), command in actuation(), dt_s in 0.001..0.2f64,
    ) {
        let law = law();
        let command = law.limits.clip(&command);
        let moved = |from: &Actuation, rate: &Actuation, h: f64| Actuation {
            rotor_speed: std::array::from_fn(|i| from.rotor_speed[i] + h * rate.rotor_speed[i]),
            tilt_rad: from.tilt_rad + h * rate.tilt_rad,
        };
        let steps = 4000;
        let h = dt_s / f64::from(steps);
        let small = (0..steps).fold(start, |s, _| {
            let middle = moved(&s, &law.rate(&s, &command), h / 2.0);
            moved(&s, &law.rate(&middle, &command), h)
        });
        let closed = law.advance(&start, &command, dt_s);
        for ((c, s), unit) in flat(&closed).into_iter().zip(flat(&small)).zip([1e3, 1e3, 1e3, 1.0]) {
            prop_assert!((c - s).abs() < 1e-5 * unit, "{c} in closed form, {s} in small steps");
        }
    }

    #[test]
    fn advances_in_sequence_add_up(start in actuation(), command in actuation(), a in 0.0..0.1f64, b in 0.0..0.1f64) {
        let law = law();
        let twice = law.advance(&law.advance(&start, &command, a), &command, b);
        let once = law.advance(&start, &command, a + b);
        for ((t, o), unit) in flat(&twice).into_iter().zip(flat(&once)).zip([1e3, 1e3, 1e3, 1.0]) {
            prop_assert!((t - o).abs() < 1e-11 * unit);
        }
    }

    #[test]
    fn clipping_twice_is_clipping_once(
        rotor_speed in prop::array::uniform3(prop::num::f64::ANY),
        tilt_rad in prop::num::f64::ANY,
    ) {
        let limits = ActuatorLimits::new(&Parameters::default(), 200.0, 2.0, 1.0);
        let once = limits.clip(&Actuation { rotor_speed, tilt_rad });
        prop_assert_eq!(limits.clip(&once), once);
        prop_assert!(once.tilt_rad.abs() <= 1.0);
        for (omega, max) in once.rotor_speed.iter().zip(limits.rotor_speed_max) {
            prop_assert!((200.0..=max).contains(omega));
        }
    }
}

#[test]
fn the_second_vehicle_has_the_mass_and_inertia_of_its_parts() {
    use std::f64::consts::TAU;
    let vehicle = Parameters::from(crate::Preset::TenInch);
    let (rho, d) = (1.225, 0.254_f64);
    assert!((vehicle.kf / (0.11 * rho * d.powi(4) / TAU.powi(2)) - 1.0).abs() < 0.01);
    assert!((vehicle.km / (0.045 * rho * d.powi(5) / TAU.powi(3)) - 1.0).abs() < 0.01);
    // Each part: mass [kg], place x, y, z [m], moments of inertia about its own centre [kg m2].
    let end = |angle_deg: f64, kg: f64| (kg, 0.25 * angle_deg.to_radians().cos(), 0.25 * angle_deg.to_radians().sin());
    let mut parts = vec![
        (
            0.35,
            [0.0; 3],
            [
                0.35 / 12.0 * (0.045_f64.powi(2) + 0.03_f64.powi(2)),
                0.35 / 12.0 * (0.14_f64.powi(2) + 0.03_f64.powi(2)),
                0.35 / 12.0 * (0.14_f64.powi(2) + 0.045_f64.powi(2)),
            ],
        ),
        (0.30, [0.0; 3], [0.30 * 0.07_f64.powi(2) / 4.0, 0.30 * 0.07_f64.powi(2) / 4.0, 0.30 * 0.07_f64.powi(2) / 2.0]),
    ];
    for (angle_deg, motor_kg) in [(0.0, 0.145), (120.0, 0.085), (-120.0, 0.085)] {
        let (kg, x, y) = end(angle_deg, motor_kg);
        parts.push((kg, [x, y, 0.0], [0.0; 3]));
        parts.push((0.03, [x, y, 0.1], [0.0; 3]));
        let rod = 0.045 * 0.25 * 0.25 / 12.0;
        let (sin, cos) = f64::sin_cos(angle_deg.to_radians());
        parts.push((0.045, [x / 2.0, y / 2.0, 0.0], [rod * sin * sin, rod * cos * cos, rod]));
    }
    let mass: f64 = parts.iter().map(|(kg, ..)| kg).sum();
    let inertia = |i: usize| -> f64 {
        parts
            .iter()
            .map(|(kg, at, own)| own[i] + kg * (0..3).filter(|j| *j != i).map(|j| at[j] * at[j]).sum::<f64>())
            .sum()
    };
    assert!((vehicle.mass_kg / mass - 1.0).abs() < 0.01, "{mass} kg");
    for (i, given) in [vehicle.ixx_kgm2, vehicle.iyy_kgm2, vehicle.izz_kgm2].into_iter().enumerate() {
        assert!((given / inertia(i) - 1.0).abs() < 0.02, "axis {i}: {} kg m2", inertia(i));
    }
    let hover = Trim::solve(&vehicle, true).actuation;
    let power_w: f64 = hover.rotor_speed.iter().map(|omega| vehicle.km * omega.powi(3)).sum();
    assert!((90.0..120.0).contains(&power_w), "{power_w} W at the shafts");
    assert!(hover.tilt_rad.to_degrees() < 5.0);
}
