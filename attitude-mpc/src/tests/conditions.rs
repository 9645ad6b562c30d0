//! Tests of the models at speed: their predictions, and the continuity of the plan from one model to the next.

use airframe::{FlightPoint, LevelFlight};
use nalgebra::{DMatrix, Rotation3, Vector3};
use settings::Model;

use super::*;
use crate::law::mpc::at_speed::FlightModel;

/// Scenario of a vehicle with the drag of `fast-legs`.
fn scenario(model: Model) -> Scenario {
    let mut scenario = fixture::constrained();
    scenario.plant.drag_linear_nspm = [0.2, 0.2, 0.1];
    scenario.plant.drag_quadratic_ns2pm2 = 0.02;
    scenario.attitude.mpc.model = model;
    scenario
}

/// Sample of level flight at the velocity `way_mps` ahead and to the right, and the reference to keep it.
fn level(scenario: &Scenario, way_mps: [f64; 2]) -> (State, Reference) {
    let level = LevelFlight::solve(&scenario.airframe, false, &scenario.plant.drag(), way_mps).unwrap();
    let stamp = Stamp { sequence: 1, ..Stamp::default() };
    let mut state = State { stamp, command_in_force: level.actuation.into(), ..State::default() };
    state.measured.velocity_mps = level.velocity_mps;
    state.measured.attitude_rad = [level.roll_rad, level.pitch_rad, 0.0];
    let attitude_rad = state.measured.attitude_rad;
    (state, Reference { stamp, w_mps: level.velocity_mps[2], attitude_rad, ..Reference::default() })
}

/// Demand of a new controller whose last demand held the level flight.
fn demand(scenario: &Scenario, (state, reference): &(State, Reference)) -> Vector4<f64> {
    let mut mpc = AttitudeMpc::new(scenario);
    mpc.memory.actuation = Actuation::from(state.command_in_force);
    mpc.memory.delay.outputs[0] = mpc.model.mixing.deviation(&mpc.memory.actuation).into();
    mpc.step(0, state, reference).demand.into()
}

#[test]
fn each_model_holds_level_flight_with_its_own_trim() {
    for way in [[10.0, 0.0], [-5.0, 15.0]] {
        let miss = |model| {
            let scenario = scenario(model);
            let sample = level(&scenario, way);
            let held = AttitudeMpc::new(&scenario).model.mixing.deviation(&Actuation::from(sample.0.command_in_force));
            (demand(&scenario, &sample) - held).amax()
        };
        let [hover, scheduled] = [Model::Hover, Model::Scheduled].map(miss);
        assert!(scheduled < 1e-6, "{way:?}: {scheduled:e}");
        assert!(hover > 0.1, "what hover takes for trim is not: {hover}");
    }
}

#[test]
fn a_plan_has_no_bump_at_a_condition() {
    let scenario = scenario(Model::Scheduled);
    let mut mpc = AttitudeMpc::new(&scenario);
    let (mut state, mut reference) = level(&scenario, [10.0, 0.0]);
    reference.attitude_rad[1] += 0.2;
    let (phi, theta) = (state.measured.attitude_rad[0], state.measured.attitude_rad[1]);
    let blank = mpc.memory;
    let mut demand = |ahead_mps: f64| {
        mpc.memory = blank;
        let way = Vector3::new(ahead_mps, 3.0, 0.0);
        state.measured.velocity_mps = (Rotation3::from_euler_angles(phi, theta, 0.0).inverse() * way).into();
        mpc.step(0, &state, &reference);
        mpc.plans().unwrap()[0].clone() // without the solver, which adds its own tolerance
    };
    for knot in [-10.0, 0.0, 5.0, 10.0, 15.0] {
        let jump = (demand(knot + 1e-9) - demand(knot - 1e-9)).amax();
        let change = (demand(knot - 1.0) - demand(knot)).amax();
        assert!(jump < 1e-7 && change > 1e-3, "at {knot} m/s: a jump of {jump:e} where 1 m/s is {change:e}");
    }
}

/// Pitching at speed does not change the climb, so the model in terms of the climb hardly depends on the velocity.
#[test]
fn a_change_of_pitch_at_constant_climb_costs_no_climb() {
    let scenario = scenario(Model::Scheduled);
    let level = LevelFlight::solve(&scenario.airframe, false, &scenario.plant.drag(), [15.0, 0.0]).unwrap();
    let flight = FlightModel::new(&scenario, &FlightPoint::from(&level));
    let q = DMatrix::from_diagonal(&DVector::from_fn(11, |i, _| if i == 0 { 100.0 } else { 0.0 }));
    let mut leaned = q.clone();
    flight.lean_on(&mut leaned);
    let mut pitched = DVector::zeros(11);
    (pitched[2], pitched[0]) = (0.1, -0.1 * flight.lean[1]);
    assert!((&pitched.transpose() * &leaned * &pitched)[0].abs() < 1e-9);
    assert!((&pitched.transpose() * &q * &pitched)[0] > 100.0, "as w it would be a miss of over 1 m/s");

    let by_pitch_rate = |lean: f64| flight.model.a[(0, 5)] + lean * flight.model.a[(2, 5)];
    assert!(by_pitch_rate(0.0) > 0.1 && by_pitch_rate(flight.lean[1]).abs() < 0.01, "w follows q, the climb does not");
}

/// The solver uses the Hessian of hover at every speed. At 15 m/s the cost of a plan is 0.61 to 2.0 times its cost at
/// hover.
#[test]
fn the_hessian_of_hover_serves_at_speed() {
    let scenario = scenario(Model::Scheduled);
    let hover = Condensed::new(&PredictionModel::new(&scenario), &scenario).unwrap().hessian;
    let level = LevelFlight::solve(&scenario.airframe, false, &scenario.plant.drag(), [15.0, 0.0]).unwrap();
    let flight = FlightModel::new(&scenario, &FlightPoint::from(&level));
    let fast = Condensed::at_speed(&flight, &scenario).unwrap().hessian;
    let (worst, best) = hover
        .clone()
        .cholesky()
        .map(|factor| {
            let l = factor.l().try_inverse().unwrap();
            let shares = (&l * &fast * l.transpose()).symmetric_eigenvalues();
            (shares.max(), shares.min())
        })
        .unwrap();
    assert!((worst - 2.0).abs() < 0.05 && (best - 0.61).abs() < 0.005, "{best} to {worst}");
}

/// Pitching at u = 12 m/s changes w at the rate `q u` under any law; the hover model takes this for a force of 2.6 N.
#[test]
fn pitching_at_speed_is_no_force() {
    let mistaken_n = |law, model| {
        let mut scenario = scenario(model);
        (scenario.attitude.law, scenario.attitude.disturbance_gain) = (law, 1.0);
        let mut mpc = AttitudeMpc::new(&scenario);
        let (mut state, mut reference) = super::hover(&mpc, 0);
        (state.measured.velocity_mps[0], state.measured.rates_radps[1]) = (12.0, 0.2);
        mpc.step(0, &state, &reference);
        // Moves the vehicle on by one sample, by (11) and (8) with the command of trim.
        (state.stamp.tick, reference.stamp.tick) = (1, 1);
        state.measured.velocity_mps[2] += 0.2 * 12.0 * 0.01;
        state.measured.attitude_rad[1] += 0.2 * 0.01 * mpc.model.trim.roll_rad.cos();
        mpc.step(1, &state, &reference).disturbance[0]
    };
    for law in [Law::Mpc, Law::Lqr] {
        let [hover, coupled] = [Model::Hover, Model::Coupled].map(|model| mistaken_n(law, model));
        let force_n = Scenario::default().airframe.mass_kg * 0.2 * 12.0;
        assert!((hover - force_n).abs() < 1e-3, "{law:?}: {hover} N");
        assert!(coupled.abs() < 1e-3, "{law:?}: {coupled} N");
    }
}

#[test]
fn a_controller_of_another_model_continues_the_flight() {
    let models = [Model::Hover, Model::Coupled, Model::Scheduled];
    for from in models {
        let mut before = AttitudeMpc::new(&scenario(from));
        let (state, reference) = level(&scenario(from), [5.0, 0.0]);
        before.step(0, &state, &reference);
        for to in models {
            let mut after = AttitudeMpc::new(&scenario(to));
            assert!(after.restore(&before.snapshot()));
            assert_eq!(after.memory, before.memory);
        }
    }
}
