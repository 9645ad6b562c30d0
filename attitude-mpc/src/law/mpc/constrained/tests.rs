//! Tests of the published demand when the solver fails, and when the states have limits.

use airframe::DemandSet;
use airframe::envelope::Envelope;
use airframe::projection::Projection;
use contract::message::{Controls, SolveStatus};
use nalgebra::{DVector, Vector4};
use settings::{Constraints, FaultKind, Mode, Scenario, SolverName, StateConstraints};

use super::{Condensed, PlanSet};
use crate::AttitudeMpc;
use crate::fixture::fault;
use crate::law::mpc::condensed::GIVEN;
use crate::tests::{demand_violation, hover, violent_turn};

const SOLVERS: [SolverName; 2] = [SolverName::Clarabel, SolverName::ActiveSet];

fn scenario(solver: SolverName) -> Scenario {
    let mut scenario = crate::fixture::constrained();
    scenario.attitude.mpc.solver = solver;
    scenario.attitude.mpc.time_limit_ms = 0.0; // the result must not depend on the machine's speed
    scenario
}

/// Answers to a violent turn of `ticks` ticks.
fn turn(scenario: &Scenario, ticks: u64) -> Vec<Controls> {
    let mut mpc = AttitudeMpc::new(scenario);
    let answer = |tick| {
        let (state, reference) = violent_turn(&mpc, tick);
        mpc.step(state.stamp.tick, &state, &reference)
    };
    (0..ticks).map(answer).collect()
}

#[test]
fn a_failing_solver_costs_no_tick_and_recovers() {
    for solver in SOLVERS {
        for (kind, status) in [
            (FaultKind::Infeasible, SolveStatus::Fallback),
            (FaultKind::Nan, SolveStatus::Fallback),
            (FaultKind::IterationCap, SolveStatus::LimitReached),
        ] {
            let mut scenario = scenario(solver);
            scenario.fault = vec![fault(kind, 0.0, Some(0.09))];
            let mut failed = 0;
            for (tick, controls) in turn(&scenario, 12).iter().enumerate() {
                let active = tick < 9;
                let is_solved = controls.status == SolveStatus::Solved as u64;
                // With a warm start the solver may succeed within the cap on iterations.
                let may_be_solved = !active || kind == FaultKind::IterationCap && tick > 0;
                let as_expected = is_solved && may_be_solved || active && controls.status == status as u64;
                assert!(as_expected, "{solver:?} {kind:?} {tick}: {}", controls.status);
                failed += u64::from(!is_solved);
                assert_eq!(controls.fallbacks, failed, "{solver:?} {kind:?} {tick}");
                assert!(demand_violation(&scenario, controls.demand) <= 0.0, "{solver:?} {kind:?} {tick}");
            }
        }
    }
}

#[test]
fn with_a_fault_of_the_solver_every_plan_is_solved() {
    for (kind, status) in
        [(FaultKind::Nan, SolveStatus::Fallback), (FaultKind::IterationCap, SolveStatus::LimitReached)]
    {
        let mut scenario = scenario(SolverName::Clarabel);
        scenario.fault = vec![fault(kind, 0.0, None)];
        let mut mpc = AttitudeMpc::new(&scenario);
        let (state, mut reference) = hover(&mpc, 0);
        reference.w_mps = -0.1;
        let controls = mpc.step(state.stamp.tick, &state, &reference);
        assert_eq!(controls.status, status as u64);
        // The unconstrained optimum is inside, so the plan reaches it.
        let miss = Vector4::from(controls.demand) - mpc.plans().unwrap()[0].fixed_rows::<4>(0);
        assert!(miss.amax() < 1e-12, "{miss}");
    }
}

#[test]
fn a_fallback_is_the_mixer_s_projection_of_the_unconstrained_demand() {
    let mut scenario = scenario(SolverName::Clarabel);
    scenario.fault = vec![fault(FaultKind::Nan, 0.0, None)];
    let fallen_back = turn(&scenario, 1)[0];
    scenario.fault.clear();
    scenario.attitude.mpc.constraints = Constraints::None;
    let wanted = turn(&scenario, 1)[0].demand.into();
    let envelope = Envelope::new(&scenario.airframe, false, scenario.limits());
    let nearest =
        Projection::new(DemandSet::exact(&envelope), &scenario.mixer.projection_weights).nearest(&wanted).unwrap();
    assert_eq!(Vector4::from(fallen_back.demand), nearest);
}

#[test]
fn a_solve_out_of_iterations_publishes_the_best_plan_inside() {
    let mut scenario = scenario(SolverName::Clarabel);
    let optimum = turn(&scenario, 1)[0];
    let mut nearer = f64::INFINITY;
    for iterations in [2, 4, 6] {
        scenario.attitude.mpc.max_iterations = iterations;
        let controls = turn(&scenario, 1)[0];
        assert_eq!((controls.status, controls.iterations), (SolveStatus::LimitReached as u64, u64::from(iterations)));
        assert!(demand_violation(&scenario, controls.demand) <= 0.0);
        let miss = (Vector4::from(controls.demand) - Vector4::from(optimum.demand)).norm();
        assert!(miss < nearer, "{iterations} iterations: {miss} is not below {nearer}");
        nearer = miss;
    }
}

#[test]
fn time_is_limited_only_where_there_is_a_clock() {
    for (mode, status) in [
        (Mode::Realtime, SolveStatus::LimitReached),
        (Mode::Lockstep, SolveStatus::Solved),
        (Mode::Inprocess, SolveStatus::Solved),
    ] {
        let mut scenario = scenario(SolverName::Clarabel);
        scenario.run.mode = mode;
        scenario.attitude.mpc.time_limit_ms = 1e-6;
        assert_eq!(turn(&scenario, 1)[0].status, status as u64, "{mode:?}");
    }
}

/// Answer at hover with a yaw rate `r_radps`, which (51) may forbid, and a heading step in its direction.
fn spin(solver: SolverName, limits: StateConstraints, r_radps: f64) -> (Controls, AttitudeMpc) {
    let mut scenario = scenario(solver);
    scenario.attitude.mpc.state_constraints = limits;
    let mut mpc = AttitudeMpc::new(&scenario);
    let (mut state, mut reference) = hover(&mpc, 0);
    state.measured.rates_radps[2] = r_radps;
    reference.attitude_rad[2] = 1.6; // a heading step in the direction of the spin
    (mpc.step(state.stamp.tick, &state, &reference), mpc)
}

#[test]
fn a_state_beyond_its_limit_still_has_a_plan() {
    for solver in SOLVERS {
        let (free, mut without) = spin(solver, StateConstraints::None, 8.0);
        let (limited, mut with) = spin(solver, StateConstraints::Soft, 8.0);
        assert_eq!([free.status, limited.status], [SolveStatus::Solved as u64; 2], "{solver:?}");
        assert!(limited.demand[3] < free.demand[3], "it brakes the spin");
        let mut scenario = scenario(solver);
        scenario.attitude.mpc.state_constraints = StateConstraints::Soft;
        let course = Condensed::new(&with.model, &scenario).unwrap().course;
        let mut set = PlanSet::new(&scenario, &course, with.model.trim.roll_rad).unwrap();
        let mut given = DVector::zeros(with.model.states() + GIVEN);
        given.rows_mut(0, with.model.states()).copy_from(&with.work.start);
        given[with.model.states() + 3] = 1.6;
        set.start(&given);
        let [free, limited] = [&mut without, &mut with].map(|mpc| set.excess(mpc.plans().unwrap()[1]));
        assert!(0.0 < limited && limited < free, "{solver:?}: {limited} is not below {free}");
    }
}

#[test]
fn a_plan_that_keeps_the_states_inside_is_left_alone() {
    let (free, _) = spin(SolverName::Clarabel, StateConstraints::None, 1.0);
    let (limited, _) = spin(SolverName::Clarabel, StateConstraints::Soft, 1.0);
    assert_eq!(free.demand, limited.demand);
}
