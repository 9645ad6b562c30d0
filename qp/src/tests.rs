//! The optimality conditions on random problems, and the problems that have no solution.

use nalgebra::DVector;
use proptest::prelude::*;

use super::random::Problem;
use super::*;

const STEPS: u32 = 100;

fn solver(problem: &Problem) -> ActiveSet {
    ActiveSet::new(&problem.hessian, &problem.rows, &problem.softness, &problem.discs, STEPS)
}

/// Numbers in 0..1 from a seed: enough of a generator for problems.
fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn slacks(problem: &Problem, x: &[f64]) -> (DVector<f64>, DVector<f64>) {
    let x = DVector::from_column_slice(x);
    let (rows, discs) = problem.offsets.split_at(problem.rows.nrows());
    let at = |offsets: &[f64], slopes: &DMatrix<f64>| DVector::from_column_slice(offsets) + slopes * &x;
    (at(rows, &problem.rows), at(discs, &problem.discs))
}

/// By how much `x` leaves the hard rows and the discs.
fn violation(problem: &Problem, x: &[f64]) -> f64 {
    let (rows, discs) = slacks(problem, x);
    let hard = rows.iter().zip(&problem.softness).filter(|(_, softness)| **softness == 0.0).map(|(slack, _)| -slack);
    let outside = discs.as_slice().chunks_exact(2).map(|pair| pair[0].hypot(pair[1]) - 1.0);
    hard.chain(outside).fold(f64::NEG_INFINITY, f64::max)
}

/// Gradient of the cost, soft rows included.
fn gradient(problem: &Problem, x: &[f64]) -> DVector<f64> {
    let miss = DVector::from_column_slice(x) - DVector::from_column_slice(&problem.centre);
    let (rows, _) = slacks(problem, x);
    let mut gradient = &problem.hessian * miss;
    for ((row, slack), softness) in problem.rows.row_iter().zip(&rows).zip(&problem.softness) {
        if *softness > 0.0 && *slack < 0.0 {
            gradient += row.transpose() * (slack / softness);
        }
    }
    gradient
}

fn cost(problem: &Problem, x: &[f64]) -> f64 {
    let miss = DVector::from_column_slice(x) - DVector::from_column_slice(&problem.centre);
    let (rows, _) = slacks(problem, x);
    let excess =
        |(slack, softness): (&f64, &f64)| if *softness > 0.0 { slack.min(0.0).powi(2) / softness } else { 0.0 };
    0.5 * (&problem.hessian * &miss).dot(&miss) + 0.5 * rows.iter().zip(&problem.softness).map(excess).sum::<f64>()
}

#[test]
fn a_centre_inside_is_the_optimum_bit_for_bit() {
    let mut uniform = uniform(1);
    let mut problem = Problem::draw(&mut uniform);
    problem.centre.iter_mut().for_each(|c| *c *= 1e-9);
    let mut x = vec![f64::NAN; problem.centre.len()];
    let outcome = solver(&problem).solve(&problem.centre, &problem.offsets, &mut x);
    assert_eq!((outcome.verdict, outcome.iterations, outcome.active), (Verdict::Optimal, 0, 0));
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
        assert_eq!(outcome.verdict, Verdict::Optimal);
        assert!((x[0] - centre[0] / length).abs() < 1e-9 && (x[1] - centre[1] / length).abs() < 1e-9, "{x:?}");
    }
}

#[test]
fn a_soft_row_gives_way_by_its_price() {
    // 1/2 (x - 1)^2 + 1/2 w e^2 with x <= e: x = 1 / (1 + w)
    let rows = DMatrix::from_element(1, 1, -1.0);
    let mut solver = ActiveSet::new(&DMatrix::identity(1, 1), &rows, &[0.25], &DMatrix::zeros(0, 1), STEPS);
    let mut x = [0.0];
    assert_eq!(solver.solve(&[1.0], &[0.0], &mut x).verdict, Verdict::Optimal);
    assert!((x[0] - 0.2).abs() < 1e-12, "{x:?}");
}

#[test]
fn rows_that_contradict_have_no_solution() {
    let rows = DMatrix::from_row_slice(2, 1, &[1.0, -1.0]);
    let mut solver = ActiveSet::new(&DMatrix::identity(1, 1), &rows, &[0.0; 2], &DMatrix::zeros(0, 1), STEPS);
    let mut x = [7.0];
    assert_eq!(solver.solve(&[5.0], &[-1.0, -1.0], &mut x).verdict, Verdict::Infeasible); // x >= 1, x <= -1
    assert_eq!(x, [7.0]);
    assert_eq!(solver.solve(&[5.0], &[1.0, 1.0], &mut x).verdict, Verdict::Optimal, "the next one is solved");
    assert!((x[0] - 1.0).abs() < 1e-12);
}

#[test]
fn a_row_beyond_a_disc_has_no_solution() {
    let identity = DMatrix::identity(2, 2);
    let rows = DMatrix::from_row_slice(1, 2, &[1.0, 0.0]);
    let mut solver = ActiveSet::new(&identity, &rows, &[0.0], &identity, STEPS);
    for beyond in [1.01, 2.0, 1e6] {
        let verdict = solver.solve(&[0.0, 0.5], &[-beyond, 0.0, 0.0], &mut [0.0; 2]).verdict;
        assert!(verdict != Verdict::Optimal, "x1 >= {beyond}: {verdict:?}");
    }
}

#[test]
fn numbers_that_are_none_are_told() {
    let mut uniform = uniform(3);
    let problem = Problem::draw(&mut uniform);
    let (mut solver, mut x) = (solver(&problem), vec![7.0; problem.centre.len()]);
    for poison in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let centre = vec![poison; problem.centre.len()];
        assert_eq!(solver.solve(&centre, &problem.offsets, &mut x).verdict, Verdict::NotFinite);
        let offsets = vec![poison; problem.offsets.len()];
        assert_eq!(solver.solve(&problem.centre, &offsets, &mut x).verdict, Verdict::NotFinite);
    }
    assert!(x.iter().all(|x| *x == 7.0));
}

/// A tangent that turned, holds and depends on the others was dropped with all of its force: the dual fell.
#[test]
fn a_turned_tangent_that_depends_on_others_leaves_them_its_force() {
    let mut uniform = uniform(6_100_534_943_901_768_181);
    let mut problem = Problem::draw(&mut uniform);
    problem.offsets.iter_mut().for_each(|offset| *offset *= 10_f64.powf(4.252_015_350_575_705));
    let (mut solver, mut x) = (solver(&problem), problem.centre.clone());
    for _ in 0..2 {
        let verdict = solver.solve(&problem.centre, &problem.offsets, &mut x).verdict; // the dual is looked at on the way
        assert_eq!(verdict, Verdict::Infeasible);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Inside, and no way into the set goes down: the optimum of any other centre is a point to go towards.
    #[test]
    fn random_problems_are_solved(seed: u64) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let mut solver = solver(&problem);
        let (mut x, mut other) = (problem.centre.clone(), problem.centre.clone());
        let outcome = solver.solve(&problem.centre, &problem.offsets, &mut x);
        prop_assert_eq!(outcome.verdict, Verdict::Optimal);
        prop_assert!(violation(&problem, &x) <= 1e-9, "{:e}", violation(&problem, &x));

        let centre = problem.centre.clone();
        problem.centre.iter_mut().for_each(|c| *c *= 2.0 * uniform() - 1.0);
        prop_assert_eq!(solver.solve(&problem.centre, &problem.offsets, &mut other).verdict, Verdict::Optimal);
        problem.centre = centre;
        let down = gradient(&problem, &x);
        let way = DVector::from_column_slice(&other) - DVector::from_column_slice(&x);
        let size = cost(&problem, &x) + cost(&problem, &other);
        prop_assert!(down.dot(&way) >= -1e-6 * size, "{:e} of {size:e}", down.dot(&way));
    }

    /// From wherever it starts it ends at the same cost, and from the same start at the same bits.
    #[test]
    fn a_warm_start_changes_the_way_and_not_the_end(seed: u64) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let (mut warm, mut copy, mut cold) = (solver(&problem), solver(&problem), solver(&problem));
        let [mut x, mut y, mut z] = [(); 3].map(|()| problem.centre.clone());
        for _ in 0..4 {
            copy.warm_start(warm.working_set());
            cold.forget();
            let outcome = warm.solve(&problem.centre, &problem.offsets, &mut x);
            prop_assert_eq!(outcome.verdict, Verdict::Optimal);
            prop_assert_eq!(copy.solve(&problem.centre, &problem.offsets, &mut y), outcome);
            prop_assert_eq!(&x, &y);
            prop_assert_eq!(copy.working_set(), warm.working_set());
            prop_assert_eq!(cold.solve(&problem.centre, &problem.offsets, &mut z).verdict, Verdict::Optimal);
            let (ours, theirs) = (cost(&problem, &x), cost(&problem, &z));
            prop_assert!((ours - theirs).abs() <= 1e-6 * ours.max(theirs), "{ours} is not {theirs}");
            problem.redraw(&mut uniform);
        }
    }

    /// Whatever the numbers are: no panic, and nothing that is none in the answer.
    #[test]
    fn any_numbers_get_an_answer(
        seed: u64, decades in -320.0..320.0_f64, of in 0_usize..3,
        wild in prop::collection::vec((any::<prop::sample::Index>(), prop::num::f64::ANY), 0..4),
    ) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let mut solver = solver(&problem);
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
        prop_assert_eq!(solver.solve(&problem.centre, &problem.offsets, &mut x).verdict, Verdict::Optimal, "afterwards");
    }

    #[test]
    fn out_of_steps_is_said(seed: u64) {
        let mut uniform = uniform(seed);
        let problem = Problem::draw(&mut uniform);
        let mut solver = solver(&problem);
        solver.max_iterations = 1;
        let mut x = problem.centre.clone();
        let outcome = solver.solve(&problem.centre, &problem.offsets, &mut x);
        prop_assert!(outcome.iterations <= 1);
        prop_assert!(matches!(outcome.verdict, Verdict::Optimal | Verdict::IterationLimit));
        prop_assert!(x.iter().all(|x| x.is_finite()));
    }
}
