//! The explicit path and the active set allocate nothing; Clarabel allocates its timer once per solve.

use airframe::Trim;
use attitude_mpc::AttitudeMpc;
use contract::message::{Controls, Reference, SolveStatus, Stamp, State};
use runtime::node::Core;
use settings::{
    Constraints, DelayCompensation, DelayName, Fault, FaultKind, FaultTarget, Law, Mode, Model, Profile, Scenario,
    SolverName, StateConstraints,
};

/// Steps once with a heading error; returns the answer and the number of allocations.
fn step(mpc: &mut AttitudeMpc, scenario: &Scenario, heading_rad: f64) -> (Controls, u64) {
    let trim = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction);
    let stamp = Stamp { sequence: 1, ..Stamp::default() };
    let mut state = State { stamp, command_in_force: trim.actuation.into(), ..State::default() };
    state.measured.attitude_rad[0] = trim.roll_rad;
    let reference = Reference { stamp, attitude_rad: [trim.roll_rad, 0.0, heading_rad], ..Reference::default() };
    let mut controls = Controls::default();
    let count = allocation_counter::measure(|| controls = mpc.step(0, &state, &reference));
    let snapshot = allocation_counter::measure(|| {
        std::hint::black_box(mpc.snapshot());
    });
    assert_eq!(snapshot.count_total, 0);
    (controls, count.count_total)
}

#[test]
fn the_explicit_path_allocates_nothing() {
    for (profile, constraints) in
        [(Profile::Paper, Constraints::None), (Profile::Robust, Constraints::Box), (Profile::Robust, Constraints::Cone)]
    {
        let mut scenario = Scenario::from(profile);
        scenario.attitude.mpc.constraints = constraints;
        scenario.attitude.disturbance_gain = 0.1;
        let mut mpc = AttitudeMpc::new(&scenario);
        for _ in 0..3 {
            let (controls, allocations) = step(&mut mpc, &scenario, 0.01);
            assert_eq!((controls.status, allocations), (SolveStatus::Explicit as u64, 0), "{constraints:?}");
        }
        let (controls, allocations) = step(&mut mpc, &scenario, f64::NAN);
        assert_eq!((controls.status, allocations), (SolveStatus::BadInput as u64, 0));
    }
}

#[test]
fn the_prediction_over_a_measured_delay_allocates_nothing() {
    let mut scenario = Scenario::default();
    scenario.attitude.delay_compensation = DelayCompensation::Named(DelayName::Measured);
    let mut mpc = AttitudeMpc::new(&scenario);
    let trim = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction);
    for tick in 10..20 {
        let stamp = Stamp { tick, sequence: 1, ..Stamp::default() };
        let command_in_force = trim.actuation.into();
        let (applied_sequence, applied_age_ns) = (tick, 43_000_000);
        let mut state = State { stamp, command_in_force, applied_sequence, applied_age_ns, ..State::default() };
        state.measured.attitude_rad[0] = trim.roll_rad;
        let reference = Reference { stamp, attitude_rad: [trim.roll_rad, 0.0, 0.01], ..Reference::default() };
        let count = allocation_counter::measure(|| {
            std::hint::black_box(mpc.step(tick, &state, &reference));
        });
        assert_eq!(count.count_total, 0);
    }
}

#[test]
fn no_model_allocates() {
    for model in [Model::Coupled, Model::Scheduled] {
        for profile in [Profile::Paper, Profile::Robust] {
            let mut scenario = Scenario::from(profile);
            scenario.attitude.mpc.model = model;
            scenario.attitude.disturbance_gain = 0.1;
            let mut mpc = AttitudeMpc::new(&scenario);
            for _ in 0..3 {
                let (controls, allocations) = step(&mut mpc, &scenario, 0.01);
                assert_eq!((controls.status, allocations), (SolveStatus::Explicit as u64, 0), "{model:?} {profile:?}");
            }
            let (controls, allocations) = step(&mut mpc, &scenario, f64::NAN);
            assert_eq!((controls.status, allocations), (SolveStatus::BadInput as u64, 0), "{model:?}");
        }
    }
}

#[test]
fn no_law_allocates() {
    for law in [Law::Mpc, Law::Lqr, Law::Pid, Law::Geometric, Law::Indi] {
        let mut scenario = Scenario::default();
        scenario.attitude.law = law;
        let mut mpc = AttitudeMpc::new(&scenario);
        for _ in 0..3 {
            let (controls, allocations) = step(&mut mpc, &scenario, 0.01);
            assert_eq!((controls.status, allocations), (SolveStatus::Explicit as u64, 0), "{law:?}");
        }
    }
}

#[test]
fn a_solve_allocates_what_clarabel_does_and_nothing_with_the_active_set() {
    for (solver, soft, expected) in [
        (SolverName::Clarabel, StateConstraints::None, 1),
        (SolverName::Clarabel, StateConstraints::Soft, 2), // two stages, one timer each
        (SolverName::ActiveSet, StateConstraints::None, 0),
        (SolverName::ActiveSet, StateConstraints::Soft, 0),
    ] {
        let mut scenario = Scenario::from(Profile::Robust);
        scenario.attitude.mpc.constraints = Constraints::Cone;
        scenario.attitude.mpc.solver = solver;
        scenario.attitude.mpc.state_constraints = soft;
        scenario.attitude.mpc.rates_limit_dps = [90.0; 3];
        scenario.run.mode = Mode::Inprocess; // no time limit, which a loaded machine would reach
        let mut mpc = AttitudeMpc::new(&scenario);
        for _ in 0..3 {
            let (controls, allocations) = step(&mut mpc, &scenario, 1.6);
            assert_eq!((controls.status, allocations), (SolveStatus::Solved as u64, expected), "{solver:?} {soft:?}");
        }
    }
}

#[test]
fn a_failing_solver_allocates_no_more() {
    for (solver, expected) in [(SolverName::Clarabel, 1), (SolverName::ActiveSet, 0)] {
        let mut scenario = Scenario::from(Profile::Robust);
        scenario.attitude.mpc.constraints = Constraints::Cone;
        scenario.attitude.mpc.solver = solver;
        scenario.fault = vec![Fault::new(FaultTarget::Mpc, FaultKind::Infeasible, 0.0, None)];
        let mut mpc = AttitudeMpc::new(&scenario);
        for _ in 0..3 {
            let (controls, allocations) = step(&mut mpc, &scenario, 1.6);
            assert_eq!((controls.status, allocations), (SolveStatus::Fallback as u64, expected), "{solver:?}");
        }
    }
}
