//! Solution by the dual active-set method of [`qp`].

use nalgebra::{DMatrix, DVector};
use qp::{ActiveSet, HeldConstraint, WorkingSet};
use settings::FaultKind;

use super::outcome::{CONTRADICTION, SolveOutcome, SolveVerdict};
use crate::law::mpc::constraints::{PlanSet, STATE_PENALTY};
use crate::memory::WarmStart;

/// Active-set solver that is set up for one problem.
pub struct ActiveSetSolver {
    solver: ActiveSet,
    max_iterations: u32,
    /// Unconstrained optimum `U*`, with a NaN under the fault `nan`, 4Nu.
    centre: Vec<f64>,
    /// Slacks at `U = 0`: linear rows move by move, two rows per limited state, two rows per disc.
    offsets: Vec<f64>,
    /// Index of the first row of the states.
    first_state: usize,
    /// Index of the first row of the discs.
    first_disc: usize,
}

impl ActiveSetSolver {
    /// Sets up the problem with the Hessian `H` (4Nu x 4Nu).
    pub fn new(hessian: &DMatrix<f64>, set: &PlanSet, max_iterations: u32) -> Self {
        let variables = hessian.nrows();
        let moves = variables / 4;
        let (linear, states) =
            (set.moves.linear.len() * moves, set.states.as_ref().map_or(0, |s| 2 * s.forced.nrows()));
        let pairs = set.moves.disc.iter().flatten();
        let (mut rows, mut discs) = (DMatrix::zeros(linear + states, variables), DMatrix::zeros(0, variables));
        let mut offsets = vec![];
        for first in 0..moves {
            for row in &set.moves.linear {
                rows.fixed_view_mut::<1, 4>(offsets.len(), 4 * first).copy_from(&row.slope.transpose());
                offsets.push(row.offset);
            }
        }
        let mut softness = vec![0.0; linear];
        if let Some(limits) = &set.states {
            for y in limits.forced.row_iter() {
                for sign in [-1.0, 1.0] {
                    rows.row_mut(offsets.len()).copy_from(&(y * sign));
                    offsets.push(1.0);
                    softness.push(1.0 / STATE_PENALTY);
                }
            }
        }
        for first in 0..moves {
            for row in pairs.clone() {
                let at = discs.nrows();
                discs = discs.insert_row(at, 0.0);
                discs.fixed_view_mut::<1, 4>(at, 4 * first).copy_from(&row.slope.transpose());
                offsets.push(row.offset);
            }
        }
        let solver = ActiveSet::new(hessian, &rows, &softness, &discs, max_iterations);
        Self {
            solver,
            max_iterations,
            centre: vec![0.0; variables],
            offsets,
            first_state: linear,
            first_disc: linear + states,
        }
    }

    /// Solves as [`super::Solver::solve`].
    pub fn solve(
        &mut self,
        unconstrained: &DVector<f64>,
        set: &PlanSet,
        fault: Option<FaultKind>,
        plan: &mut DVector<f64>,
    ) -> SolveOutcome {
        self.centre.copy_from_slice(unconstrained.as_slice());
        if let Some(states) = &set.states {
            for (pair, y) in self.offsets[self.first_state..].chunks_exact_mut(2).zip(&states.drift) {
                pair.copy_from_slice(&[1.0 - y, 1.0 + y]);
            }
        }
        if fault == Some(FaultKind::Nan) {
            self.centre[0] = f64::NAN;
        }
        let honest = self.offsets[0];
        if fault == Some(FaultKind::Infeasible) {
            self.offsets[0] -= CONTRADICTION;
        }
        self.solver.max_iterations = if fault == Some(FaultKind::IterationCap) { 1 } else { self.max_iterations };
        let outcome = self.solver.solve(&self.centre, &self.offsets, plan.as_mut_slice());
        self.offsets[0] = honest;
        if self.packed().is_none() {
            self.solver.forget(); // a process that restores a snapshot has no warm start either
        }

        let verdict = match outcome.termination {
            qp::Termination::Optimal => SolveVerdict::Solved,
            qp::Termination::IterationLimit => SolveVerdict::LimitReached,
            qp::Termination::Infeasible | qp::Termination::NotFinite => SolveVerdict::Failed,
        };
        SolveOutcome { verdict, iterations: u64::from(outcome.iterations) }
    }

    /// Constraints that the next solve starts from.
    pub fn warm_start(&self) -> WarmStart {
        self.packed().unwrap_or_default()
    }

    /// Working set as in a snapshot; `None` if it has more members than a snapshot has room for.
    fn packed(&self) -> Option<WarmStart> {
        let members = &self.solver.working_set().members;
        let mut start = WarmStart { count: members.len() as u64, ..WarmStart::default() };
        let mut touches = start.towards.iter_mut();
        let mut places = start.places.as_flattened_mut().iter_mut();
        for member in members {
            let place = match member {
                HeldConstraint::Row(row) => *row,
                HeldConstraint::Cut { disc, towards } => {
                    *touches.next()? = *towards;
                    self.first_disc + disc
                }
            };
            *places.next()? = place.try_into().ok()?;
        }
        Some(start)
    }

    /// Makes the next solve start from the constraints of `from`. Returns `false`, and changes nothing, if a constraint
    /// is unknown to this set-up or occurs twice, or if `from` counts more constraints than it has room for.
    pub fn start_from(&mut self, from: &WarmStart) -> bool {
        let discs = (self.offsets.len() - self.first_disc) / 2;
        let mut free = vec![true; self.first_disc + discs];
        let mut touches = from.towards.iter();
        let Some(places) = from.places.as_flattened().get(..from.count as usize) else { return false };
        let member = |place: &u16| {
            let place = usize::from(*place);
            let is_new = free.get_mut(place).is_some_and(std::mem::take);
            is_new.then_some(())?;
            match place.checked_sub(self.first_disc) {
                None => Some(HeldConstraint::Row(place)),
                Some(disc) => Some(HeldConstraint::Cut { disc, towards: *touches.next()? }),
            }
        };
        let members: Option<Vec<HeldConstraint>> = places.iter().map(member).collect();
        members.map(|members| self.solver.warm_start(&WorkingSet { members })).is_some()
    }
}
