//! Tests of the rungs, of directions, and of the loop with the actuators' lag.

use airframe::Trim;
use contract::actuation::Actuation;
use nalgebra::{Matrix4, Vector3};
use proptest::prelude::*;
use settings::Scenario;

use super::*;

#[test]
fn every_pair_of_ages_has_its_rung() {
    let ms = |ms: u64| ms * 1_000_000;
    for (demand, state, rung) in [
        (0, u64::MAX, Rung::Used),
        (ms(15) - 1, 0, Rung::Used),
        (ms(15), u64::MAX, Rung::Held),
        (ms(30) - 1, 0, Rung::Held),
        (ms(30), ms(50) - 1, Rung::Levelled),
        (ms(2000) - 1, 0, Rung::Levelled),
        (ms(2000), 0, Rung::Descending),
        (u64::MAX, ms(50) - 1, Rung::Descending),
        (ms(30), ms(50), Rung::TrimOnly),
        (u64::MAX, ms(500) - 1, Rung::TrimOnly),
        (ms(30), ms(500), Rung::Cut),
        (u64::MAX, u64::MAX, Rung::Cut),
    ] {
        assert_eq!(Rung::of(demand, state), rung, "{demand} {state}");
    }
}

fn level() -> LevellingLaw {
    let vehicle = Parameters::default();
    LevellingLaw::new(&vehicle, Trim::solve(&vehicle, false).roll_rad)
}

/// Demand at trim with a change to the motion.
fn demand(change: fn(&mut Kinematics), descending: bool) -> Vector4<f64> {
    let level = level();
    let mut measured = Kinematics { attitude_rad: [level.roll_trim_rad, 0.0, 2.0], ..Kinematics::default() };
    change(&mut measured);
    level.demand(&measured, descending)
}

#[test]
fn every_error_is_pushed_back() {
    assert_eq!(demand(|_| (), false), Vector4::zeros());
    let [col, lon, lat, ped] = [0, 1, 2, 3];
    assert!(demand(|_| (), true)[col] > 0.0, "less thrust");
    for (axis, change) in [
        (col, (|m| m.velocity_mps[2] += 1.0) as fn(&mut Kinematics)),
        (lon, |m| m.attitude_rad[1] += 0.1),
        (lon, |m| m.rates_radps[1] += 0.1),
        (lat, |m| m.attitude_rad[0] += 0.1),
        (lat, |m| m.rates_radps[0] += 0.1),
        (ped, |m| m.rates_radps[2] += 0.1),
    ] {
        let demand = demand(change, false);
        assert!(demand[axis] < 0.0 && demand.iter().filter(|u| **u != 0.0).count() == 1, "{demand}");
    }
    let rising_nose_up = demand(
        |m| {
            (m.velocity_mps[0], m.attitude_rad[1]) = (5.0, 0.5);
        },
        false,
    );
    assert!(rising_nose_up[col] > 0.0, "forward with the nose up is climbing");
}

/// Norm of (roll, rate, moment) 20 s after a roll of 1, with a lagging moment and a law that sees the state of `delay`
/// samples ago.
fn growth(rate_hz: f64, lag_s: f64, delay: usize) -> f64 {
    let h = 1.0 / rate_hz;
    let e = (-h / lag_s).exp();
    // phi' = p, p' = m, m' = (u - m) / lag, exactly discretised for a held u.
    let (pm, pu) = (lag_s * (1.0 - e), h - lag_s * (1.0 - e));
    let (fm, fu) = (lag_s * (h - pm), h * h / 2.0 - lag_s * (h - pm));
    #[rustfmt::skip]
    let step = Matrix4::new(
        1.0, h,   fm,  fu,
        0.0, 1.0, pm,  pu,
        0.0, 0.0, e,   1.0 - e,
        0.0, 0.0, 0.0, 0.0,
    );
    let a = BANDWIDTH_RADPS;
    let mut past = std::collections::VecDeque::from(vec![Vector3::new(1.0, 0.0, 0.0); delay + 1]);
    let ticks = (20.0 * rate_hz) as usize;
    for _ in 0..ticks {
        let seen = past.pop_front().unwrap();
        let now = past.back().copied().unwrap_or(seen);
        let u = -a * a * seen[0] - 2.0 * a * seen[1];
        past.push_back((step * Vector4::new(now[0], now[1], now[2], u)).xyz());
    }
    past.back().unwrap().norm()
}

#[test]
fn the_loop_is_stable_at_every_rate_with_lag_and_an_old_state() {
    for rate_hz in [50.0, 64.0, 80.0, 100.0, 250.0, 500.0, 1000.0, 2000.0] {
        for old_s in [0.0, 0.01, 0.04] {
            let delay = (old_s * rate_hz) as usize;
            let left = growth(rate_hz, 0.03, delay);
            assert!(left < 1e-2, "{left:e} of 1 is left after 20 s at {rate_hz} Hz with {delay} samples of delay");
        }
    }
}

proptest! {
    #[test]
    fn the_demand_depends_neither_on_place_nor_on_heading(
        place in prop::array::uniform3(-400.0..400.0_f64), psi in -20.0..20.0_f64, motion in prop::array::uniform8(-1.0..1.0_f64),
    ) {
        let [phi, theta, u, v, w, p, q, r] = motion;
        let of = |position_m, psi| {
            level().demand(
                &Kinematics {
                    position_m,
                    velocity_mps: [u, v, w],
                    attitude_rad: [phi, theta, psi],
                    rates_radps: [p, q, r],
                },
                false,
            )
        };
        prop_assert_eq!(of(place, psi), of([0.0; 3], 0.0));
    }

    #[test]
    fn at_hover_the_demand_is_inside_what_the_actuators_can_do(tilt in -0.4..0.4_f64, rate in -1.0..1.0_f64) {
        let scenario = Scenario::default();
        let level = level();
        let measured = Kinematics {
            attitude_rad: [level.roll_trim_rad + tilt, -tilt, 0.0],
            rates_radps: [rate, -rate, 0.0],
            ..Kinematics::default()
        };
        let mixing = airframe::MixingMatrix::new(&scenario.airframe, false);
        let (wanted, _): (Actuation, bool) = crate::allocation::allocate(&mixing, &level.demand(&measured, false));
        prop_assert_eq!(scenario.limits().clip(&wanted), wanted);
    }
}
