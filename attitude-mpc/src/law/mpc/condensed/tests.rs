//! Tests of the condensed problem against the plain sum (4), and against the independent simulator.

use nalgebra::Vector4;
use settings::{Profile, Scenario};

use super::*;
use crate::fixture;

fn condensed(scenario: &Scenario) -> (PredictionModel, Condensed) {
    let model = PredictionModel::new(scenario);
    let condensed = Condensed::new(&model, scenario).unwrap();
    (model, condensed)
}

/// Cost (4) as printed, by running the model; `changes` are the changes of the reference, or empty.
fn cost(
    model: &PredictionModel,
    scenario: &Scenario,
    given: &DVector<f64>,
    changes: &DVector<f64>,
    plan: &DVector<f64>,
) -> f64 {
    let (n, weights) = (model.states(), &scenario.attitude.mpc);
    let (q, r) = stage_weights(n, weights);
    let p = terminal_weight(model, weights, &q, &r).unwrap();
    let d = Vector4::from_column_slice(given.rows(n + STATES, INPUTS).as_slice());
    let mut last = Vector4::from_column_slice(given.rows(n + STATES + INPUTS, INPUTS).as_slice());
    let r2 = DMatrix::from_diagonal(&DVector::from_row_slice(&weights.r_rate));
    let mut x = given.rows(0, n).into_owned();
    let mut next = x.clone();
    let mut sum = 0.0;
    for k in 0..scenario.np() {
        let mut target = DVector::zeros(n);
        target.rows_mut(0, STATES).copy_from(&given.rows(n, STATES));
        if !changes.is_empty() {
            let mut reference = target.rows_mut(0, STATES);
            reference += changes.rows(STATES * k, STATES);
        }
        let mut held = -d;
        if scenario.attitude.disturbance_gain > 0.0 {
            held[0] += 1.1 * 9.81 * model.trim.roll_rad.sin() * target[1]; // m w' = -m g sin(phi_trim) phi + col
        }
        if model.has_lag() {
            target.rows_mut(STATES, INPUTS).copy_from(&held);
        }
        let newest = INPUTS * k.min(scenario.nu() - 1);
        let u = Vector4::from_column_slice(plan.rows(newest, INPUTS).as_slice());
        model.predict(&x, &u, &d, &mut next);
        x.copy_from(&next);
        let miss = &x - &target;
        sum += (miss.transpose() * if k + 1 < scenario.np() { &q } else { &p } * miss)[0];
        if k < scenario.nu() {
            sum += ((u - held).transpose() * &r * (u - held))[0] + ((u - last).transpose() * &r2 * (u - last))[0];
            last = u;
        }
    }
    sum
}

#[test]
fn the_gain_minimises_the_printed_cost() {
    let r_rate = [0.2, 100.0, 30.0, 50.0];
    let settings = [
        (Profile::Paper, 0.1, 0.05, Terminal::Zero, 0.0, [0.0; 4]),
        (Profile::Robust, 0.2, 0.05, Terminal::Dare, 0.0, r_rate),
        (Profile::Robust, 0.2, 0.05, Terminal::Dare, 0.1, [0.0; 4]),
        (Profile::Robust, 0.03, 0.03, Terminal::Q, 0.0, r_rate),
        (Profile::Paper, 0.01, 0.01, Terminal::Q, 0.1, r_rate),
    ];
    for (setting, preview_s) in settings.into_iter().flat_map(|setting| [(setting, 0.0), (setting, 0.4)]) {
        let (profile, prediction_horizon_s, control_horizon_s, terminal, disturbance_gain, r_rate) = setting;
        let mut scenario = Scenario::from(profile);
        scenario.attitude.disturbance_gain = disturbance_gain;
        scenario.attitude.mpc =
            MpcSettings { prediction_horizon_s, control_horizon_s, terminal, r_rate, ..scenario.attitude.mpc };
        scenario.guidance.preview_s = preview_s;
        let (model, condensed) = condensed(&scenario);
        let given = DVector::from_fn(model.states() + GIVEN, |i, _| (1.0 + i as f64).sin() * 0.3);
        let changes = DVector::from_fn(change_count(&scenario), |i, _| (2.0 + 3.0 * i as f64).cos() * 0.3);
        let mut plan = DVector::zeros(INPUTS * scenario.nu());
        condensed.gain.add_plan(1.0, &given, &changes, plan.as_view_mut());
        let least = cost(&model, &scenario, &given, &changes, &plan);
        for i in 0..plan.len() {
            // At a distance e from the minimum, either way, a quadratic with Hessian 2 H has grown by H_ii e^2.
            let step = (1e-2 * least / condensed.hessian[(i, i)]).sqrt();
            for e in [step, -step] {
                let mut other = plan.clone();
                other[i] += e;
                let growth = cost(&model, &scenario, &given, &changes, &other) - least;
                let expected = condensed.hessian[(i, i)] * e * e;
                assert!((growth / expected - 1.0).abs() < 1e-6, "{profile:?} {i}: {growth} is not {expected}");
            }
        }
    }
}

#[test]
fn val_first_move_gains() {
    // The independent simulator has u = -K x + Kr r; with the lag, its r includes the lag states, and ours does not.
    for (scenario, k, kr) in [(Scenario::from(Profile::Paper), "K_B0", "Kr_B0"), (fixture::with_lag(), "K_B2", "Kr_B2")]
    {
        let (model, condensed) = condensed(&scenario);
        let n = model.states();
        let by = |from: usize, columns: usize| condensed.gain.given.view((0, from), (INPUTS, columns)).into_owned();
        fixture::assert_matrix(&-by(0, n), &fixture::matrix(k));
        fixture::assert_matrix(&by(n, STATES), &fixture::matrix(kr).columns(0, STATES).into_owned());
    }
}

#[test]
fn the_disturbance_is_cancelled_at_rest() {
    for profile in [Profile::Paper, Profile::Robust] {
        let (model, condensed) = condensed(&Scenario::from(profile));
        let n = model.states();
        let d = Vector4::new(1.0, -0.2, 0.1, 0.3);
        let mut given = DVector::zeros(n + GIVEN);
        if model.has_lag() {
            given.rows_mut(STATES, INPUTS).copy_from(&-d); // the actuators already cancel `d`
        }
        given.rows_mut(n + STATES, INPUTS).copy_from(&d);
        for u in (&condensed.gain.given * given).as_slice().chunks_exact(INPUTS) {
            assert!((Vector4::from_column_slice(u) + d).amax() < 1e-9, "{profile:?}");
        }
    }
}

#[test]
fn the_longest_horizon_is_still_finite() {
    let mut scenario = Scenario::default();
    (scenario.attitude.mpc.prediction_horizon_s, scenario.attitude.mpc.control_horizon_s) = (2.0, 0.2);
    let (_, condensed) = condensed(&scenario);
    assert!(condensed.gain.given.iter().all(|k| k.is_finite()));
}

#[test]
fn weights_that_rounding_makes_singular_are_refused() {
    let share = |profile: Profile, set: fn(&mut MpcSettings)| {
        let mut scenario = Scenario::from(profile);
        set(&mut scenario.attitude.mpc);
        let hessian = Condensed::new(&PredictionModel::new(&scenario), &scenario).ok()?.hessian;
        let lower = hessian.clone().cholesky()?.l();
        lower.diagonal().iter().zip(&hessian.diagonal()).map(|(left, whole)| left * left / whole).reduce(f64::min)
    };
    for profile in [Profile::Paper, Profile::Robust] {
        assert!(share(profile, |_| {}) > Some(0.05), "as shipped");
        let most = share(profile, |mpc| (mpc.prediction_horizon_s, mpc.control_horizon_s) = (2.0, 2.0));
        assert!(most > Some(4e-4), "with as many moves as there may be");
        assert!(share(profile, |mpc| mpc.r = [1e-12; 4]) > Some(1e-5));
        // Here two moves have almost the same effect on the heading.
        let alike = share(profile, |mpc| (mpc.q, mpc.r) = ([0.0, 0.0, 0.0, 1e12, 0.0, 0.0, 0.0], [1e-12; 4]));
        assert_eq!(alike, None);
    }
}

#[test]
fn val_terminal_weight_with_lag() {
    let scenario = fixture::with_lag();
    let model = PredictionModel::new(&scenario);
    let mut q = DMatrix::identity(11, 11) * 1e-9;
    scenario.attitude.mpc.q.iter().enumerate().for_each(|(i, weight)| q[(i, i)] += weight);
    let r = DMatrix::from_diagonal(&DVector::from_row_slice(&scenario.attitude.mpc.r));
    let s = riccati::solve(&model.a, &model.b, &q, &r).unwrap();
    fixture::assert_matrix(&s, &fixture::matrix("S_dare_B2"));

    let (bs, inner) = (model.b.transpose() * &s, &r + model.b.transpose() * &s * &model.b);
    let k = inner.cholesky().unwrap().solve(&(bs * &model.a));
    let residual = model.a.transpose() * &s * (&model.a - &model.b * k) + q - &s;
    assert!(residual.amax() < 1e-10 * s.amax(), "residual {:e}", residual.amax());
}
