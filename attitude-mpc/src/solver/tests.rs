//! The solver against its optimality conditions, and on inputs it cannot solve.

use contract::Scenario;
use contract::scenario::Constraints;
use proptest::prelude::*;

use super::*;
use crate::condensed::Condensed;
use crate::model::PredictionModel;

fn set_up(constraints: Constraints, max_iterations: u32) -> (DMatrix<f64>, MoveSet, ConicSolver) {
    let mut scenario = Scenario::default();
    scenario.mpc.constraints = constraints;
    let hessian = Condensed::new(&PredictionModel::new(&scenario), &scenario.mpc).hessian;
    let set = MoveSet::new(&scenario).unwrap();
    let solver = ConicSolver::new(&hessian, &set, max_iterations);
    (hessian, set, solver)
}

/// A plan that asks for more than the rotors have.
fn violent() -> DVector<f64> {
    DVector::from_fn(20, |i, _| [-40.0, 3.0, -3.0, 5.0][i % 4])
}

#[test]
fn a_plan_inside_the_set_is_its_own_optimum() {
    for constraints in [Constraints::Box, Constraints::Cone] {
        let (_, _, mut solver) = set_up(constraints, MAX_ITERATIONS);
        let wanted = DVector::from_fn(20, |i, _| [-2.0, 0.1, -0.1, 0.2][i % 4]);
        let mut plan = DVector::zeros(20);
        let outcome = solver.solve(&wanted, &mut plan);
        assert!(outcome.solved && outcome.iterations > 0 && outcome.solve_ns > 0);
        assert!((plan - wanted).amax() < 1e-4);
    }
}

#[test]
fn a_solve_leaves_no_trace_in_the_next() {
    let (_, _, mut solver) = set_up(Constraints::Cone, MAX_ITERATIONS);
    let (mut first, mut other, mut again) = (DVector::zeros(20), DVector::zeros(20), DVector::zeros(20));
    assert!(solver.solve(&violent(), &mut first).solved);
    assert!(solver.solve(&(violent() * -0.5), &mut other).solved);
    assert!(!solver.solve(&(violent() * f64::NAN), &mut other).solved);
    assert!(solver.solve(&violent(), &mut again).solved);
    assert_eq!(first, again);
}

#[test]
fn without_a_solution_the_plan_is_left_alone() {
    let (_, _, mut starved) = set_up(Constraints::Cone, 0);
    let (_, _, mut solver) = set_up(Constraints::Cone, MAX_ITERATIONS);
    let before = DVector::from_element(20, 7.0);
    let mut plan = before.clone();
    assert!(!starved.solve(&violent(), &mut plan).solved);
    assert_eq!(plan, before);
    for poison in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(!solver.solve(&DVector::from_element(20, poison), &mut plan).solved);
        assert_eq!(plan, before);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// At the optimum of a convex problem no direction into the set goes down: for every plan inside it,
    /// the gradient along the way there is not negative. The exact optimum of any other problem is such a plan.
    #[test]
    fn no_way_into_the_set_goes_down(
        wanted in prop::collection::vec(-1.0..1.0_f64, 20), elsewhere in prop::collection::vec(-1.0..1.0_f64, 20),
        exact in prop::bool::ANY,
    ) {
        let (hessian, set, mut solver) =
            set_up(if exact { Constraints::Cone } else { Constraints::Box }, MAX_ITERATIONS);
        let ask = |shares: &[f64]| DVector::from_fn(20, |i, _| shares[i] * [60.0, 8.0, 8.0, 12.0][i % 4]);
        let (wanted, elsewhere) = (ask(&wanted), ask(&elsewhere));
        let (mut best, mut other) = (DVector::zeros(20), DVector::zeros(20));
        prop_assert!(solver.solve(&wanted, &mut best).solved);
        prop_assert!(solver.solve(&elsewhere, &mut other).solved);
        prop_assert!(set.judge(best.as_slice(), 0.0).0 < 1e-6);

        let gradient = &hessian * (&best - &wanted);
        let way = &other - &best;
        let size = (wanted.transpose() * &hessian * &wanted)[0];
        prop_assert!(gradient.dot(&way) > -1e-6 * size, "{} of {size}", gradient.dot(&way));
    }
}
