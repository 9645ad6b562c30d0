//! Tests of the whole controller: directions, fallbacks, properties, and the problems of the independent simulator.

use airframe::envelope::Envelope;
use airframe::linear::STATES;
use contract::message::Stamp;
use proptest::prelude::*;
use runtime::node::Core;
use settings::{Constraints, FaultKind, Law, Profile, SolverName, StateConstraints};

use super::*;
use crate::fixture::{self, Case};
use crate::law::mpc::condensed::Condensed;

mod conditions;
mod delay;
mod silence;

/// Sample at hover trim, and the reference to stay there.
pub fn hover(mpc: &AttitudeMpc, tick: u64) -> (State, Reference) {
    let stamp = Stamp { tick, sequence: 1, ..Stamp::default() };
    let mut state = State { stamp, ..State::default() };
    state.measured.attitude_rad[0] = mpc.model.trim.roll_rad;
    state.command_in_force = mpc.model.trim.actuation.into();
    let reference = Reference { stamp: state.stamp, attitude_rad: state.measured.attitude_rad, ..Reference::default() };
    (state, reference)
}

/// Hover with a heading step that the actuators cannot follow at once.
pub fn violent_turn(mpc: &AttitudeMpc, tick: u64) -> (State, Reference) {
    let (state, mut reference) = hover(mpc, tick);
    reference.attitude_rad[2] = 1.6;
    (state, reference)
}

/// Violation of the exact set of a scenario by a demand.
pub fn demand_violation(scenario: &Scenario, demand: [f64; 4]) -> f64 {
    Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits()).demand_violation(&demand.into())
}

const LAWS: [Law; 5] = [Law::Mpc, Law::Lqr, Law::Pid, Law::Geometric, Law::Indi];

#[test]
fn at_hover_the_demand_is_zero() {
    for (profile, law) in
        [Profile::Paper, Profile::Robust].into_iter().flat_map(|profile| LAWS.map(|law| (profile, law)))
    {
        let mut scenario = Scenario::from(profile);
        scenario.attitude.law = law;
        let mut mpc = AttitudeMpc::new(&scenario);
        for tick in 0..10 {
            let (state, reference) = hover(&mpc, tick);
            let controls = mpc.step(state.stamp.tick, &state, &reference);
            assert!(controls.demand.iter().all(|u| u.abs() < 1e-9), "{:?}", controls.demand);
            assert_eq!((controls.status, controls.active_constraints), (SolveStatus::Explicit as u64, 0));
        }
    }
}

#[test]
fn each_reference_pushes_its_own_way() {
    for law in LAWS {
        check_directions(law);
    }
}

#[test]
fn a_pid_whose_demand_is_not_followed_demands_less() {
    let mut scenario = Scenario::from(Profile::Robust);
    (scenario.attitude.law, scenario.attitude.mpc.constraints) = (Law::Pid, Constraints::None);
    let mut mpc = AttitudeMpc::new(&scenario);
    let mut yawing = |tick| {
        let (state, reference) = violent_turn(&mpc, tick); // the command in force stays at trim
        mpc.step(tick, &state, &reference).demand[3]
    };
    let demands: Vec<f64> = (0..10).map(&mut yawing).collect();
    assert!(demands[0] > 0.0 && demands.is_sorted_by(|before, after| before > after), "{demands:?}");
}

fn check_directions(law: Law) {
    let mut scenario = Scenario::from(Profile::Robust);
    scenario.attitude.mpc.constraints = Constraints::None;
    scenario.attitude.law = law;
    let demand = |change: fn(&mut Reference)| {
        let mut mpc = AttitudeMpc::new(&scenario);
        let (state, mut reference) = hover(&mpc, 0);
        change(&mut reference);
        mpc.step(state.stamp.tick, &state, &reference).demand
    };
    let [col, lon, lat, ped] = [0, 1, 2, 3];
    assert!(demand(|r| r.w_mps = -1.0)[col] < -0.1, "climbing needs a force up");
    assert!(demand(|r| r.attitude_rad[0] += 0.1)[lat] > 0.01, "rolling right");
    assert!(demand(|r| r.attitude_rad[1] = 0.1)[lon] > 0.01, "nose up");
    assert!(demand(|r| r.attitude_rad[2] = 0.1)[ped] > 0.01, "nose right");
}

#[test]
fn val_problems_of_the_independent_simulator() {
    let cases = fixture::cases();
    assert!(cases.iter().any(|case| case.active) && cases.iter().any(|case| !case.active));
    let solvers = [SolverName::Clarabel, SolverName::ActiveSet];
    for (case, solver) in cases.iter().flat_map(|case| solvers.map(|solver| (case, solver))) {
        let Case { name, scenario, state, reference, previous, plan, objective, active, tolerance } = case;
        let mut scenario = scenario.clone();
        scenario.attitude.mpc.time_limit_ms = 0.0;
        scenario.attitude.mpc.solver = solver;
        let mut mpc = AttitudeMpc::new(&scenario);
        mpc.memory.delay.outputs[0] = *previous;
        let controls = mpc.step(0, state, reference);
        let status = if *active { SolveStatus::Solved } else { SolveStatus::Explicit };
        assert_eq!(controls.status, status as u64, "{name}");
        assert_eq!(controls.active_constraints > 0, *active, "{name}");

        let hessian = Condensed::new(&mpc.model, &scenario).unwrap().hessian;
        let [unconstrained, followed] = mpc.plans().unwrap();
        let ours = if *active { followed } else { unconstrained };
        let value = (&hessian * (ours * 0.5 - unconstrained)).dot(ours);
        let miss = ((value - objective) / objective).abs();
        assert!(miss < tolerance.objective, "{name}: objective {miss:e} off");
        for axis in 0..4 {
            let miss = (controls.demand[axis] - plan[axis]).abs();
            assert!(miss < tolerance.first_move, "{name}: first move {axis} {miss:e} off");
        }
        if *active {
            assert!(demand_violation(&scenario, controls.demand) <= 0.0, "{name}");
        }
    }
}

#[test]
fn a_bad_input_repeats_the_demand_and_changes_nothing_else() {
    let mut mpc = AttitudeMpc::new(&Scenario::default());
    let (state, mut reference) = hover(&mpc, 0);
    reference.w_mps = -0.5;
    let good = mpc.step(state.stamp.tick, &state, &reference);
    let memory = mpc.memory;
    let spoil: [fn(&mut State, &mut Reference); 8] = [
        |state, _| state.measured.velocity_mps[2] = f64::NAN,
        |state, _| state.measured.attitude_rad[1] = f64::INFINITY,
        |state, _| state.measured.rates_radps[2] = f64::NAN,
        |state, _| state.command_in_force.rotor_speed[0] = f64::NAN,
        |state, _| state.command_in_force.tilt_rad = f64::NEG_INFINITY,
        |_, reference| reference.w_mps = f64::NAN,
        |_, reference| reference.attitude_rad[0] = f64::NAN,
        |state, _| state.measured.velocity_mps[2] = f64::MAX, // a finite speed whose plan overflows
    ];
    for spoil in spoil {
        let (mut state, mut reference) = hover(&mpc, 1);
        spoil(&mut state, &mut reference);
        let bad = mpc.step(state.stamp.tick, &state, &reference);
        assert_eq!((bad.status, bad.demand), (SolveStatus::BadInput as u64, good.demand));
        assert_eq!(mpc.memory, memory);
    }
    let (state, reference) = hover(&mpc, 1);
    assert_eq!(mpc.step(state.stamp.tick, &state, &reference).status, SolveStatus::Explicit as u64);
}

#[test]
fn delay_compensation_plans_from_the_next_sample() {
    let start = |compensate: bool| {
        let mut scenario = Scenario::default();
        scenario.attitude.delay_compensation = DelayCompensation::Sample(compensate);
        let mut mpc = AttitudeMpc::new(&scenario);
        mpc.memory.delay.outputs[0] = [-1.0, 0.1, 0.05, -0.02];
        let (mut state, reference) = hover(&mpc, 0);
        state.measured.rates_radps = [0.1, -0.2, 0.3];
        let demand = mpc.memory.demand();
        mpc.step(0, &state, &reference);
        let mut next = mpc.work.x.clone();
        mpc.model.predict(&mpc.work.x, &demand, &mpc.memory.disturbance, &mut next);
        [mpc.work.start, mpc.work.x, next]
    };
    let [[compensated, _, next], [plain, x, _]] = [start(true), start(false)];
    assert!((&next - &x).amax() > 1e-3);
    assert_eq!([compensated, plain], [next, x]);
}

#[test]
fn the_estimate_waits_for_two_samples_in_a_row() {
    let mut scenario = Scenario::default();
    scenario.attitude.disturbance_gain = 0.5;
    let mut mpc = AttitudeMpc::new(&scenario);
    for (tick, learns) in [(7, false), (9, false), (9, false), (10, true)] {
        let before = mpc.memory.disturbance;
        let (mut state, reference) = hover(&mpc, tick);
        state.measured.velocity_mps[2] = 0.1 * tick as f64; // the vehicle sinks ever faster at the command of hover
        let controls = mpc.step(state.stamp.tick, &state, &reference);
        assert_eq!(mpc.memory.disturbance != before, learns, "sample {tick}");
        assert_eq!(controls.disturbance[0] > 0.1, learns, "sample {tick}");
    }
}

/// Flies at hover for the `ticks`, with `command` in force.
fn fly(mpc: &mut AttitudeMpc, ticks: std::ops::Range<u64>, command: Actuation) {
    for tick in ticks {
        let (mut state, reference) = hover(mpc, tick);
        state.command_in_force = command.into();
        mpc.step(tick, &state, &reference);
    }
}

#[test]
fn after_standing_on_the_ground_the_estimate_begins_anew() {
    let mut scenario = Scenario::default();
    scenario.plant.ground.present = true;
    let mut mpc = AttitudeMpc::new(&scenario);
    let flies = mpc.model.trim.actuation;
    let idles = Actuation { rotor_speed: [scenario.idle_speed(); 3], ..flies };
    fly(&mut mpc, 0..200, flies);
    mpc.memory.disturbance = Vector4::repeat(0.1);
    assert!(mpc.memory.gain < 0.03, "{}", mpc.memory.gain);
    fly(&mut mpc, 200..201, idles);
    assert_eq!((mpc.memory.gain, mpc.memory.disturbance), (disturbance::FIRST_GAIN, Vector4::zeros()));
    fly(&mut mpc, 201..300, idles);
    assert_eq!((mpc.memory.gain, mpc.memory.disturbance), (disturbance::FIRST_GAIN, Vector4::zeros()));
    fly(&mut mpc, 300..301, flies);
    assert!(mpc.memory.gain > 0.15 && mpc.memory.gain < disturbance::FIRST_GAIN, "{}", mpc.memory.gain);
    scenario.plant.ground.present = false;
    let mut mpc = AttitudeMpc::new(&scenario);
    fly(&mut mpc, 0..200, flies);
    fly(&mut mpc, 200..201, idles);
    assert!(mpc.memory.gain < 0.03, "nothing stands in the air: {}", mpc.memory.gain);
}

/// Push on the vehicle \[N, N m, N m, N m\].
const PUSH: [f64; 4] = [0.5, -0.02, 0.03, 0.01];

/// Last state and answer after ten seconds of the controller's own model under [`PUSH`], which the controller does not
/// know, with a reference of `roll_rad` about trim.
fn settle(law: Law, disturbance_gain: f64, roll_rad: f64) -> (DVector<f64>, Controls) {
    let mut scenario = fixture::constrained();
    scenario.attitude.law = law;
    scenario.attitude.disturbance_gain = disturbance_gain;
    scenario.attitude.delay_compensation = DelayCompensation::Sample(false); // the vehicle has a lag, but no delay
    let mut mpc = AttitudeMpc::new(&scenario);
    let push = Vector4::from(PUSH);
    let mut x = DVector::zeros(11);
    let mut next = x.clone();
    let mut controls = Controls::default();
    let (mut state, mut reference) = hover(&mpc, 0);
    reference.attitude_rad[0] += roll_rad;
    for tick in 0..1000 {
        (state.stamp.tick, reference.stamp.tick) = (tick, tick);
        state.measured.velocity_mps[2] = x[0];
        state.measured.attitude_rad = [x[1] + mpc.model.trim.roll_rad, x[2], x[3]];
        state.measured.rates_radps = [x[4], x[5], x[6]];
        controls = mpc.step(state.stamp.tick, &state, &reference);
        let demand = Vector4::from(controls.demand);
        mpc.model.predict(&x, &demand, &push, &mut next);
        x.copy_from(&next);

        let u = mpc.model.mixing.trim + mpc.model.mixing.inverse * demand;
        let front = u[0].hypot(u[1]).sqrt();
        state.command_in_force.rotor_speed = [front, u[2].sqrt(), u[3].sqrt()];
        state.command_in_force.tilt_rad = u[0].atan2(u[1]);
    }
    (x, controls)
}

#[test]
fn a_constant_disturbance_leaves_no_offset() {
    let (x, controls) = settle(Law::Mpc, 0.1, 0.0);
    assert!(x.rows(0, STATES).amax() < 1e-9, "{x}");
    let push = Vector4::from(PUSH);
    assert!((Vector4::from(controls.disturbance) - push).amax() < 1e-9);
    assert!((Vector4::from(controls.demand) + push).amax() < 1e-9);
    let (offset, without) = settle(Law::Mpc, 0.0, 0.0);
    assert!(offset[0] > 0.01, "a force down makes it sink");
    assert_eq!(Vector4::from(without.disturbance), Vector4::zeros());
}

#[test]
fn a_constant_moment_leaves_no_offset() {
    let push = Vector4::from(PUSH);
    let (x, controls) = settle(Law::Indi, 0.0, 0.0);
    assert!(x.rows(0, STATES).amax() < 1e-9, "{x}");
    let found = Vector4::from(controls.disturbance) - push;
    assert!(found.rows(1, 3).amax() < 1e-9, "{found}; this vehicle lacks the side force, which is in col");
    assert!((Vector4::from(controls.demand) + push).amax() < 1e-9);
    let (x, _) = settle(Law::Geometric, 0.0, 0.0);
    assert!(x.rows(0, STATES).amax() < 1e-6, "by its integral: {x}");
}

#[test]
fn a_law_without_an_estimate_drops_that_of_the_law_before() {
    let of = |law| {
        let mut scenario = fixture::without_estimate();
        scenario.attitude.law = law;
        AttitudeMpc::new(&scenario)
    };
    let mut before = of(Law::Indi);
    before.memory.disturbance = Vector4::repeat(0.1);
    for (law, keeps) in [(Law::Indi, true), (Law::Mpc, false), (Law::Geometric, false)] {
        let mut after = of(law);
        assert!(after.restore(&before.snapshot()));
        assert_eq!(after.memory.disturbance == before.memory.disturbance, keeps, "{law:?}");
    }
}

#[test]
fn a_roll_away_from_trim_leaves_no_offset() {
    let (mut x, _) = settle(Law::Mpc, 0.1, 0.3);
    x[1] -= 0.3;
    assert!(x.rows(0, STATES).amax() < 1e-9, "{x}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn every_published_demand_is_inside_the_exact_set(
        w in prop::array::uniform2(-20.0..20.0_f64), attitude in prop::array::uniform6(-1.6..1.6_f64),
        rates in prop::array::uniform6(-10.0..10.0_f64), ratio in 1.15..2.5_f64,
        [reaction, own, soft, broken] in prop::array::uniform4(prop::bool::ANY),
    ) {
        let mut scenario = fixture::constrained();
        scenario.plant.rotor_speed_max_ratio = ratio;
        scenario.mixer.tilt_reaction = reaction;
        scenario.attitude.mpc.time_limit_ms = 0.0;
        scenario.attitude.mpc.solver = if own { SolverName::ActiveSet } else { SolverName::Clarabel };
        scenario.attitude.mpc.state_constraints = if soft { StateConstraints::Soft } else { StateConstraints::None };
        if broken {
            scenario.fault = vec![fixture::fault(FaultKind::Nan, 0.0, None)];
        }
        let mut mpc = AttitudeMpc::new(&scenario);
        let (mut state, mut reference) = hover(&mpc, 0);
        (state.measured.velocity_mps[2], reference.w_mps) = w.into();
        let ([phi, theta, psi, phi_ref, theta_ref, psi_ref], [p, q, r, p_ref, q_ref, r_ref]) = (attitude, rates);
        state.measured.attitude_rad = [phi, theta, psi];
        state.measured.rates_radps = [p, q, r];
        reference.attitude_rad = [phi_ref, theta_ref, psi_ref];
        reference.rates_radps = [p_ref, q_ref, r_ref];
        let controls = mpc.step(state.stamp.tick, &state, &reference);
        let worst = if broken { SolveStatus::Fallback } else { SolveStatus::Solved };
        prop_assert!(controls.status <= worst as u64, "status {}", controls.status);
        prop_assert!(demand_violation(&scenario, controls.demand) <= 0.0);
    }

    #[test]
    fn no_input_makes_the_controller_publish_nan(
        numbers in prop::array::uniform18(prop::num::f64::ANY), tick in prop::num::u64::ANY,
        [exact, own, soft] in prop::array::uniform3(prop::bool::ANY), law in prop::sample::select(&LAWS[..]),
    ) {
        let mut scenario = Scenario::default();
        scenario.attitude.law = law;
        scenario.attitude.disturbance_gain = 0.5;
        scenario.attitude.mpc.constraints = if exact { Constraints::Cone } else { Constraints::Box };
        scenario.attitude.mpc.time_limit_ms = 0.0;
        scenario.attitude.mpc.solver = if own { SolverName::ActiveSet } else { SolverName::Clarabel };
        scenario.attitude.mpc.state_constraints = if soft { StateConstraints::Soft } else { StateConstraints::None };
        let mut mpc = AttitudeMpc::new(&scenario);
        let (state, reference) = hover(&mpc, tick.saturating_sub(1));
        mpc.step(state.stamp.tick, &state, &reference);
        let (mut state, mut reference) = hover(&mpc, tick);
        state.measured.velocity_mps[2] = numbers[0];
        state.measured.attitude_rad.copy_from_slice(&numbers[1..4]);
        state.measured.rates_radps.copy_from_slice(&numbers[4..7]);
        state.command_in_force.rotor_speed.copy_from_slice(&numbers[7..10]);
        state.command_in_force.tilt_rad = numbers[10];
        reference.w_mps = numbers[11];
        reference.attitude_rad.copy_from_slice(&numbers[12..15]);
        reference.rates_radps[0] = numbers[15];
        state.measured.velocity_mps[..2].copy_from_slice(&numbers[16..]);
        let controls = mpc.step(state.stamp.tick, &state, &reference);
        prop_assert!(controls.demand.iter().chain(&controls.disturbance).all(|u| u.is_finite()));
    }
}
