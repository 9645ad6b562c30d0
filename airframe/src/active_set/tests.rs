//! Optimality on random problems, and the problems that have no solution.

use nalgebra::{DMatrix, DVector, dmatrix};
use proptest::prelude::*;

use super::random::Problem;
use super::*;

/// Iterations granted: no problem here may need more.
const LIMIT: u32 = 150;

/// Uniform numbers from a seed (Steele, Lea and Flood 2014, `SplitMix`).
fn uniform(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn solver(problem: &Problem) -> ActiveSet {
    ActiveSet::new(&problem.hessian, &problem.rows, &problem.softness, &problem.discs, LIMIT)
}

/// Solves, and demands an optimum.
fn optimum(solver: &mut ActiveSet, problem: &Problem) -> (DVector<f64>, Outcome) {
    let mut x = DVector::zeros(problem.centre.len());
    let outcome = solver.solve(&problem.centre, &problem.offsets, x.as_mut_slice());
    assert_eq!(outcome.verdict, Verdict::Optimal, "{problem:?}");
    assert_eq!(outcome.active as usize, solver.working_set().members.len());
    (x, outcome)
}

/// `1/2 |x - c|_H^2`, and what the soft rows cost.
fn objective(problem: &Problem, x: &DVector<f64>) -> f64 {
    let way = x - DVector::from_column_slice(&problem.centre);
    let excess = |(i, row): (usize, nalgebra::RowDVector<f64>)| (-(problem.offsets[i] + (row * x)[0])).max(0.0);
    let rows = problem.rows.row_iter().map(|row| row.clone_owned()).enumerate();
    let soft = rows.filter(|(i, _)| problem.softness[*i] > 0.0);
    let cost: f64 = soft.map(|(i, row)| excess((i, row)).powi(2) / problem.softness[i]).sum();
    0.5 * (way.dot(&(&problem.hessian * &way)) + cost)
}

/// By how much `x` leaves the hard rows and the discs.
fn violation(problem: &Problem, x: &DVector<f64>) -> f64 {
    let (rows, discs) = (&problem.rows * x, &problem.discs * x);
    let hard = (0..rows.len()).filter(|i| problem.softness[*i] == 0.0);
    let mut worst = hard.map(|i| -(problem.offsets[i] + rows[i])).fold(0.0, f64::max);
    for (pair, offsets) in discs.as_slice().chunks_exact(2).zip(problem.offsets[rows.len()..].chunks_exact(2)) {
        worst = worst.max((pair[0] + offsets[0]).hypot(pair[1] + offsets[1]) - 1.0);
    }
    worst
}

/// Checks the conditions of Karush, Kuhn and Tucker, with multipliers found by least squares from the constraints that
/// the solver says it held.
///
/// ```text
/// H (x - c) = A' lambda,   lambda >= 0,   b + A x + lambda / w = 0,   nothing violated
/// ```
///
/// Returns the sum of the multipliers: what a unit of violation is worth.
fn check_optimal(problem: &Problem, members: &[Member], x: &DVector<f64>) -> f64 {
    let (n, m) = (x.len(), problem.rows.nrows());
    let lower = problem.hessian.clone().cholesky().unwrap().unpack();
    let pull = lower.tr_mul(&(x - DVector::from_column_slice(&problem.centre)));
    // One column for each member; a soft one brings the row in which it has to pay for its slack.
    let mut columns = DMatrix::zeros(n + members.len(), members.len());
    let mut right = DVector::zeros(n + members.len());
    right.rows_mut(0, n).copy_from(&pull);
    for (k, member) in members.iter().enumerate() {
        let (row, offset, softness) = match *member {
            Member::Row(i) => (problem.rows.row(i).clone_owned(), problem.offsets[i], problem.softness[i]),
            Member::Cut { disc, towards: [cos, sin] } => {
                let pair = |row: usize| (problem.discs.row(2 * disc + row), problem.offsets[m + 2 * disc + row]);
                let ((a, at_a), (b, at_b)) = (pair(0), pair(1));
                (-(a * cos + b * sin), 1.0 - cos * at_a - sin * at_b, 0.0)
            }
        };
        let slack = offset + (&row * x)[0];
        columns.view_mut((0, k), (n, 1)).copy_from(&lower.solve_lower_triangular(&row.transpose()).unwrap());
        if softness > 0.0 {
            columns[(n + k, k)] = f64::sqrt(softness);
            right[n + k] = -slack / f64::sqrt(softness);
        } else {
            assert!(slack.abs() < 1e-8, "{member:?} is held with a slack of {slack:e}");
        }
    }
    let (mut left, mut worth) = (right.clone(), 0.0);
    if !members.is_empty() {
        let qr = columns.clone().qr(); // nalgebra's SVD is wrong on a few of a million of these
        let multipliers = qr.r().solve_upper_triangular(&qr.q().tr_mul(&right)).unwrap();
        left -= &columns * &multipliers;
        worth = multipliers.sum();
        for (column, multiplier) in columns.column_iter().zip(&multipliers) {
            assert!(multiplier * column.norm() > -1e-8 * (1.0 + right.norm()), "a multiplier of {multiplier:e}");
        }
    }
    assert!(left.norm() < 1e-8 * (1.0 + right.norm()), "{:e} of {:e} is carried by nothing", left.norm(), right.norm());
    assert!(violation(problem, x) <= 1e-9, "{:e} violated", violation(problem, x));
    for (i, row) in problem.rows.row_iter().enumerate().filter(|(i, _)| problem.softness[*i] > 0.0) {
        let slack = problem.offsets[i] + (row * x)[0];
        assert!(slack > -1e-9 || members.contains(&Member::Row(i)), "a soft row is violated and does not pay");
    }
    worth
}

/// Demands that two optima cost the same, but for what the violation that is left alone is worth.
fn check_same(problem: &Problem, solver: &ActiveSet, one: &DVector<f64>, other: &DVector<f64>) {
    let worth = check_optimal(problem, &solver.working_set().members, one);
    let costs = [one, other].map(|x| objective(problem, x));
    assert!((costs[0] - costs[1]).abs() <= 1e-9 * (costs[0] + worth), "{costs:?}, {worth:e}");
}

/// `x` in the plane, `H = 1`.
fn plane(rows: DMatrix<f64>, softness: &[f64], discs: DMatrix<f64>, centre: [f64; 2], offsets: &[f64]) -> Problem {
    let (centre, offsets) = (centre.to_vec(), offsets.to_vec());
    Problem { hessian: DMatrix::identity(2, 2), rows, softness: softness.to_vec(), discs, centre, offsets }
}

fn no_rows() -> DMatrix<f64> {
    DMatrix::zeros(0, 2)
}

#[test]
fn a_row_stops_what_goes_through_it() {
    let problem = plane(dmatrix![-1.0, 0.0], &[0.0], no_rows(), [2.0, 0.5], &[1.0]);
    let (x, outcome) = optimum(&mut solver(&problem), &problem);
    assert!((x - DVector::from_vec(vec![1.0, 0.5])).norm() < 1e-15);
    assert_eq!(outcome.active, 1);
}

#[test]
fn a_soft_row_gives_way_by_its_weight() {
    let problem = plane(dmatrix![-1.0, 0.0], &[0.25], no_rows(), [2.0, 0.5], &[1.0]); // w = 4: 1/2 d^2 + 2 (1 - d)^2
    let (x, _) = optimum(&mut solver(&problem), &problem);
    assert!((x - DVector::from_vec(vec![1.2, 0.5])).norm() < 1e-15);
}

#[test]
fn a_disc_is_met_at_its_nearest_point() {
    let problem = plane(no_rows(), &[], dmatrix![1.0, 0.0; 0.0, 1.0], [30.0, -40.0], &[0.0, 0.0]);
    let (x, _) = optimum(&mut solver(&problem), &problem);
    assert!((x - DVector::from_vec(vec![0.6, -0.8])).norm() < 1e-9);
}

#[test]
fn a_stretched_disc_is_met_where_the_normal_passes_through_the_centre() {
    let problem = plane(no_rows(), &[], dmatrix![0.5, 0.0; 0.0, 1e-3], [3.0, 2e3], &[0.0, 0.0]);
    let (x, outcome) = optimum(&mut solver(&problem), &problem);
    let (normal, way) = ([0.25 * x[0], 1e-6 * x[1]], [3.0 - x[0], 2e3 - x[1]]);
    let sine = (normal[0] * way[1] - normal[1] * way[0]) / (normal[0].hypot(normal[1]) * way[0].hypot(way[1]));
    assert!(sine.abs() < 1e-4 && violation(&problem, &x) < 1e-9, "{sine:e}");
    assert!(outcome.iterations <= 12, "{outcome:?}");
}

#[test]
fn an_optimum_inside_is_returned_bit_for_bit() {
    let mut problem = plane(dmatrix![-1.0, 0.0], &[0.0], dmatrix![1.0, 0.0; 0.0, 1.0], [0.1, 0.2], &[1.0, 0.0, 0.0]);
    let mut solver = solver(&problem);
    for centre in [[0.1, 0.2], [5.0, 0.1], [-0.3, 0.7]] {
        problem.centre = centre.to_vec();
        let (x, outcome) = optimum(&mut solver, &problem);
        if centre[0] < 1.0 {
            assert_eq!((x.as_slice(), outcome.iterations, outcome.active), (&centre[..], 0, 0));
        }
    }
}

#[test]
fn a_row_given_twice_and_a_sum_of_rows_are_no_trouble() {
    let rows = dmatrix![-1.0, 0.0; 0.0, -1.0; -1.0, 0.0; -1.0, -1.0; -2.0, 0.0];
    for [one, other] in [[0, 4], [4, 0]] {
        let mut offsets = [1.0, 1.0, 1.0, 2.0, 2.0];
        offsets[one] *= 1.0 - 1e-6;
        let softness = if other == 4 { [0.0; 5] } else { [0.0, 0.0, 0.5, 0.0, 0.0] };
        let problem = plane(rows.clone(), &softness, no_rows(), [3.0, 4.0], &offsets);
        let mut solver = solver(&problem);
        let (x, _) = optimum(&mut solver, &problem);
        check_optimal(&problem, &solver.working_set().members, &x);
        assert!((x - DVector::from_vec(vec![1.0 - 1e-6, 1.0])).norm() < 1e-12);
    }
}

#[test]
fn what_cannot_be_is_said_to_be_infeasible() {
    let disc = dmatrix![1.0, 0.0; 0.0, 1.0];
    let two_discs = dmatrix![1.0, 0.0; 0.0, 1.0; 1.0, 0.0; 0.0, 1.0];
    let corner = dmatrix![1.0, 0.0; 0.0, 1.0; -1.0, -1.0];
    for problem in [
        plane(dmatrix![1.0, 0.0; -1.0, 0.0], &[0.0; 2], no_rows(), [0.0, 0.0], &[-1.0, 0.5]),
        plane(dmatrix![0.0, 0.0], &[0.0], no_rows(), [0.0, 0.0], &[-1.0]),
        plane(corner, &[0.0; 3], no_rows(), [5.0, 3.0], &[0.0, 0.0, -0.1]),
        plane(dmatrix![1.0, 0.0], &[0.0], disc, [0.3, 2.0], &[-1.01, 0.0, 0.0]),
        plane(no_rows(), &[], two_discs, [0.3, 2.0], &[0.0, 0.0, 2.01, 0.0]),
    ] {
        let mut x = [7.0; 2];
        let outcome = solver(&problem).solve(&problem.centre, &problem.offsets, &mut x);
        assert_eq!((outcome.verdict, x), (Verdict::Infeasible, [7.0; 2]), "{problem:?}");
        assert!(outcome.iterations < 40, "{outcome:?}");
    }
}

#[test]
fn what_is_no_number_changes_nothing() {
    let problem = plane(dmatrix![-1.0, 0.0], &[0.0], no_rows(), [2.0, 0.5], &[1.0]);
    let mut solver = solver(&problem);
    optimum(&mut solver, &problem);
    let before = solver.working_set().clone();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut x = [7.0; 2];
        assert_eq!(solver.solve(&[bad, 0.0], &[1.0], &mut x).verdict, Verdict::NotFinite);
        assert_eq!(solver.solve(&[0.0, 0.0], &[bad], &mut x).verdict, Verdict::NotFinite);
        assert_eq!((x, solver.working_set()), ([7.0; 2], &before));
    }
}

#[test]
fn the_limit_on_iterations_is_kept() {
    let mut problem = Problem::draw(&mut uniform(9));
    while solver(&problem).solve(&problem.centre, &problem.offsets, &mut vec![0.0; problem.centre.len()]).iterations < 9
    {
        problem.redraw(&mut uniform(problem.offsets[0].to_bits()));
    }
    for limit in 0..9 {
        let (mut solver, mut x) = (solver(&problem), vec![f64::NAN; problem.centre.len()]);
        solver.max_iterations = limit;
        let outcome = solver.solve(&problem.centre, &problem.offsets, &mut x);
        assert_eq!((outcome.verdict, outcome.iterations), (Verdict::IterationLimit, limit));
        assert!(x.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn a_foreign_working_set_does_no_harm() {
    let problem = Problem::draw(&mut uniform(5));
    let (cold, _) = optimum(&mut solver(&problem), &problem);
    let cut = |disc, cos| Member::Cut { disc, towards: [cos, 0.0] };
    let members = vec![Member::Row(1), Member::Row(1), cut(0, 1.0), cut(0, -1.0), cut(0, f64::NAN), cut(99, 1.0)];
    let mut solver = solver(&problem);
    solver.warm_start(&WorkingSet { members: [members, (0..200).map(Member::Row).collect()].concat() });
    let (warm, _) = optimum(&mut solver, &problem);
    check_same(&problem, &solver, &warm, &cold);
}

proptest! {
    #[test]
    fn random_problems_are_solved_to_the_optimum(seed in any::<u64>()) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let mut solver = solver(&problem);
        for _ in 0..4 {
            let (x, _) = optimum(&mut solver, &problem);
            check_optimal(&problem, &solver.working_set().members, &x);
            problem.redraw(&mut uniform);
        }
    }

    #[test]
    fn a_warm_start_finds_what_a_cold_one_finds(seed in any::<u64>()) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let mut solver = solver(&problem);
        optimum(&mut solver, &problem);
        problem.centre.iter_mut().for_each(|c| *c *= 1.0 + 0.1 * (uniform() - 0.5));
        let (warm, _) = optimum(&mut solver, &problem);
        solver.forget();
        let (cold, _) = optimum(&mut solver, &problem);
        check_same(&problem, &solver, &cold, &warm);
    }

    #[test]
    fn a_restored_working_set_goes_on_bit_for_bit(seed in any::<u64>()) {
        let mut uniform = uniform(seed);
        let mut problem = Problem::draw(&mut uniform);
        let (mut one, mut other) = (solver(&problem), solver(&problem));
        for _ in 0..3 {
            other.warm_start(&one.working_set().clone());
            prop_assert_eq!(optimum(&mut one, &problem), optimum(&mut other, &problem));
            prop_assert_eq!(one.working_set(), other.working_set());
            problem.redraw(&mut uniform);
        }
    }
}
