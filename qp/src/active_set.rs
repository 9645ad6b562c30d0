//! The solver: the ascent of the dual objective and its steps.

use nalgebra::DMatrix;

use crate::basis::{Basis, Combination};
use crate::factor::CholeskyFactor;
use crate::working_set::{HeldConstraint, WorkingSet};

/// Accepted violation, in units of the slacks.
const TOLERANCE: f64 = 5e-10;
/// Ratio of the dual objective to that of the first violated constraint alone, above which no point counts as feasible.
const UNBOUNDED: f64 = 1e12;

/// Bound on all numbers: the dual objective contains their squares, and a turn their fourth powers.
const MAX_MAGNITUDE: f64 = 1e50;

/// Dual objective above which most of the value is rounding.
const MAX_EXACT_DUAL: f64 = 1e10;

/// Share of a constraint's square that must remain after elimination for it to be independent of the others.
const INDEPENDENT: f64 = 1e-11;
/// Square of a member's part in a dependent constraint, relative to the square of the constraint, below which the part
/// is rounding.
const ROUNDING: f64 = 1e-20;
/// Share of the linearly predicted ascent that a turn must reach.
const ARMIJO: f64 = 0.1;
/// Largest number of times that a turn is shortened.
const HALVINGS: u32 = 40;
/// Share of the sum of all `|l_i M_ij l_j|` by which rounding may lower the dual: a Cholesky factor and its solves are
/// exact for a matrix whose entries differ from `M` by about 1e-16 times the number of members, relatively.
const DUAL_ROUNDING: f64 = 1e-13;

/// Solver of one set-up.
pub struct ActiveSet {
    /// Largest number of steps of a solve.
    pub max_iterations: u32,
    basis: Basis,
    working_set: WorkingSet,
    /// Constraints of the members of the working set.
    held: Vec<Combination>,
    /// Multipliers of the members, never negative.
    multipliers: Vec<f64>,
    /// Factor of the members' Gram matrix.
    factor: CholeskyFactor,
    /// Step of the multipliers.
    step: Vec<[f64; 4]>,
    /// `true` for every held row, and after the rows for every held disc.
    is_held: Vec<bool>,
    /// Centre c.
    centre: Vec<[f64; 4]>,
    /// Variables x at the present multipliers.
    x: Vec<[f64; 4]>,
    /// Values of the basis rows at `x`.
    slacks: Vec<[f64; 4]>,
    /// Values of the basis rows at the centre.
    at_centre: Vec<[f64; 4]>,
    /// Indices of the held tangents that turn.
    turning: Vec<usize>,
    /// Tangents that have turned and join again, with their multipliers.
    turned: Vec<(HeldConstraint, f64)>,
}

/// Result of a solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// Reason for which the solve ended.
    pub termination: Termination,
    /// Number of steps: each solves the equations of one working set.
    pub iterations: u32,
    /// Number of constraints held at the end.
    pub active: u32,
}

/// Reason for which a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// `x` is the optimum.
    Optimal,
    /// `x` is the last iterate, which is not feasible.
    IterationLimit,
    /// No `x` satisfies all hard constraints.
    Infeasible,
    /// An input is NaN, or an input or a result is too large.
    NotFinite,
}

impl ActiveSet {
    /// Sets up the problem: the Hessian `H` (n x n, positive definite), the linear `rows` (m x n) with their `softness`
    /// (m numbers: 0 is hard, else `1/w`), and the rows of the `discs` (2k x n, one pair each).
    ///
    /// # Panics
    /// If the sizes do not match, or `H` is not positive definite.
    pub fn new(
        hessian: &DMatrix<f64>,
        rows: &DMatrix<f64>,
        softness: &[f64],
        discs: &DMatrix<f64>,
        max_iterations: u32,
    ) -> Self {
        let basis = Basis::new(hessian, rows, softness, discs);
        // Hard members are independent, so there are at most n; soft rows may depend on each other.
        let soft = softness.iter().filter(|softness| **softness > 0.0).count();
        let members = (basis.variables + soft).min(basis.rows + basis.discs);
        let capacity = members + basis.discs;
        Self {
            max_iterations,
            working_set: WorkingSet { members: Vec::with_capacity(members) },
            held: Vec::with_capacity(capacity),
            multipliers: Vec::with_capacity(capacity),
            factor: CholeskyFactor::new(capacity),
            step: vec![[0.0; 4]; capacity.div_ceil(4)],
            is_held: vec![false; basis.rows + basis.discs],
            centre: vec![[0.0; 4]; basis.blocks],
            x: vec![[0.0; 4]; basis.blocks],
            slacks: vec![[0.0; 4]; basis.len().div_ceil(4)],
            at_centre: vec![[0.0; 4]; basis.len().div_ceil(4)],
            turning: Vec::with_capacity(basis.discs),
            turned: Vec::with_capacity(basis.discs),
            basis,
        }
    }

    /// Working set of the last solve, from which the next one starts.
    pub fn working_set(&self) -> &WorkingSet {
        &self.working_set
    }

    /// Makes the next solve start from the working set of another solver of the same set-up.
    pub fn warm_start(&mut self, from: &WorkingSet) {
        self.working_set.members.clear();
        self.working_set.members.extend_from_slice(&from.members);
    }

    /// Makes the next solve start without a working set.
    pub fn forget(&mut self) {
        self.working_set.members.clear();
    }

    /// Solves for a `centre` (n) and `offsets` (m + 2k: the rows, then the pairs of the discs). Writes `x` (n) if the
    /// termination is `Optimal` or `IterationLimit`, else leaves it unchanged.
    pub fn solve(&mut self, centre: &[f64], offsets: &[f64], x: &mut [f64]) -> Outcome {
        let is_near = |numbers: &[f64]| numbers.iter().all(|number| number.abs() < MAX_MAGNITUDE); // false for NaN
        let mut outcome = Outcome { termination: Termination::NotFinite, iterations: 0, active: 0 };
        if !is_near(centre) || !is_near(offsets) {
            return outcome;
        }
        self.centre.as_flattened_mut()[..centre.len()].copy_from_slice(centre);
        self.x.copy_from_slice(&self.centre);
        self.basis.slacks(&self.x, offsets, &mut self.slacks);
        if let Some((_, most)) = self.worst() {
            self.at_centre.copy_from_slice(&self.slacks);
            self.resume();
            let first = 0.5 * most * most;
            (outcome.termination, outcome.iterations) = self.ascend(offsets, first);
            outcome.active = self.held.len() as u32;
            if first > MAX_EXACT_DUAL {
                self.forget(); // a working set found by rounding is no good start
            }
        } else {
            self.forget();
            outcome.termination = Termination::Optimal;
        }
        if !is_near(self.x.as_flattened()) {
            self.forget();
            outcome.termination = Termination::NotFinite;
        }
        if matches!(outcome.termination, Termination::Optimal | Termination::IterationLimit) {
            x.copy_from_slice(&self.x.as_flattened()[..x.len()]);
        }
        outcome
    }

    /// Ascends until no constraint is violated; `first` is the dual objective of the first violated constraint alone.
    fn ascend(&mut self, offsets: &[f64], first: f64) -> (Termination, u32) {
        for iteration in 1..=self.max_iterations {
            let before = self.objective();
            if before.is_nan() || before > UNBOUNDED * first {
                return (Termination::Infeasible, iteration);
            }
            let arrived = self.step(offsets);
            self.check_invariants();
            if !arrived {
                continue;
            }
            self.check_rise(before, first);
            let possible = match self.worst() {
                None => return (Termination::Optimal, iteration),
                Some((HeldConstraint::Cut { disc, .. }, _)) if self.is_held[self.basis.rows + disc] => {
                    self.turn(offsets)
                }
                Some((HeldConstraint::Row(row), _)) if self.is_held[row] => true, // rounding: the next step corrects it
                Some((member, _)) => self.join(member, 0.0, offsets),
            };
            if !possible {
                return (Termination::Infeasible, iteration);
            }
        }
        (Termination::IterationLimit, self.max_iterations)
    }

    /// Constraint violated most, in the norm of `H^-1`, and its violation; `None` if all hold. A disc is represented by
    /// its tangent towards the present point.
    fn worst(&self) -> Option<(HeldConstraint, f64)> {
        let (rows, pairs) = self.slacks.as_flattened()[..self.basis.len()].split_at(self.basis.rows);
        let (mut worst, mut most) = (None, 0.0);
        for (row, (slack, scale)) in rows.iter().zip(&self.basis.scale).enumerate() {
            if *slack < -TOLERANCE && -slack * scale > most {
                (worst, most) = (Some(HeldConstraint::Row(row)), -slack * scale);
            }
        }
        for (disc, pair) in pairs.chunks_exact(2).enumerate() {
            let length = (pair[0] * pair[0] + pair[1] * pair[1]).sqrt();
            if length - 1.0 > TOLERANCE {
                let member = HeldConstraint::Cut { disc, towards: [pair[0] / length, pair[1] / length] };
                let size = (length - 1.0) / self.basis.square(&self.basis.constraint(member)).sqrt();
                if size > most {
                    (worst, most) = (Some(member), size);
                }
            }
        }
        worst.map(|member| (member, most))
    }

    /// Restores the working set of the last solve with zero multipliers; dependent members are dropped.
    fn resume(&mut self) {
        self.held.clear();
        self.multipliers.clear();
        self.factor.truncate(0);
        self.is_held.fill(false);
        let mut next = 0;
        while let Some(member) = self.working_set.members.get(next).copied() {
            let constraint = self.basis.constraint(member);
            if self.extend(&constraint) {
                let place = self.place(member);
                self.is_held[place] = true;
                self.held.push(constraint);
                self.multipliers.push(0.0);
                next += 1;
            } else {
                self.working_set.members.remove(next);
            }
        }
    }

    /// Moves to the optimum of the working set. Returns `false` if a multiplier became zero first, and its member was
    /// dropped.
    fn step(&mut self, offsets: &[f64]) -> bool {
        self.aim();
        let steps = self.step.as_flattened();
        let mut first: Option<(f64, usize)> = None;
        for (j, (multiplier, step)) in self.multipliers.iter().zip(steps).enumerate() {
            if multiplier + step <= 0.0 {
                let share = if *step < 0.0 { -multiplier / step } else { 0.0 };
                if first.is_none_or(|(s, i)| share < s || (share == s && *step < steps[i])) {
                    first = Some((share, j));
                }
            }
        }
        let (share, blocking) = first.map_or((1.0, None), |(share, j)| (share, Some(j)));
        if share > 0.0 {
            self.advance(share);
        }
        if let Some(j) = blocking {
            self.remove(j);
            self.rebuild(j);
        }
        if share > 0.0 {
            self.observe(offsets);
        }
        blocking.is_none()
    }

    /// Writes the step that brings every held slack to zero; returns the slope of the dual along it.
    fn aim(&mut self) -> f64 {
        for (right, held) in self.step.as_flattened_mut().iter_mut().zip(&self.held) {
            *right = -held.slack(self.slacks.as_flattened());
        }
        self.factor.solve(&mut self.step)
    }

    /// Moves the multipliers, and `x` with them, by a share of the step.
    fn advance(&mut self, share: f64) {
        for ((held, multiplier), step) in self.held.iter().zip(&mut self.multipliers).zip(self.step.as_flattened()) {
            self.basis.push(&mut self.x, held, share * step);
            *multiplier = (*multiplier + share * step).max(0.0);
        }
    }

    /// Computes the slacks at `x`; the slack of a held soft row includes the excess of the row.
    fn observe(&mut self, offsets: &[f64]) {
        self.basis.slacks(&self.x, offsets, &mut self.slacks);
        for ((member, held), multiplier) in self.working_set.members.iter().zip(&self.held).zip(&self.multipliers) {
            if let HeldConstraint::Row(row) = member {
                self.slacks.as_flattened_mut()[*row] += held.softness * multiplier;
            }
        }
    }

    /// Adds a constraint with its `multiplier`. Returns `false` if the constraint depends on held ones, and no point
    /// satisfies all of them.
    ///
    /// A constraint that depends on held ones replaces one of them: the new multiplier grows while those of the held
    /// ones shrink, until the first is zero and its constraint is dropped. A dependent constraint that is satisfied
    /// gives its multiplier to the held ones in the same way, because the dual would fall if the multiplier were lost.
    fn join(&mut self, member: HeldConstraint, mut multiplier: f64, offsets: &[f64]) -> bool {
        let constraint = self.basis.constraint(member);
        let size = self.basis.square(&constraint);
        let mut moved = false;
        while !self.extend(&constraint) {
            self.factor.composition(&mut self.step);
            let sign = if constraint.slack(self.slacks.as_flattened()) < -TOLERANCE { 1.0 } else { -1.0 };
            let first = self.first_exhausted(size, sign);
            if sign < 0.0 && first.is_none_or(|(step, _)| step >= multiplier) {
                self.advance(multiplier);
                self.basis.push(&mut self.x, &constraint, -multiplier);
                self.observe(offsets);
                return true;
            }
            let Some((step, blocking)) = first else { return false };
            self.advance(-sign * step);
            self.basis.push(&mut self.x, &constraint, sign * step);
            multiplier += sign * step;
            moved = true;
            self.remove(blocking);
            self.rebuild(blocking);
        }
        let place = self.place(member);
        self.is_held[place] = true;
        self.working_set.members.push(member);
        self.held.push(constraint);
        self.multipliers.push(multiplier);
        if moved {
            self.observe(offsets);
        }
        true
    }

    /// Finds the member whose multiplier is the first to reach zero as the multiplier of the joining constraint grows
    /// (`sign` 1) or shrinks (-1). Returns the change of the joining multiplier until then, and the index of the
    /// member; `None` if no multiplier reaches zero. `size` is the square of the joining constraint: shares that are
    /// rounding relative to `size` do not count.
    fn first_exhausted(&self, size: f64, sign: f64) -> Option<(f64, usize)> {
        let mut first: Option<(f64, usize)> = None;
        for (j, (share, held)) in self.step.as_flattened().iter().zip(&self.held).enumerate() {
            let share = sign * share;
            if share > 0.0 && share * share * self.basis.square(held) > ROUNDING * size {
                let step = self.multipliers[j] / share;
                if first.is_none_or(|(s, _)| step < s) {
                    first = Some((step, j));
                }
            }
        }
        first
    }

    /// Drops a member, and removes its effect on `x`.
    fn remove(&mut self, j: usize) {
        let member = self.working_set.members.remove(j);
        let place = self.place(member);
        self.is_held[place] = false;
        let constraint = self.held.remove(j);
        let multiplier = self.multipliers.remove(j);
        if multiplier != 0.0 {
            self.basis.push(&mut self.x, &constraint, -multiplier);
        }
    }

    /// Recomputes the factor from a member on; members that depend on those before them are dropped.
    fn rebuild(&mut self, from: usize) {
        self.factor.truncate(from);
        let mut next = from;
        while next < self.held.len() {
            let constraint = self.held[next];
            if self.extend_at(next, &constraint) {
                next += 1;
            } else {
                self.remove(next);
            }
        }
    }

    /// Appends a constraint to the factor. Returns `false` if the constraint depends on the members, or is hard while n
    /// hard ones are held already.
    fn extend(&mut self, constraint: &Combination) -> bool {
        self.extend_at(self.held.len(), constraint)
    }

    /// Appends a constraint to the factor of the first `count` members, like [`extend`](Self::extend).
    fn extend_at(&mut self, count: usize, constraint: &Combination) -> bool {
        let Self { factor, basis, held, .. } = self;
        let entry = basis.entries(constraint);
        let diagonal = entry(constraint) + constraint.softness;
        let full = constraint.softness == 0.0
            && held[..count].iter().filter(|held| held.softness == 0.0).count() >= basis.variables;
        let floor = if full { f64::INFINITY } else { INDEPENDENT * diagonal };
        let left = factor.reduce(|j| entry(&held[j]), diagonal);
        let independent = left > floor;
        if independent {
            factor.append(left);
        }
        independent
    }

    /// Index of a member in `is_held`.
    fn place(&self, member: HeldConstraint) -> usize {
        match member {
            HeldConstraint::Row(row) => row,
            HeldConstraint::Cut { disc, .. } => self.basis.rows + disc,
        }
    }

    /// Makes a Newton step on the multipliers and the angles of all held tangents. Returns `false` if no point is
    /// feasible.
    fn turn(&mut self, offsets: &[f64]) -> bool {
        let count = self.held.len();
        self.hold_angles();
        let slope = self.aim();
        let (share, mut blocking) = self.search(count, slope);
        for ((held, multiplier), step) in self.held.iter().zip(&mut self.multipliers).zip(self.step.as_flattened()) {
            self.basis.push(&mut self.x, held, share * step);
            *multiplier += share * step;
        }
        self.read_angles(count);
        self.held.truncate(count);
        self.multipliers.truncate(count);

        let mut from = self.turning.first().copied().unwrap_or(count);
        self.turned.clear();
        for t in (0..self.turning.len()).rev() {
            let j = self.turning[t];
            let member = self.working_set.members.remove(j);
            let place = self.place(member);
            self.is_held[place] = false;
            self.held.remove(j);
            self.turned.push((member, self.multipliers.remove(j)));
            blocking = blocking.map(|b| if b > j { b - 1 } else { b });
        }
        if let Some(j) = blocking {
            self.remove(j);
            from = from.min(j);
        }
        self.rebuild(from);
        self.observe(offsets);
        let possible = (0..self.turned.len()).all(|t| {
            let (member, multiplier) = self.turned[t];
            self.join(member, multiplier, offsets)
        });
        self.restore();
        self.observe(offsets);
        possible
    }

    /// Appends one row for the angle of each held tangent after the members.
    fn hold_angles(&mut self) {
        self.turning.clear();
        for j in 0..self.held.len() {
            if let HeldConstraint::Cut { disc, towards } = self.working_set.members[j] {
                let row = self.basis.turning(disc, towards, self.multipliers[j]);
                let Self { factor, basis, held, .. } = self;
                let entry = basis.entries(&row);
                let left = factor.reduce(|j| entry(&held[j]), entry(&row) + row.softness);
                factor.append(left.max(row.softness));
                self.held.push(row);
                self.multipliers.push(0.0);
                self.turning.push(j);
            }
        }
    }

    /// Line search along the step: the share to go, and the row whose multiplier limits it, if any. No row's multiplier
    /// becomes negative, and the dual must rise by the Armijo share. The dual has a kink where a tangent's multiplier
    /// changes its sign: kinks are tried too.
    fn search(&self, count: usize, slope: f64) -> (f64, Option<usize>) {
        let steps = self.step.as_flattened();
        let (mut share, mut blocking) = (1.0, None);
        for (j, member) in self.working_set.members[..count].iter().enumerate() {
            if matches!(member, HeldConstraint::Row(_)) && self.multipliers[j] + share * steps[j] < 0.0 {
                (share, blocking) = (-self.multipliers[j] / steps[j], Some(j));
            }
        }
        for _ in 0..HALVINGS {
            // The dual is concave, so a rise steeper than the initial slope is rounding.
            if (ARMIJO * share * slope..=share * slope).contains(&self.rise(share, slope)) {
                break;
            }
            let kinks = self.turning.iter().map(|cut| -self.multipliers[*cut] / steps[*cut]);
            (share, blocking) = (kinks.filter(|kink| *kink < share).fold(0.5 * share, f64::max), None);
        }
        (share, blocking)
    }

    /// Sets the angle and multiplier of each tangent from the multipliers of its two rows.
    fn read_angles(&mut self, count: usize) {
        for (sideways, cut) in (count..).zip(&self.turning) {
            let (along, across) = (self.multipliers[*cut], self.multipliers[sideways]);
            let HeldConstraint::Cut { disc, towards: [cos, sin] } = self.working_set.members[*cut] else { continue };
            let length = (along * along + across * across).sqrt();
            if length > 0.0 {
                let towards = [(along * cos - across * sin) / length, (along * sin + across * cos) / length];
                self.multipliers[*cut] = length;
                self.working_set.members[*cut] = HeldConstraint::Cut { disc, towards };
            }
        }
    }

    /// Dual objective `D` of the present multipliers.
    fn objective(&self) -> f64 {
        let slack =
            |held: &Combination| held.slack(self.at_centre.as_flattened()) + held.slack(self.slacks.as_flattened());
        -0.5 * self.held.iter().zip(&self.multipliers).map(|(held, multiplier)| multiplier * slack(held)).sum::<f64>()
    }

    /// Rise of the dual objective over a share of the step, including the true length of the turned multipliers.
    fn rise(&self, share: f64, slope: f64) -> f64 {
        let count = self.working_set.members.len();
        let mut rise = share * slope - 0.5 * share * share * slope;
        for (sideways, cut) in (count..).zip(&self.turning) {
            let across = share * self.step.as_flattened()[sideways];
            let along = self.multipliers[*cut] + share * self.step.as_flattened()[*cut];
            let length = libm::hypot(along, across);
            rise += 0.5 * across * across * self.held[sideways].softness;
            rise -= if along > 0.0 { across * across / (length + along) } else { length - along };
        }
        rise
    }

    /// Recomputes `x` from the multipliers, which removes the rounding accumulated over the steps.
    fn restore(&mut self) {
        let Self { x, centre, basis, held, multipliers, .. } = self;
        x.copy_from_slice(centre);
        held.iter().zip(multipliers).for_each(|(held, multiplier)| basis.push(x, held, *multiplier));
    }

    /// Entry of the working set's Gram block, including softness.
    fn entry(&self, i: usize, j: usize) -> f64 {
        let softness = if i == j { self.held[i].softness } else { 0.0 };
        self.basis.entries(&self.held[i])(&self.held[j]) + softness
    }

    /// Checks the invariants of the working set in debug builds.
    fn check_invariants(&self) {
        debug_assert!(self.held.len() == self.working_set.members.len() && self.held.len() == self.multipliers.len());
        debug_assert!(self.held.len() <= self.held.capacity(), "the working set outgrew its room");
        debug_assert!(self.multipliers.iter().all(|multiplier| *multiplier >= 0.0), "{:?}", self.multipliers);
        debug_assert!(self.factor.misfit(|i, j| self.entry(i, j)) < 1e-6, "the factor is not that of the Gram block");
    }

    /// Asserts in debug builds that a step to the optimum of the working set does not lower the dual, except by
    /// rounding. `first` is the dual of the first violated constraint alone; above `MAX_EXACT_DUAL` the rounding of the
    /// slacks is far above their tolerance, and nothing is asserted.
    fn check_rise(&self, before: f64, first: f64) {
        if cfg!(debug_assertions) && first <= MAX_EXACT_DUAL {
            let all = 0..self.held.len();
            let force = |i: usize, j: usize| (self.multipliers[i] * self.entry(i, j) * self.multipliers[j]).abs();
            let forces: f64 =
                all.clone().flat_map(|i| all.clone().map(move |j| (i, j))).map(|(i, j)| force(i, j)).sum();
            let slack = (1e-6 * before.abs().max(first)).max(DUAL_ROUNDING * forces);
            let objective = self.objective();
            assert!(objective >= before - slack, "a step fell to {objective:e} from {before:e}, of forces {forces:e}");
        }
    }
}
