//! Quadratic programs with discs, by our own dual active-set method: the attitude controller's plan and the mixer's
//! projection, in microseconds, without allocation.
//!
//! ```text
//! minimise   1/2 (x - c)'H (x - c) + 1/2 sum w_i e_i^2      over x and e >= 0
//! so that    b_i + g_i x       >= 0       hard rows
//!            b_i + g_i x + e_i >= 0       soft rows
//!            |(b_a + g_a x, b_b + g_b x)| <= 1     discs
//! ```
//!
//! `H` and all `g` are fixed when the solver is built; `c`, the unconstrained optimum, and `b` come with each solve.
//!
//! # The dual
//! Let the constraints held as equations, the *working set*, have slacks `s = s0 + A (x - c)`, and multipliers
//! `lambda >= 0`. Then the best `x` and `e`, and what they cost at least, are
//!
//! ```text
//! x = c + H^-1 A' lambda,   e_i = lambda_i / w_i
//! D(lambda) = -1/2 lambda'M lambda - s0'lambda,   M = A H^-1 A' + diag(1/w)       to be maximised
//! ```
//!
//! A soft row is `1/w` on the diagonal, and no variable. `H^-1 G'` and `G H^-1 G'` of all rows are worked out once
//! (`basis`), so that `M` is only picked together, and factored as `L L'` (`factor`).
//!
//! # The ascent
//! (Goldfarb and Idnani 1983, *A numerically stable dual method for solving strictly convex quadratic programs*, Math.
//! Programming 27.) From `x = c`, with no multipliers and the working set of the last solve:
//!
//! 1. Step to the maximum of `D` on the working set, where its slacks vanish: `M d = -s`. If a multiplier would turn
//!    negative, go only so far that it vanishes, drop its constraint, and step again.
//! 2. Where nothing is violated, `x` is the optimum. Otherwise add the constraint that is violated by most in the metric
//!    of `H`, `-s_i / sqrt(M_ii)`, and step again.
//! 3. A constraint that depends on those held cannot be added. It takes over force from them along its composition,
//!    which moves no `x`, until the first has none left and gives way to it. Where none can give way, nothing is feasible.
//!
//! `D` never falls from step to step, so that no working set comes twice. All of it is bounded by `max_iterations`.
//!
//! We differ from the paper in two points of numerics. Rows behind one that is dropped are factored anew, which costs no
//! more than rotations do at twenty rows, and forgets rounding. And each step starts from the slacks of the `x` that was
//! reached, worked out from `x` itself: what is called feasible is what will be returned, and rounding of one step is
//! mended by the next. (The Gram matrix has the condition number of the rows squared.)
//!
//! # Discs
//! A disc is the intersection of its tangents, `1 - cos s_a - sin s_b >= 0` (Kelley 1960, *The cutting-plane method for
//! solving convex programs*, J. SIAM 8). Such a *cut* is a combination of two basis rows and joins the working set as a
//! row does: at the angle of the present point. One cut a disc is enough, because it turns (`turn`): all cuts held are
//! turned at once by Newton's method whenever a held disc is violated most. A cut that is off by an angle `t` leaves its
//! disc violated by `t^2 / 2` only, so two or three turns do where cutting planes would take dozens.
//!
//! # What remains
//! A solve leaves its [`WorkingSet`] behind, and nothing else. With the same working set, the same numbers give the same
//! bits.

mod basis;
mod factor;
pub mod random;
mod steps;
mod turn;
mod working_set;

pub use working_set::{Member, WorkingSet};

#[cfg(test)]
mod tests;

use basis::{Basis, Combination};
use factor::Factor;
use nalgebra::DMatrix;

/// Violation that is left alone, in units of the slacks.
const TOLERANCE: f64 = 5e-10;

/// The solver of one set-up.
pub struct ActiveSet {
    /// Steps granted to a solve.
    pub max_iterations: u32,
    basis: Basis,
    working_set: WorkingSet,
    /// The constraints its members stand for; while cuts turn, their turning rows behind them.
    held: Vec<Combination>,
    /// Their multipliers.
    multipliers: Vec<f64>,
    /// Where these go.
    step: Vec<[f64; 4]>,
    /// Factor of their Gram matrix.
    factor: Factor,
    /// Which rows, and behind them which discs, are held.
    is_held: Vec<bool>,
    /// Cuts on their way back into the working set.
    turned: Vec<(Member, f64)>,
    /// The variables under the multipliers.
    x: Vec<[f64; 4]>,
    /// `b` of this solve.
    offsets: Vec<f64>,
    /// The basis rows at `x`, with what soft rows have given way.
    slacks: Vec<[f64; 4]>,
    /// The basis rows at `c`.
    slacks_at_centre: Vec<[f64; 4]>,
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// What was found.
    pub verdict: Verdict,
    /// Steps taken; 0 when the unconstrained optimum obeys all constraints.
    pub iterations: u32,
    /// Constraints held at the end.
    pub active: u32,
}

/// What a solve found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// `x` is the optimum.
    Optimal,
    /// `x` is the last iterate: not feasible.
    IterationLimit,
    /// No `x` obeys all hard constraints.
    Infeasible,
    /// A given number is none, or so large that the solution overflows.
    NotFinite,
}

impl ActiveSet {
    /// Sets up the problem with the `hessian` H (n x n), linear `rows` (m x n) and their `softness` (m: 0 for a hard row,
    /// else `1/w`), and `discs` (2k x n: rows 2j and 2j + 1 make the pair of disc j). Takes all memory it will use.
    ///
    /// # Panics
    /// When the sizes do not match or the Hessian is not positive definite.
    pub fn new(
        hessian: &DMatrix<f64>,
        rows: &DMatrix<f64>,
        softness: &[f64],
        discs: &DMatrix<f64>,
        max_iterations: u32,
    ) -> Self {
        let basis = Basis::new(hessian, rows, softness, discs);
        // No more hard constraints than variables are independent, and no constraint is held twice.
        let soft = softness.iter().filter(|softness| **softness != 0.0).count();
        let members = (basis.variables + soft).min(basis.rows + basis.discs);
        let capacity = members + basis.discs;
        let slacks = vec![[0.0; 4]; basis.len().div_ceil(4)];
        Self {
            max_iterations,
            working_set: WorkingSet { members: Vec::with_capacity(members) },
            held: Vec::with_capacity(capacity),
            multipliers: Vec::with_capacity(capacity),
            step: vec![[0.0; 4]; capacity.div_ceil(4)],
            factor: Factor::new(capacity),
            is_held: vec![false; basis.rows + basis.discs],
            turned: Vec::with_capacity(basis.discs),
            x: vec![[0.0; 4]; basis.variables.div_ceil(4)],
            offsets: vec![0.0; basis.len()],
            slacks_at_centre: slacks.clone(),
            slacks,
            basis,
        }
    }

    /// Solves for the unconstrained optimum `centre` (n) and `offsets` b (m + 2k: the rows, then the pairs of the discs).
    /// Writes `x` (n) when the verdict is `Optimal` or `IterationLimit`, and leaves it alone otherwise.
    ///
    /// # Panics
    /// When a slice is not as long as said.
    pub fn solve(&mut self, centre: &[f64], offsets: &[f64], x: &mut [f64]) -> Outcome {
        let mut outcome = Outcome { verdict: Verdict::NotFinite, iterations: 0, active: 0 };
        if !is_finite(centre) || !is_finite(offsets) {
            return outcome;
        }
        self.x.as_flattened_mut()[..x.len()].copy_from_slice(centre);
        self.offsets.copy_from_slice(offsets);
        self.basis.slacks(&self.x, offsets, &mut self.slacks);
        if self.worst().is_none() {
            self.forget();
            outcome.verdict = Verdict::Optimal;
        } else {
            self.slacks_at_centre.copy_from_slice(&self.slacks);
            self.resume();
            (outcome.verdict, outcome.iterations) = self.ascend();
            outcome.active = self.working_set.members.len() as u32;
        }
        if !is_finite(self.x.as_flattened()) {
            self.forget();
            outcome.verdict = Verdict::NotFinite;
        }
        if matches!(outcome.verdict, Verdict::Optimal | Verdict::IterationLimit) {
            x.copy_from_slice(&self.x.as_flattened()[..x.len()]);
        }
        outcome
    }

    /// The constraints the last solve ended with: the next one starts from them.
    pub fn working_set(&self) -> &WorkingSet {
        &self.working_set
    }

    /// Lets the next solve start from the working set of another. What is not of this problem is passed over.
    pub fn warm_start(&mut self, from: &WorkingSet) {
        let Self { working_set: WorkingSet { members }, basis, .. } = self;
        let room = members.capacity();
        members.clear();
        members.extend(from.members.iter().filter(|member| basis.place(**member).is_some()).take(room));
    }

    /// Lets the next solve start from nothing.
    pub fn forget(&mut self) {
        self.working_set.members.clear();
    }

    /// Climbs from the unconstrained optimum; the verdict, and the steps it took.
    fn ascend(&mut self) -> (Verdict, u32) {
        for iteration in 1..=self.max_iterations {
            if !self.step() {
                continue;
            }
            let can_go_on = match self.worst() {
                None => return (Verdict::Optimal, iteration),
                Some(Member::Row(row)) if self.is_held[row] => true, // by rounding, which the next step mends
                Some(Member::Cut { disc, .. }) if self.is_held[self.basis.rows + disc] => self.turn(),
                Some(member) => self.join(member, 0.0),
            };
            if !can_go_on {
                return (Verdict::Infeasible, iteration);
            }
        }
        (Verdict::IterationLimit, self.max_iterations)
    }

    /// The constraint violated by most in the metric of `H`; a disc as its tangent towards the present point.
    fn worst(&self) -> Option<Member> {
        let (rows, pairs) = self.slacks.as_flattened()[..self.basis.len()].split_at(self.basis.rows);
        let (mut worst, mut most) = (None, 0.0);
        for (row, (slack, scale)) in rows.iter().zip(&self.basis.scales).enumerate() {
            if *slack < -TOLERANCE && -slack * scale > most {
                (worst, most) = (Some(Member::Row(row)), -slack * scale);
            }
        }
        for (disc, pair) in pairs.chunks_exact(2).enumerate() {
            let length = (pair[0] * pair[0] + pair[1] * pair[1]).sqrt();
            if length > 1.0 + TOLERANCE {
                let cut = Member::Cut { disc, towards: [pair[0] / length, pair[1] / length] };
                let depth = (length - 1.0) / self.basis.diagonal(&self.basis.constraint(cut)).sqrt();
                if depth > most {
                    (worst, most) = (Some(cut), depth);
                }
            }
        }
        worst
    }
}

fn is_finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}
