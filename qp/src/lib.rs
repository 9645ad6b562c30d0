//! The nearest point of a convex set in a quadratic norm, by a dual active-set method: what the controller's plan and the
//! mixer's demand are when the actuators set limits.
//!
//! # The problem
//!
//! ```text
//! minimise    1/2 (x - c)'H(x - c) + 1/2 sum w_i e_i^2        over x (n) and the excesses e >= 0
//! so that     s_i(x) >= 0                                      hard rows,   s = b + G x
//!             s_i(x) + e_i >= 0                                soft rows, at the price w_i
//!             |(s_a(x), s_b(x))| <= 1                          discs, pairs of rows (a, b)
//! ```
//!
//! `H` and `G` are known when the solver is built; the centre `c` and the offsets `b` change from solve to solve.
//!
//! # The dual
//!
//! A disc is all its tangents: `1 - cos a s_a - sin a s_b >= 0` for every angle `a`. So every constraint is a combination of
//! the *basis rows* `s`, with a gradient `g` and a multiplier `l >= 0`. The optimum for given multipliers is
//!
//! ```text
//! x(l) = c + H^-1 sum l_i g_i          e_i(l) = l_i / w_i for a soft row
//! D(l) = -l's(c) - 1/2 l'(M + W^-1)l   M_ij = g_i'H^-1 g_j        the dual objective, to be maximised over l >= 0
//! dD/dl_i = -(s_i(x(l)) + l_i / w_i)
//! ```
//!
//! `D` never exceeds the cost of any point inside, so it grows towards the optimum from below, and without bound when
//! nothing is inside. A soft row only adds `1/w` to the diagonal of the Gram matrix `M`: it never depends on others.
//!
//! # The ascent
//!
//! The method is that of Goldfarb and Idnani, *A numerically stable dual method for solving strictly convex quadratic
//! programs*, Mathematical Programming 27 (1983), with the tangents of the discs as lazy cuts after Kelley, *The
//! cutting-plane method for solving convex programs*, SIAM Journal 8 (1960). It keeps a *working set* of constraints held
//! as equations, their multipliers, and the Cholesky factor of their block of `M + W^-1`:
//!
//! 1. **Step** to the optimum of the working set, `(M + W^-1) dl = -(s + l/w)`. Where a multiplier would turn negative, go
//!    as far as it lasts and drop its constraint.
//! 2. **Join**: when every multiplier holds, add the constraint violated most in the norm of `H^-1`; of a disc the tangent
//!    towards the present point. One that depends on those held takes the place of the one that blocks it first; when none
//!    does, no point is inside.
//! 3. **CycleEnd**: a disc that is held and still violated is touched at the wrong angle. Kelley would add a tangent and
//!    converge slowly; here the angles of all held tangents become unknowns. Turning by `da` moves the constraint by
//!    `l da (sin a g_a - cos a g_b)`, and the curvature of the disc makes that a row with the softness `1/l`: one Newton step on multipliers and
//!    angles together, shortened until `D` rises by its share (Armijo).
//!
//! Nothing violated by more than 5e-10 is the optimum. All of it happens on multipliers and basis rows, whose Gram matrix
//! is computed once; only `x` and its slacks are formed anew after each step.
//!
//! # From solve to solve
//!
//! Only the working set is kept, and the factor of its Gram block is computed anew: it is small, nothing drifts, and a solver
//! that is given a copy of the working set finds the same bits. What `solve` promises:
//!
//! - it allocates nothing, and takes at most [`ActiveSet::max_iterations`] steps;
//! - the same numbers and the same working set give the same bits;
//! - numbers that are none are told before anything is computed with them.
//!
//! | module | holds |
//! |---|---|
//! | `basis` | `G`, `H^-1 G'` and the Gram matrix of the basis rows; constraints as combinations of them |
//! | `dual` | its objective, and what must hold of it |
//! | `factor` | the Cholesky factor of the working set |
//! | `steps` | step, join, turn |
//! | `working_set` | what one solve leaves to the next |
//! | [`random`] | problems to test with |

mod basis;
mod dual;
mod factor;
pub mod random;
mod steps;
mod working_set;

use basis::{Basis, Combination};
use factor::Factor;
use nalgebra::DMatrix;
pub use working_set::{Member, WorkingSet};

/// Violation that is left alone, in units of the slacks.
const TOLERANCE: f64 = 5e-10;
/// A dual objective this many times that of the first violated constraint alone grows without bound: nothing is inside.
const UNBOUNDED: f64 = 1e12;

/// Numbers beyond this are none: the dual objective is their square, and a turn has the square of that.
const FAR: f64 = 1e50;

/// A dual objective beyond this is rounding for the most part.
const BLURRED: f64 = 1e10;

/// The solver of one set-up.
pub struct ActiveSet {
    /// Steps granted to a solve.
    pub max_iterations: u32,
    basis: Basis,
    working_set: WorkingSet,
    /// The constraints its members stand for.
    held: Vec<Combination>,
    /// Their multipliers, never negative.
    multipliers: Vec<f64>,
    /// Factor of their Gram matrix.
    factor: Factor,
    /// Where the multipliers go.
    step: Vec<[f64; 4]>,
    /// Which rows, and then which discs, are held.
    is_held: Vec<bool>,
    /// The centre.
    centre: Vec<[f64; 4]>,
    /// The variables under the multipliers.
    x: Vec<[f64; 4]>,
    /// The basis rows at `x`.
    slacks: Vec<[f64; 4]>,
    /// The basis rows at the centre.
    at_centre: Vec<[f64; 4]>,
    /// Places of the held tangents that turn.
    turning: Vec<usize>,
    /// Those that have turned and join again, with their multipliers.
    turned: Vec<(Member, f64)>,
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// What was found.
    pub verdict: Verdict,
    /// Steps taken: each solves the equations of one working set.
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
    /// A number given is none, or so large that nothing can be computed with it.
    NotFinite,
}

impl ActiveSet {
    /// Sets up the problem: the Hessian `H` (n x n, positive definite), the linear `rows` (m x n) with their `softness`
    /// (m numbers: 0 is hard, else `1/w`), and the rows of the `discs` (2k x n, one pair each).
    ///
    /// # Panics
    /// When the sizes do not match, or `H` is not positive definite.
    pub fn new(
        hessian: &DMatrix<f64>,
        rows: &DMatrix<f64>,
        softness: &[f64],
        discs: &DMatrix<f64>,
        max_iterations: u32,
    ) -> Self {
        let basis = Basis::new(hessian, rows, softness, discs);
        // Hard members are independent; a soft row needs no such thing.
        let soft = softness.iter().filter(|softness| **softness > 0.0).count();
        let members = (basis.variables + soft).min(basis.rows + basis.discs);
        let capacity = members + basis.discs;
        Self {
            max_iterations,
            working_set: WorkingSet { members: Vec::with_capacity(members) },
            held: Vec::with_capacity(capacity),
            multipliers: Vec::with_capacity(capacity),
            factor: Factor::new(capacity),
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

    /// What the last solve left for the next to start from.
    pub fn working_set(&self) -> &WorkingSet {
        &self.working_set
    }

    /// Lets the next solve start from the working set of another solver of the same set-up.
    pub fn warm_start(&mut self, from: &WorkingSet) {
        self.working_set.members.clear();
        self.working_set.members.extend_from_slice(&from.members);
    }

    /// Lets the next solve start from nothing.
    pub fn forget(&mut self) {
        self.working_set.members.clear();
    }

    /// Solves for a `centre` (n) and `offsets` (m + 2k: the rows, then the pairs of the discs). Writes `x` (n) at the
    /// optimum, and where the steps ran out; leaves it alone otherwise.
    pub fn solve(&mut self, centre: &[f64], offsets: &[f64], x: &mut [f64]) -> Outcome {
        let is_near = |numbers: &[f64]| numbers.iter().all(|number| number.abs() < FAR); // false for NaN
        let mut outcome = Outcome { verdict: Verdict::NotFinite, iterations: 0, active: 0 };
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
            (outcome.verdict, outcome.iterations) = self.ascend(offsets, first);
            outcome.active = self.held.len() as u32;
            if first > BLURRED {
                self.forget(); // what was held among rounding is nothing to start from
            }
        } else {
            self.forget();
            outcome.verdict = Verdict::Optimal;
        }
        if !is_near(self.x.as_flattened()) {
            self.forget();
            outcome.verdict = Verdict::NotFinite;
        }
        if matches!(outcome.verdict, Verdict::Optimal | Verdict::IterationLimit) {
            x.copy_from_slice(&self.x.as_flattened()[..x.len()]);
        }
        outcome
    }

    /// Climbs until nothing is violated; `first` is the dual objective of the first violated constraint alone.
    fn ascend(&mut self, offsets: &[f64], first: f64) -> (Verdict, u32) {
        for iteration in 1..=self.max_iterations {
            let before = self.objective();
            if before > UNBOUNDED * first {
                return (Verdict::Infeasible, iteration);
            }
            let arrived = self.step(offsets);
            self.check_invariants();
            if !arrived {
                continue;
            }
            self.check_rise(before, first);
            let possible = match self.worst() {
                None => return (Verdict::Optimal, iteration),
                Some((Member::Cut { disc, .. }, _)) if self.is_held[self.basis.rows + disc] => self.turn(offsets),
                Some((Member::Row(row), _)) if self.is_held[row] => true, // rounding: the next step mends it
                Some((member, _)) => self.join(member, 0.0, offsets),
            };
            if !possible {
                return (Verdict::Infeasible, iteration);
            }
        }
        (Verdict::IterationLimit, self.max_iterations)
    }

    /// The constraint violated most, in the norm of `H^-1`, and by how much. A disc is told by its tangent towards the
    /// present point.
    fn worst(&self) -> Option<(Member, f64)> {
        let (rows, pairs) = self.slacks.as_flattened()[..self.basis.len()].split_at(self.basis.rows);
        let (mut worst, mut most) = (None, 0.0);
        for (row, (slack, scale)) in rows.iter().zip(&self.basis.scale).enumerate() {
            if *slack < -TOLERANCE && -slack * scale > most {
                (worst, most) = (Some(Member::Row(row)), -slack * scale);
            }
        }
        for (disc, pair) in pairs.chunks_exact(2).enumerate() {
            let length = (pair[0] * pair[0] + pair[1] * pair[1]).sqrt();
            if length - 1.0 > TOLERANCE {
                let member = Member::Cut { disc, towards: [pair[0] / length, pair[1] / length] };
                let size = (length - 1.0) / self.basis.square(&self.basis.constraint(member)).sqrt();
                if size > most {
                    (worst, most) = (Some(member), size);
                }
            }
        }
        worst.map(|member| (member, most))
    }
}

#[cfg(test)]
mod tests;
