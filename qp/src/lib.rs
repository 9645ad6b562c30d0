//! A solver for strictly convex quadratic programs with linear rows, soft rows and discs, by a dual active-set method. It is
//! made for a sequence of small problems that share their matrices, as a controller meets them tick by tick: it starts
//! from the last solution and allocates nothing.
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
//! ```
//! use nalgebra::DMatrix;
//! use qp::{ActiveSet, Termination};
//!
//! // The point of the unit disc with x_1 <= 0.6 that is nearest to (2, 2).
//! let identity = DMatrix::identity(2, 2);
//! let rows = DMatrix::from_row_slice(1, 2, &[-1.0, 0.0]);
//! let mut solver = ActiveSet::new(&identity, &rows, &[0.0], &identity, 100);
//! let mut x = [0.0; 2];
//! let outcome = solver.solve(&[2.0, 2.0], &[0.6, 0.0, 0.0], &mut x);
//! assert_eq!(outcome.termination, Termination::Optimal);
//! assert!((x[0] - 0.6).abs() < 1e-9 && (x[1] - 0.8).abs() < 1e-9);
//! ```
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
//! 3. **Turn**: a disc that is held and still violated is touched at the wrong angle. Kelley would add a tangent and
//!    converge slowly; here the angles of all held tangents become unknowns. Turning by `da` moves the constraint by
//!    `l da (sin a g_a - cos a g_b)`, and the curvature of the disc makes that a row with the softness `1/l`: one Newton step on multipliers and
//!    angles together, shortened until `D` rises by its share (Armijo).
//!
//! Nothing violated by more than 5e-10 is the optimum. All of it happens on multipliers and basis rows, whose Gram matrix
//! is computed once; only `x` and its slacks are formed anew after each step.
//!
//! # What is guaranteed
//!
//! - A solve allocates nothing and takes at most [`ActiveSet::max_iterations`] steps.
//! - The same numbers and the same working set give the same bits. Only the working set is kept from solve to solve, and the
//!   factor of its Gram block is computed anew: nothing drifts.
//! - `Optimal` means that no constraint is violated by more than 5e-10, and that the cost is the smallest one to about 1e-6 of
//!   the problem's size. The tests hold random problems against a certificate and against Clarabel.
//! - Any input has an answer: numbers that are not finite end the solve before anything is computed, and `x` is finite.
//! - Not guaranteed: that the iteration limit is never reached. A million random problems took less than the 100 steps that the
//!   controller grants (`cargo test --release -p qp million -- --ignored --nocapture`).
//!
//! | module | holds |
//! |---|---|
//! | `active_set` | the solver: step, join, turn, and the dual objective |
//! | `basis` | `G`, `H^-1 G'` and the Gram matrix of the basis rows; constraints as combinations of them |
//! | `factor` | the Cholesky factor of the working set |
//! | `working_set` | what one solve leaves to the next |

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

mod active_set;
mod basis;
mod factor;
mod working_set;

pub use active_set::{ActiveSet, Outcome, Termination};
pub use working_set::{Member, WorkingSet};

#[cfg(test)]
mod tests;
