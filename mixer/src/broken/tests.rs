//! Tests of the forces and moments that a broken vehicle has left, against a search over the actuators' inputs; whole
//! flights are in `tests/fallback.rs`.

use airframe::Preset;
use airframe::mixing::intermediate;
use nalgebra::Vector4;
use proptest::prelude::*;

use super::*;

fn parts(preset: Preset) -> (MixingMatrix, ActuatorLimits) {
    let vehicle = Parameters::from(preset);
    (MixingMatrix::new(&vehicle, false), ActuatorLimits::new(&vehicle, 100.0, 1.5, f64::to_radians(45.0)))
}

/// Lift, lon and lat of rotor speeds at a tilt.
fn given(mixing: &MixingMatrix, rotor_speed: [f64; 3], tilt_rad: f64) -> Vector3<f64> {
    let [col, lon, lat, _]: [f64; 4] = (mixing.forward * intermediate(&Actuation { rotor_speed, tilt_rad })).into();
    Vector3::new(-col, lon, lat)
}

fn is_inside(limits: &ActuatorLimits, rotor_speed: &[f64; 3]) -> bool {
    (0..3).all(|i| {
        rotor_speed[i] >= limits.rotor_speed_min * (1.0 - 1e-9)
            && rotor_speed[i] <= limits.rotor_speed_max[i] * (1.0 + 1e-9)
    })
}

proptest! {
    #[test]
    fn attainable_demands_are_allocated_exactly(
        share in prop::array::uniform3(0.0..=1.0_f64), tilt_deg in -44.0..=44.0_f64, ten in any::<bool>(),
    ) {
        let (mixing, limits) = parts(if ten { Preset::TenInch } else { Preset::Paper });
        let speeds: [f64; 3] = std::array::from_fn(|i| {
            limits.rotor_speed_min + share[i] * (limits.rotor_speed_max[i] - limits.rotor_speed_min)
        });
        let tilt_rad = tilt_deg.to_radians();
        let wanted = given(&mixing, speeds, tilt_rad);
        let found = Remaining::new(&mixing, &limits, tilt_rad).unwrap().allocate(wanted[0], wanted[1], wanted[2]);
        prop_assert!((given(&mixing, found, tilt_rad) - wanted).amax() < 1e-9, "{found:?} {speeds:?}");
    }

    #[test]
    fn moments_are_whole_if_any_lift_leaves_them_whole_and_else_keep_their_direction(
        lift_n in -50.0..=80.0_f64, lon in -6.0..=6.0_f64, lat in -6.0..=6.0_f64, tilt_deg in -44.0..=44.0_f64,
    ) {
        let (mixing, limits) = parts(Preset::Paper);
        let tilt_rad = tilt_deg.to_radians();
        let found = Remaining::new(&mixing, &limits, tilt_rad).unwrap().allocate(lift_n, lon, lat);
        prop_assert!(is_inside(&limits, &found));
        let got = given(&mixing, found, tilt_rad).fixed_rows::<2>(1).into_owned();
        // Searches a grid for a lift with which the actuators give a share of the moments. The four inputs are
        // allocated with the yawing moment that turns rotor 1 to the angle of the servo.
        let (sin, cos) = tilt_rad.sin_cos();
        let reaches = |share: f64| (0..=3000).any(|step| {
            let inputs = |ped: f64| {
                mixing.inverse * Vector4::new(-0.02 * f64::from(step), share * lon, share * lat, ped)
            };
            let (at_0, at_1) = (inputs(0.0), inputs(1.0));
            let across = |u: &Vector4<f64>| u[0] * cos - u[1] * sin;
            let u = inputs(across(&at_0) / (across(&at_0) - across(&at_1)));
            let squares = [u[0] * sin + u[1] * cos, u[2], u[3]];
            (0..3).all(|i| {
                squares[i] >= limits.rotor_speed_min.powi(2) && squares[i] <= limits.rotor_speed_max[i].powi(2)
            })
        });
        let wanted = nalgebra::Vector2::new(lon, lat);
        let share = got.dot(&wanted) / wanted.norm_squared();
        prop_assert!((got - wanted * share).amax() < 1e-9, "another direction: {got}");
        prop_assert!(share <= 1.0 + 1e-9);
        prop_assert!(share > 1.0 - 1e-9 || !reaches(share + 0.02), "more than {share} of the moments is left");
    }
}

#[test]
fn without_a_rotor_no_lift_is_free_of_pitch_and_roll() {
    for preset in [Preset::Paper, Preset::TenInch] {
        let (mixing, limits) = parts(preset);
        let vehicle = Parameters::from(preset);
        let weight_n = vehicle.mass_kg * vehicle.g_mps2;
        for dead in 0..3 {
            let mut least_nm = f64::INFINITY;
            for step in 0..21_u32.pow(3) {
                let [one, two, tilt] = [step % 21, step / 21 % 21, step / 441].map(|digit| f64::from(digit) / 20.0);
                let mut rotor_speed = limits.rotor_speed_max;
                rotor_speed[dead] = 0.0;
                rotor_speed[(dead + 1) % 3] *= one;
                rotor_speed[(dead + 2) % 3] *= two;
                let tilt_rad = (2.0 * tilt - 1.0) * limits.tilt_max_rad;
                let [lift_n, lon, lat]: [f64; 3] = given(&mixing, rotor_speed, tilt_rad).into();
                if lift_n > 0.5 * weight_n {
                    least_nm = least_nm.min(lon.hypot(lat));
                }
            }
            // The line between two rotors passes the centre of mass at no less than 0.1 m.
            assert!(least_nm > 0.1 * 0.5 * weight_n, "rotor {dead}: {least_nm} N m");
        }
    }
}

#[test]
fn a_servo_stuck_beyond_a_quarter_turn_leaves_no_set() {
    let (mixing, limits) = parts(Preset::Paper);
    assert!(Remaining::new(&mixing, &limits, 1.7).is_none());
}

#[test]
fn numbers_that_overflow_give_no_command() {
    let scenario = Scenario::default();
    let broken = Broken::new(&scenario, MixingMatrix::new(&scenario.airframe, false), &scenario.actuator_law());
    let measured = Kinematics { rates_radps: [1e300, -1e300, 1e300], ..Kinematics::default() };
    let position = Trim::solve(&scenario.airframe, false).actuation;
    for part in [BrokenPart::Rotor(0), BrokenPart::Rotor(1), BrokenPart::Tilt(0.3)] {
        let command = broken.command(part, &measured, &position, std::iter::empty());
        assert!(command.is_none_or(|command| command.rotor_speed.iter().all(|speed| speed.is_finite())));
    }
}

#[test]
fn only_a_vehicle_that_reaches_the_spin_soon_descends_without_rotor_1() {
    for (preset, descends) in [(Preset::Paper, true), (Preset::TenInch, false)] {
        let airframe = Parameters::from(preset);
        let scenario = Scenario { airframe, ..Scenario::default() };
        let broken = Broken::new(&scenario, MixingMatrix::new(&airframe, false), &scenario.actuator_law());
        assert_eq!(broken.descends_without(BrokenPart::Rotor(0)), descends);
        assert!(!broken.descends_without(BrokenPart::Rotor(1)) && broken.descends_without(BrokenPart::Tilt(0.3)));
    }
}
