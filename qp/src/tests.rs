//! Tests of the optimality conditions on random problems, and of problems without a solution.

mod random;

use nalgebra::DMatrix;
use proptest::prelude::*;
use random::{Problem, uniform};

use super::*;

const STEPS: u32 = 100;

#[test]
fn a_centre_inside_is_the_optimum_bit_for_bit() {
    let mut uniform = uniform(1);
    let mut problem = Problem::draw(&mut uniform);
    problem.centre.iter_mut().for_each(|c| *c *= 1e-9);
    let mut x = vec![f64::NAN; problem.centre.len()];
    let outcome = problem.solver(STEPS).solve(&problem.centre, &problem.offsets, &mut x);
    assert_eq!((outcome.termination, outcome.iterations, outcome.active), (Termination::Optimal, 0, 0));
    assert_eq!(x, problem.centre);
}

#[test]
fn the_nearest_point_of_a_disc_is_where_the_ray_meets_it() {
    let identity = DMatrix::identity(2, 2);
    let mut solver = ActiveSet::new(&identity, &DMatrix::zeros(0, 2), &[], &identity, STEPS);
    let mut x = [0.0; 2];
    for centre in [[3.0, 4.0], [-1e6, 1.0], [0.0, -1.000_001]] {
        let outcome = solver.solve(&centre, &[0.0, 0.0], &mut x);
        let length = centre[0].hypot(centre[1]);
        assert_eq!(outcome.termination, Termination::Optimal);
        assert!((x[0] - centre[0] / length).abs() < 1e-9 && (x[1] - centre[1] / length).abs() < 1e-9, "{x:?}");
    }
}

#[test]
fn a_soft_row_gives_way_by_its_price() {
    // 1/2 (x - 1)^2 + 1/2 w e^2 with x <= e: x = 1 / (1 + w)
    let rows = DMatrix::from_element(1, 1, -1.0);
    let mut solver = ActiveSet::new(&DMatrix::identity(1, 1), &rows, &[0.25], &DMatrix::zeros(0, 1), STEPS);
    let mut x = [0.0];
    assert_eq!(solver.solve(&[1.0], &[0.0], &mut x).termination, Termination::Optimal);
    assert!((x[0] - 0.2).abs() < 1e-12, "{x:?}");
}

#[test]
fn rows_that_contradict_have_no_solution() {
    let rows = DMatrix::from_row_slice(2, 1, &[1.0, -1.0]);
    let mut solver = ActiveSet::new(&DMatrix::identity(1, 1), &rows, &[0.0; 2], &DMatrix::zeros(0, 1), STEPS);
    let mut x = [7.0];
    assert_eq!(solver.solve(&[5.0], &[-1.0, -1.0], &mut x).termination, Termination::Infeasible); // x >= 1, x <= -1
    assert_eq!(x, [7.0]);
    assert_eq!(solver.solve(&[5.0], &[1.0, 1.0], &mut x).termination, Termination::Optimal, "the next one is solved");
    assert!((x[0] - 1.0).abs() < 1e-12);
}

#[test]
fn a_row_beyond_a_disc_has_no_solution() {
    let identity = DMatrix::identity(2, 2);
    let rows = DMatrix::from_row_slice(1, 2, &[1.0, 0.0]);
    let mut solver = ActiveSet::new(&identity, &rows, &[0.0], &identity, STEPS);
    for beyond in [1.01, 2.0, 1e6] {
        let termination = solver.solve(&[0.0, 0.5], &[-beyond, 0.0, 0.0], &mut [0.0; 2]).termination;
        assert!(termination != Termination::Optimal, "x1 >= {beyond}: {termination:?}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_reported() {
    let mut uniform = uniform(3);
    let problem = Problem::draw(&mut uniform);
    let (mut solver, mut x) = (problem.solver(STEPS), vec![7.0; problem.centre.len()]);
    for poison in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let centre = vec![poison; problem.centre.len()];
        assert_eq!(solver.solve(&centre, &problem.offsets, &mut x).termination, Termination::NotFinite);
        let offsets = vec![poison; problem.offsets.len()];
        assert_eq!(solver.solve(&problem.centre, &offsets, &mut x).termination, Termination::NotFinite);
    }
    assert!(x.iter().all(|x| *x == 7.0));
}

/// Regression: a satisfied tangent that had turned and was dependent was dropped with its multiplier; the dual fell.
#[test]
fn a_dependent_turned_tangent_gives_its_multiplier_to_the_others() {
    let mut uniform = uniform(6_100_534_943_901_768_181);
    let mut problem = Problem::draw(&mut uniform);
    problem.offsets.iter_mut().for_each(|offset| *offset *= 10_f64.powf(4.252_015_350_575_705));
    let (mut solver, mut x) = (problem.solver(STEPS), problem.centre.clone());
    for _ in 0..2 {
        // In debug builds, `solve` itself asserts that the dual does not fall.
        let termination = solver.solve(&problem.centre, &problem.offsets, &mut x).termination;
        assert_eq!(termination, Termination::Infeasible);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_problems_are_solved(seed: u64) {
        let problem = Problem::draw(&mut uniform(seed));
        let mut x = problem.centre.clone();
        let outcome = problem.solver(STEPS).solve(&problem.centre, &problem.offsets, &mut x);
        prop_assert_eq!(outcome.termination, Termination::Optimal);
        prop_assert!(problem.violation(&x) <= 1e-9, "{:e}", problem.violation(&x));
    }

    /// Checks that any start leads to the same cost, and equal starts to equal bits.
    #[test]
    fn a_warm_start_does_not_change_the_optimum(seed: u64) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let (mut warm, mut copy, mut cold) = (problem.solver(STEPS), problem.solver(STEPS), problem.solver(STEPS));
        let [mut x, mut y, mut z] = [(); 3].map(|()| problem.centre.clone());
        for _ in 0..4 {
            copy.warm_start(warm.working_set());
            cold.forget();
            let outcome = warm.solve(&problem.centre, &problem.offsets, &mut x);
            prop_assert_eq!(outcome.termination, Termination::Optimal);
            prop_assert_eq!(copy.solve(&problem.centre, &problem.offsets, &mut y), outcome);
            prop_assert_eq!(&x, &y);
            prop_assert_eq!(copy.working_set(), warm.working_set());
            prop_assert_eq!(cold.solve(&problem.centre, &problem.offsets, &mut z).termination, Termination::Optimal);
            let (ours, theirs) = (problem.cost(&x), problem.cost(&z));
            prop_assert!((ours - theirs).abs() <= 1e-6 * ours.max(theirs), "{ours} is not {theirs}");
            problem.redraw(&mut uniform);
        }
    }

    /// Checks that the solver does not panic, whatever the numbers, and that its answer is finite.
    #[test]
    fn any_numbers_get_an_answer(
        seed: u64, decades in -320.0..320.0_f64, of in 0_usize..3,
        wild in prop::collection::vec((any::<prop::sample::Index>(), prop::num::f64::ANY), 0..4),
    ) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let mut solver = problem.solver(STEPS);
        let scaled = |numbers: &mut Vec<f64>| numbers.iter_mut().for_each(|x| *x *= 10_f64.powf(decades));
        if of != 0 { scaled(&mut problem.centre) }
        if of != 1 { scaled(&mut problem.offsets) }
        for (index, number) in wild {
            let numbers = if problem.offsets.is_empty() || number > 0.0 { &mut problem.centre } else { &mut problem.offsets };
            let place = index.index(numbers.len());
            numbers[place] = number;
        }
        let mut x = vec![0.0; problem.centre.len()];
        for _ in 0..2 {
            solver.solve(&problem.centre, &problem.offsets, &mut x);
            prop_assert!(x.iter().all(|x| x.is_finite()), "{x:?}");
        }
        problem.redraw(&mut uniform);
        prop_assert_eq!(solver.solve(&problem.centre, &problem.offsets, &mut x).termination, Termination::Optimal, "afterwards");
    }

    #[test]
    fn the_iteration_limit_is_reported(seed: u64) {
        let mut uniform = uniform(seed);
        let problem = Problem::draw(&mut uniform);
        let mut solver = problem.solver(STEPS);
        solver.max_iterations = 1;
        let mut x = problem.centre.clone();
        let outcome = solver.solve(&problem.centre, &problem.offsets, &mut x);
        prop_assert!(outcome.iterations <= 1);
        prop_assert!(matches!(outcome.termination, Termination::Optimal | Termination::IterationLimit));
        prop_assert!(x.iter().all(|x| x.is_finite()));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Checks by the certificate of optimality and by Clarabel that no feasible point costs less.
    #[test]
    fn no_point_inside_costs_less(seed: u64) {
        let problem = Problem::draw(&mut uniform(seed));
        let mut x = problem.centre.clone();
        problem.solver(STEPS).solve(&problem.centre, &problem.offsets, &mut x);
        let size = relative_to(&problem, &x);
        prop_assert!(problem.gap(&x) <= 1e-6 * size, "{:e} of {size:e}", problem.gap(&x));
        // A solve of Clarabel that misses its tolerances, 1e-8 relative and 1e-8 absolute, is no reference.
        if let Some(theirs) = problem.by_clarabel() {
            let (ours, theirs) = (problem.cost(&x), problem.cost(&theirs));
            prop_assert!((ours - theirs).abs() <= 1e-6 * size + 1e-8, "{ours:e} is not {theirs:e}, of {size:e}");
        }
    }
}

/// Scale of cost differences: the cost of `x`, or `1/2 c'H c` if that is larger.
fn relative_to(problem: &Problem, x: &[f64]) -> f64 {
    let centre = nalgebra::DVector::from_column_slice(&problem.centre);
    problem.cost(x).max(0.5 * (&problem.hessian * &centre).dot(&centre))
}

#[test]
fn an_optimum_has_no_gap_and_its_neighbour_has() {
    let problem = Problem {
        hessian: DMatrix::identity(2, 2),
        rows: DMatrix::from_row_slice(1, 2, &[-1.0, 0.0]),
        softness: vec![0.0],
        discs: DMatrix::zeros(0, 2),
        centre: vec![2.0, 0.5],
        offsets: vec![1.0], // x0 <= 1
    };
    assert_eq!(problem.gap(&[1.0, 0.5]), 0.0);
    assert!((problem.gap(&[1.0, 0.6]) - 0.005).abs() < 1e-12);
    assert!(problem.gap(&[0.9, 0.5]) > 0.105, "no limit is touched");

    let disc = Problem {
        rows: DMatrix::zeros(0, 2),
        softness: vec![],
        discs: DMatrix::identity(2, 2),
        centre: vec![3.0, 4.0],
        offsets: vec![0.0, 0.0],
        ..problem
    };
    assert!(disc.gap(&[0.6, 0.8]) < 1e-13);
    assert!(disc.gap(&[0.8, 0.6]) > 0.2, "on the disc, but elsewhere: {}", disc.gap(&[0.8, 0.6]));
    assert!(disc.gap(&[-0.6, -0.8]) > 1.0, "on the far side: {}", disc.gap(&[-0.6, -0.8]));
}

/// Runs by `cargo test --release -p qp million -- --ignored --nocapture`; takes a minute.
#[test]
#[ignore = "a minute in a release build; the same as random_problems_are_solved and no_point_inside_costs_less, of more problems"]
fn a_million_random_problems_are_solved() {
    let mut uniform = uniform(20160);
    let (mut steps, mut gap, mut violation) = (0, 0.0_f64, 0.0_f64);
    for set_up in 0..20_000 {
        let mut problem = Problem::draw(&mut uniform);
        let mut solver = problem.solver(STEPS);
        let mut x = problem.centre.clone();
        for _ in 0..50 {
            problem.redraw(&mut uniform);
            let outcome = solver.solve(&problem.centre, &problem.offsets, &mut x);
            assert_eq!(outcome.termination, Termination::Optimal, "set-up {set_up}");
            steps = steps.max(outcome.iterations);
        }
        gap = gap.max(problem.gap(&x) / relative_to(&problem, &x));
        violation = violation.max(problem.violation(&x));
    }
    assert!(gap < 1e-6 && violation < 1e-8, "{gap:e} {violation:e}");
    #[expect(clippy::disallowed_macros, reason = "the figures are what this test is run for")]
    {
        println!("at most {steps} steps; the optimum costs {gap:.0e} less at most; outside by {violation:.0e} at most");
    }
}
