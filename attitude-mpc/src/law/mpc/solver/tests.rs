//! Tests of both solvers against the optimality conditions, against each other, and on problems without a solution.

use proptest::prelude::*;
use settings::{Constraints, StateConstraints};

use super::*;
use crate::law::mpc::condensed::Condensed;
use crate::law::mpc::constraints::STATE_PENALTY;
use crate::model::PredictionModel;

const SOLVERS: [SolverName; 2] = [SolverName::Clarabel, SolverName::ActiveSet];
/// Number of elements of a plan of ten moves.
const PLAN: usize = 40;

struct SetUp {
    hessian: DMatrix<f64>,
    gain: DMatrix<f64>,
    set: PlanSet,
    solver: Solver,
}

fn set_up(solver: SolverName, change: impl FnOnce(&mut Scenario)) -> SetUp {
    let mut scenario = crate::fixture::constrained();
    scenario.attitude.mpc.solver = solver;
    scenario.attitude.mpc.time_limit_ms = 0.0; // the result must not depend on the machine's speed
    assert_eq!(4 * scenario.nu(), PLAN);
    change(&mut scenario);
    let model = PredictionModel::new(&scenario);
    let Condensed { hessian, gain, course } = Condensed::new(&model, &scenario).unwrap();
    let set = PlanSet::new(&scenario, &course, model.trim.roll_rad).unwrap();
    let solver = Solver::new(&scenario, &hessian, &set);
    SetUp { hessian, gain: gain.given, set, solver }
}

impl SetUp {
    fn solve(&mut self, wanted: &DVector<f64>, plan: &mut DVector<f64>) -> SolveVerdict {
        self.solver.solve(wanted, &mut self.set, None, plan).verdict
    }

    /// Cost of a plan relative to the unconstrained optimum, including the cost of the excesses.
    fn cost(&self, plan: &DVector<f64>, wanted: &DVector<f64>) -> f64 {
        let miss = plan - wanted;
        let excesses = self.set.states.as_ref().map_or(0.0, |states| {
            let y = &states.drift + &states.forced * plan;
            0.5 * STATE_PENALTY * y.iter().map(|y| (y.abs() - 1.0).max(0.0).powi(2)).sum::<f64>()
        });
        0.5 * (&self.hessian * &miss).dot(&miss) + excesses
    }
}

/// Plan beyond the rotors' limits.
fn violent() -> DVector<f64> {
    DVector::from_fn(PLAN, |i, _| [-40.0, 3.0, -3.0, 5.0][i % 4])
}

#[test]
fn a_plan_inside_the_set_is_its_own_optimum() {
    for (choice, constraints) in SOLVERS.into_iter().flat_map(|s| [Constraints::Box, Constraints::Cone].map(|c| (s, c)))
    {
        let mut set_up = set_up(choice, |scenario| scenario.attitude.mpc.constraints = constraints);
        let wanted = DVector::from_fn(PLAN, |i, _| [-2.0, 0.1, -0.1, 0.2][i % 4]);
        let mut plan = DVector::zeros(PLAN);
        assert_eq!(set_up.solve(&wanted, &mut plan), SolveVerdict::Solved);
        let miss = (&plan - &wanted).component_div(&wanted).amax();
        assert!(miss < 1e-5, "{choice:?} {constraints:?}: {miss:e}");
    }
}

#[test]
fn a_solve_does_not_depend_on_the_one_before() {
    for choice in SOLVERS {
        let mut set_up = set_up(choice, |_| {});
        let (mut first, mut other, mut again) = (DVector::zeros(PLAN), DVector::zeros(PLAN), DVector::zeros(PLAN));
        assert_eq!(set_up.solve(&violent(), &mut first), SolveVerdict::Solved);
        assert_eq!(set_up.solve(&(violent() * -0.5), &mut other), SolveVerdict::Solved);
        assert_eq!(set_up.solve(&(violent() * f64::NAN), &mut other), SolveVerdict::Failed);
        assert_eq!(set_up.solve(&violent(), &mut again), SolveVerdict::Solved);
        let miss = (&first - &again).amax();
        // Clarabel has no warm start; the active set starts from the last solution, so its result differs by rounding.
        assert!(if choice == SolverName::Clarabel { miss == 0.0 } else { miss < 1e-8 }, "{choice:?}: {miss:e}");
    }
}

#[test]
fn without_a_solution_the_plan_is_left_alone() {
    for choice in SOLVERS {
        let mut set_up = set_up(choice, |_| {});
        let before = DVector::from_element(PLAN, 7.0);
        let mut plan = before.clone();
        for poison in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(
                set_up.solve(&DVector::from_element(PLAN, poison), &mut plan),
                SolveVerdict::Failed,
                "{choice:?}"
            );
            assert_eq!(plan, before);
        }
        for kind in [FaultKind::Nan, FaultKind::Infeasible] {
            let outcome = set_up.solver.solve(&violent(), &mut set_up.set, Some(kind), &mut plan);
            assert_eq!(outcome.verdict, SolveVerdict::Failed, "{choice:?} {kind:?}");
            assert_eq!(plan, before);
        }
    }
}

#[test]
fn the_time_limit_sees_this_solve_alone() {
    let mut set_up = set_up(SolverName::Clarabel, |_| {});
    let mut plan = DVector::zeros(PLAN);
    for _ in 0..20 {
        let (_, wall_ns) = runtime::timed(|| set_up.solve(&violent(), &mut plan));
        let Solver::Clarabel(solver) = &set_up.solver else { unreachable!("it was asked for") };
        assert!(solver.seen_s() * 1e9 <= wall_ns as f64, "{} s in {wall_ns} ns", solver.seen_s());
    }
}

/// Plan from shares of extreme demands.
fn ask(shares: &[f64]) -> DVector<f64> {
    DVector::from_fn(PLAN, |i, _| shares[i] * [60.0, 8.0, 8.0, 12.0][i % 4])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// At the optimum of a convex problem the cost decreases in no direction into the set: the gradient towards any
    /// plan inside is not negative. The optimum of another problem serves as such a plan.
    #[test]
    fn the_cost_decreases_in_no_direction_into_the_set(
        wanted in prop::collection::vec(-1.0..1.0_f64, PLAN), elsewhere in prop::collection::vec(-1.0..1.0_f64, PLAN),
        [exact, own] in prop::array::uniform2(prop::bool::ANY),
    ) {
        let mut set_up = set_up(if own { SolverName::ActiveSet } else { SolverName::Clarabel }, |scenario| {
            scenario.attitude.mpc.constraints = if exact { Constraints::Cone } else { Constraints::Box };
        });
        let (wanted, elsewhere) = (ask(&wanted), ask(&elsewhere));
        let (mut best, mut other) = (DVector::zeros(PLAN), DVector::zeros(PLAN));
        prop_assert_eq!(set_up.solve(&wanted, &mut best), SolveVerdict::Solved);
        prop_assert_eq!(set_up.solve(&elsewhere, &mut other), SolveVerdict::Solved);
        prop_assert!(set_up.set.violation(&best) < 1e-6);

        let gradient = &set_up.hessian * (&best - &wanted);
        let way = &other - &best;
        let size = (wanted.transpose() * &set_up.hessian * &wanted)[0];
        prop_assert!(gradient.dot(&way) > -1e-6 * size, "{} of {size}", gradient.dot(&way));
    }

    /// Both solvers reach the same objective, to 1e-6.
    #[test]
    fn both_solvers_reach_the_same_objective(
        given in prop::collection::vec(-1.0..1.0_f64, 26), ratio in 1.15..2.5_f64, soft in prop::bool::ANY,
    ) {
        let mut costs = vec![];
        let mut size_of_objective = 0.0;
        for choice in SOLVERS {
            let mut set_up = set_up(choice, |scenario| {
                scenario.plant.rotor_speed_max_ratio = ratio;
                if soft {
                    scenario.attitude.mpc.state_constraints = StateConstraints::Soft;
                }
            });
            // Sizes of w, three angles, three rates and four lag states, and of the references; 0.1 for disturbance and
            // last demand.
            let size = |i: usize| [3.0, 1.0, 1.0, 1.0, 8.0, 8.0, 8.0, 5.0, 0.5, 0.5, 0.5][i % 11];
            let given = DVector::from_fn(26, |i, _| if i < 18 { given[i] * size(i) } else { 0.1 * given[i] });
            let wanted = &set_up.gain * &given;
            set_up.set.start(&given);
            let mut plan = DVector::zeros(PLAN);
            prop_assert_eq!(set_up.solve(&wanted, &mut plan), SolveVerdict::Solved, "{:?}", choice);
            prop_assert!(set_up.set.violation(&plan) < 1e-6);
            costs.push(set_up.cost(&plan, &wanted));
            // The solvers' objective lacks the constant 1/2 U*'H U*, and their tolerances are relative to this
            // objective.
            size_of_objective = 0.5 * (&set_up.hessian * &wanted).dot(&wanted);
        }
        let miss = (costs[0] - costs[1]).abs() / f64::max(costs[0], size_of_objective);
        prop_assert!(miss < 1e-6, "{miss:e}: {:?}", costs);
    }
}
