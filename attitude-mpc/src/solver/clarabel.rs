//! The problem by Clarabel, an interior-point solver that takes the disc natively.
//!
//! In stages, each a solver of its own that is set up once and told new numbers each time: first the moves alone, and
//! only when that plan leaves a state limit, everything. The first is all that most ticks need, and half the size.
//!
//! `H` has a condition number of millions. The solver sees `V = D U` with `D = diag(H)^(1/2)`, excesses in the root of
//! their price, and rows of length one. That leaves nothing to do for its own equilibration and its iterative
//! refinement: both are off, which halves its time.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus, SupportedConeT,
};
use contract::scenario::FaultKind;
use nalgebra::{DMatrix, DVector, DVectorViewMut, RowDVector};

use super::outcome::{CONTRADICTION, Limits, Outcome, Verdict};
use crate::constraints::{PlanSet, StateLimits};

/// Gap and feasibility asked of the solver: what is left of the first move is below 1 mN.
const TOLERANCE: f64 = 1e-9;
/// What is still an optimum when rounding keeps the solver from its tolerance, as in one of 6000 violent problems.
const REDUCED_TOLERANCE: f64 = 1e-7;
/// Excess of a state, as a share of its limit, that is left as it is.
const NEGLIGIBLE_EXCESS: f64 = 1e-9;

/// The solver of one set-up.
pub struct ConicSolver {
    moves: Stage,
    everything: Option<Stage>,
}

/// One Clarabel, with the numbers that change from tick to tick.
struct Stage {
    clarabel: DefaultSolver<f64>,
    /// `-D^-1 H`: from `U*` to the linear term.
    linear: DMatrix<f64>,
    /// `D`, as a vector.
    scale: DVector<f64>,
    /// The linear term.
    q: Vec<f64>,
    /// The slacks at `U = 0`.
    b: Vec<f64>,
    /// Where the rows of the states begin in `b`, and by what each pair of them was divided.
    states: (usize, Vec<f64>),
    limits: Limits,
    /// Whether a fault holds it to one iteration.
    capped: bool,
}

impl ConicSolver {
    /// Sets up the problem with the Hessian `H` (4Nu x 4Nu).
    ///
    /// # Panics
    /// When Clarabel refuses the set-up; with finite matrices of matching sizes it has no reason to.
    pub fn new(hessian: &DMatrix<f64>, set: &PlanSet, limits: Limits) -> Self {
        let moves_only = PlanSet { moves: set.moves.clone(), states: None };
        Self {
            moves: Stage::new(hessian, &moves_only, limits),
            everything: set.states.as_ref().map(|_| Stage::new(hessian, set, limits)),
        }
    }

    /// Time of the last solve of the moves, as the time limit saw it \[s\].
    #[cfg(test)]
    pub fn seen_s(&self) -> f64 {
        self.moves.clarabel.solution.solve_time
    }

    /// See [`super::Solver::solve`].
    pub fn solve(
        &mut self,
        unconstrained: &DVector<f64>,
        set: &mut PlanSet,
        fault: Option<FaultKind>,
        plan: &mut DVector<f64>,
    ) -> Outcome {
        let first = self.moves.solve(unconstrained, None, fault, plan);
        match &mut self.everything {
            Some(everything) if first.verdict == Verdict::Solved && set.excess(plan) > NEGLIGIBLE_EXCESS => {
                let second = everything.solve(unconstrained, set.states.as_ref(), fault, plan);
                Outcome { iterations: first.iterations + second.iterations, ..second }
            }
            _ => first,
        }
    }
}

impl Stage {
    fn new(hessian: &DMatrix<f64>, set: &PlanSet, limits: Limits) -> Self {
        let scale = hessian.diagonal().map(f64::sqrt);
        let mut linear = -hessian;
        linear.row_iter_mut().zip(scale.iter()).for_each(|(mut row, d)| row /= *d);

        let rows = Rows::of(set, &scale);
        let variables = scale.len() + rows.states.1.len();
        let p = scaled_hessian(hessian, &scale, variables);
        let a = rows.slopes.into_matrix(rows.b.len(), variables);
        let q = vec![0.0; variables];
        let mut clarabel = DefaultSolver::new(&p, &q, &a, &rows.b, &rows.cones, settings(limits))
            .expect("matrices and cones are built to match");
        clarabel.solve(); // the first solve fetches memory that later ones reuse: not in flight
        Self { clarabel, linear, scale, q, b: rows.b, states: rows.states, limits, capped: false }
    }

    fn solve(
        &mut self,
        unconstrained: &DVector<f64>,
        states: Option<&StateLimits>,
        fault: Option<FaultKind>,
        plan: &mut DVector<f64>,
    ) -> Outcome {
        let moves = self.scale.len();
        DVectorViewMut::from_slice(&mut self.q[..moves], moves).gemv(1.0, &self.linear, unconstrained, 0.0);
        if let Some(states) = states {
            let pairs = self.b[self.states.0..].chunks_exact_mut(2);
            for ((pair, y), length) in pairs.zip(&states.drift).zip(&self.states.1) {
                pair.copy_from_slice(&[(1.0 - y) / length, (1.0 + y) / length]);
            }
        }
        let updated = self.tell(fault);
        // Its clock would count the set-up and all the post-processing so far against the time limit.
        if let Some(timers) = &mut self.clarabel.timers {
            timers.reset_timer("setup");
            timers.reset_timer("post-process");
        }
        self.clarabel.solve();

        let solution = &self.clarabel.solution;
        let verdict = match solution.status {
            _ if !updated => Verdict::Failed,
            SolverStatus::Solved | SolverStatus::AlmostSolved => Verdict::Solved,
            SolverStatus::MaxIterations | SolverStatus::MaxTime => Verdict::LimitReached,
            _ => Verdict::Failed,
        };
        if verdict != Verdict::Failed {
            plan.copy_from_slice(&solution.x[..moves]);
            plan.component_div_assign(&self.scale);
        }
        Outcome { verdict, iterations: u64::from(solution.iterations) }
    }

    /// Tells Clarabel the numbers of this tick, changed when a `fault` is active. Returns whether it took them.
    fn tell(&mut self, fault: Option<FaultKind>) -> bool {
        let capped = fault == Some(FaultKind::IterationCap);
        if capped != self.capped {
            self.capped = capped;
            let iterations = if capped { 1 } else { self.limits.iterations };
            let settings = settings(Limits { iterations, ..self.limits });
            if self.clarabel.update_settings(settings).is_err() {
                return false;
            }
        }
        if fault == Some(FaultKind::Nan) {
            self.q[0] = f64::NAN;
        }
        let honest = self.b[0];
        if fault == Some(FaultKind::Infeasible) {
            self.b[0] -= CONTRADICTION;
        }
        let updated = self.clarabel.update_q(&self.q).is_ok() && self.clarabel.update_b(&self.b).is_ok();
        self.b[0] = honest;
        updated
    }
}

fn settings(limits: Limits) -> DefaultSettings<f64> {
    DefaultSettings {
        max_iter: limits.iterations,
        time_limit: limits.time_s,
        verbose: false,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        reduced_tol_gap_abs: REDUCED_TOLERANCE,
        reduced_tol_gap_rel: REDUCED_TOLERANCE,
        reduced_tol_feas: REDUCED_TOLERANCE,
        equilibrate_enable: false,
        iterative_refinement_enable: false,
        direct_solve_method: "qdldl".into(),
        presolve_enable: false, // it would refuse the new numbers of each tick
        ..DefaultSettings::default()
    }
}

/// `D^-1 H D^-1` on the moves and one on each excess, its upper triangle.
fn scaled_hessian(hessian: &DMatrix<f64>, scale: &DVector<f64>, variables: usize) -> CscMatrix<f64> {
    let mut p = Triplets::default();
    for column in 0..scale.len() {
        for row in 0..=column {
            p.push(row, column, hessian[(row, column)] / (scale[row] * scale[column]));
        }
    }
    (scale.len()..variables).for_each(|excess| p.push(excess, excess, 1.0));
    p.into_matrix(variables, variables)
}

/// The slacks `s = b - A (V; e)`, and the cones they are in: all linear rows first, then the discs.
#[derive(Default)]
struct Rows {
    slopes: Triplets,
    b: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
    states: (usize, Vec<f64>),
}

impl Rows {
    fn of(set: &PlanSet, scale: &DVector<f64>) -> Self {
        let mut rows = Self::default();
        let slope_of = |row: &airframe::demand_set::Slack, first: usize| {
            row.slope.component_div(&scale.fixed_rows::<4>(first)).transpose()
        };
        for first in (0..scale.len()).step_by(4) {
            for row in &set.moves.linear {
                let slope = slope_of(row, first);
                let length = slope.norm();
                rows.push(first, (slope / length).iter(), row.offset / length);
            }
        }
        rows.states.0 = rows.b.len();
        if let Some(states) = &set.states {
            rows.push_states(states, scale);
        }
        rows.cones.push(NonnegativeConeT(rows.b.len()));
        if let Some(disc) = &set.moves.disc {
            for first in (0..scale.len()).step_by(4) {
                let slopes = disc.map(|row| slope_of(&row, first));
                // The rows of a disc must keep their proportions, so they are divided by the same.
                let length = slopes[0].norm().max(slopes[1].norm());
                rows.b.push(1.0 / length);
                for (row, slope) in disc.iter().zip(&slopes) {
                    rows.push(first, (slope / length).iter(), row.offset / length);
                }
                rows.cones.push(SecondOrderConeT(3));
            }
        }
        rows
    }

    /// `1 - y + e >= 0` and `1 + y + e >= 0` for each limited state, with one excess for both.
    fn push_states(&mut self, states: &StateLimits, scale: &DVector<f64>) {
        let price = states.penalty.sqrt();
        for (excess, y) in states.forced.row_iter().enumerate() {
            let slope: RowDVector<f64> = y.component_div(&scale.transpose());
            let length = libm::hypot(slope.norm(), 1.0 / price);
            for sign in [-1.0, 1.0] {
                self.slopes.push(self.b.len(), scale.len() + excess, -1.0 / (price * length));
                self.push(0, (&slope * (sign / length)).iter(), 1.0 / length);
            }
            self.states.1.push(length);
        }
    }

    /// One row: `slope` on the variables from `first` on, and the slack at zero.
    fn push<'a>(&mut self, first: usize, slope: impl Iterator<Item = &'a f64>, at_zero: f64) {
        slope.enumerate().for_each(|(i, slope)| self.slopes.push(self.b.len(), first + i, -slope));
        self.b.push(at_zero);
    }
}

/// A sparse matrix in the making; zeros are left out.
#[derive(Default)]
struct Triplets {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Triplets {
    fn push(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.rows.push(row);
            self.columns.push(column);
            self.values.push(value);
        }
    }

    fn into_matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values)
    }
}
