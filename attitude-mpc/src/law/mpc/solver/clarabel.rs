//! Solution by Clarabel, an interior-point solver with native second-order cones for the discs.
//!
//! The problem is solved in two stages, each with a Clarabel of its own that is set up once and updated each tick:
//! first without the state limits, then with the state limits, but only if the first plan violates one. Most ticks need
//! only the first stage, which has half the size.
//!
//! `H` has a condition number of millions. Clarabel gets `V = D U` with `D = diag(H)^(1/2)`, excesses times the root of
//! their weight, and rows of length one. Clarabel's own equilibration and iterative refinement are then needless and
//! off, which halves its time.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus, SupportedConeT,
};
use nalgebra::{DMatrix, DVector, DVectorViewMut, RowDVector};
use settings::FaultKind;

use super::outcome::{CONTRADICTION, SolveLimits, SolveOutcome, SolveVerdict};
use crate::law::mpc::constraints::{PlanSet, STATE_PENALTY, StateLimits};

/// Tolerance of gap and feasibility: the error of the first move is below 1 mN.
const TOLERANCE: f64 = 1e-9;
/// Accepted tolerance if rounding keeps the solver from [`TOLERANCE`], as in one of 6000 violent problems.
const REDUCED_TOLERANCE: f64 = 1e-7;
/// Excess of a state, as a share of its limit, that is ignored.
const NEGLIGIBLE_EXCESS: f64 = 1e-9;

/// Clarabel solvers of one problem: without the state limits, and with them if there are any.
pub struct ConicSolver {
    moves: Stage,
    everything: Option<Stage>,
}

/// Clarabel with the numbers that change from tick to tick.
struct Stage {
    clarabel: DefaultSolver<f64>,
    /// Matrix `-D^-1 H`, from `U*` to the linear term.
    linear: DMatrix<f64>,
    /// Diagonal of `D`.
    scale: DVector<f64>,
    /// Linear term of the cost.
    q: Vec<f64>,
    /// Slacks at `U = 0`.
    b: Vec<f64>,
    /// Index of the first row of the states in `b`, and the length by which each pair of rows was divided.
    states: (usize, Vec<f64>),
    limits: SolveLimits,
    /// `true` if a fault limits the solver to one iteration.
    capped: bool,
}

impl ConicSolver {
    /// Sets up the problem with the Hessian `H` (4Nu x 4Nu).
    ///
    /// # Panics
    /// If Clarabel refuses the set-up, which it does not for finite matrices of matching sizes.
    pub fn new(hessian: &DMatrix<f64>, set: &PlanSet, limits: SolveLimits) -> Self {
        let moves_only = PlanSet { moves: set.moves.clone(), states: None };
        Self {
            moves: Stage::new(hessian, &moves_only, limits),
            everything: set.states.as_ref().map(|_| Stage::new(hessian, set, limits)),
        }
    }

    /// Time of the last solve of the first stage, as compared with the time limit \[s\].
    #[cfg(test)]
    pub fn seen_s(&self) -> f64 {
        self.moves.clarabel.solution.solve_time
    }

    /// Solves as [`super::Solver::solve`].
    pub fn solve(
        &mut self,
        unconstrained: &DVector<f64>,
        set: &mut PlanSet,
        fault: Option<FaultKind>,
        plan: &mut DVector<f64>,
    ) -> SolveOutcome {
        let first = self.moves.solve(unconstrained, None, fault, plan);
        match &mut self.everything {
            Some(everything) if first.verdict == SolveVerdict::Solved && set.excess(plan) > NEGLIGIBLE_EXCESS => {
                let second = everything.solve(unconstrained, set.states.as_ref(), fault, plan);
                SolveOutcome { iterations: first.iterations + second.iterations, ..second }
            }
            _ => first,
        }
    }
}

impl Stage {
    fn new(hessian: &DMatrix<f64>, set: &PlanSet, limits: SolveLimits) -> Self {
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
        clarabel.solve(); // the first solve allocates memory that later ones reuse
        Self { clarabel, linear, scale, q, b: rows.b, states: rows.states, limits, capped: false }
    }

    fn solve(
        &mut self,
        unconstrained: &DVector<f64>,
        states: Option<&StateLimits>,
        fault: Option<FaultKind>,
        plan: &mut DVector<f64>,
    ) -> SolveOutcome {
        let moves = self.scale.len();
        DVectorViewMut::from_slice(&mut self.q[..moves], moves).gemv(1.0, &self.linear, unconstrained, 0.0);
        if let Some(states) = states {
            let pairs = self.b[self.states.0..].chunks_exact_mut(2);
            for ((pair, y), length) in pairs.zip(&states.drift).zip(&self.states.1) {
                pair.copy_from_slice(&[(1.0 - y) / length, (1.0 + y) / length]);
            }
        }
        let updated = self.tell(fault);
        // Clarabel's timers would count set-up and earlier post-processing against the time limit.
        if let Some(timers) = &mut self.clarabel.timers {
            timers.reset_timer("setup");
            timers.reset_timer("post-process");
        }
        self.clarabel.solve();

        let solution = &self.clarabel.solution;
        let verdict = match solution.status {
            _ if !updated => SolveVerdict::Failed,
            SolverStatus::Solved | SolverStatus::AlmostSolved => SolveVerdict::Solved,
            SolverStatus::MaxIterations | SolverStatus::MaxTime => SolveVerdict::LimitReached,
            _ => SolveVerdict::Failed,
        };
        if verdict != SolveVerdict::Failed {
            plan.copy_from_slice(&solution.x[..moves]);
            plan.component_div_assign(&self.scale);
        }
        SolveOutcome { verdict, iterations: u64::from(solution.iterations) }
    }

    /// Updates Clarabel with the numbers of this tick, altered by an active `fault`. Returns whether Clarabel accepted
    /// the numbers.
    fn tell(&mut self, fault: Option<FaultKind>) -> bool {
        let capped = fault == Some(FaultKind::IterationCap);
        if capped != self.capped {
            self.capped = capped;
            let iterations = if capped { 1 } else { self.limits.iterations };
            let settings = settings(SolveLimits { iterations, ..self.limits });
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

fn settings(limits: SolveLimits) -> DefaultSettings<f64> {
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
        presolve_enable: false, // presolve does not allow updates of the numbers
        ..DefaultSettings::default()
    }
}

/// Upper triangle of `D^-1 H D^-1` for the moves, with 1 for each excess.
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

/// Slacks `s = b - A (V; e)` and their cones: all linear rows first, then the discs.
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
                // The rows of a disc must keep their proportions, so all are divided by the same length.
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

    /// Appends `1 - y + e >= 0` and `1 + y + e >= 0` for each limited state, with one excess for both.
    fn push_states(&mut self, states: &StateLimits, scale: &DVector<f64>) {
        let price = STATE_PENALTY.sqrt();
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

    /// Appends a row with `slope` on the variables from `first` on, and the slack `at_zero`.
    fn push<'a>(&mut self, first: usize, slope: impl Iterator<Item = &'a f64>, at_zero: f64) {
        slope.enumerate().for_each(|(i, slope)| self.slopes.push(self.b.len(), first + i, -slope));
        self.b.push(at_zero);
    }
}

/// Builder of a sparse matrix; zeros are left out.
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
