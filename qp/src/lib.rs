//! Solver of strictly convex quadratic programs with linear rows, soft rows and discs, by a dual active-set method. The
//! solver is made for a sequence of small problems that share their matrices, as in a controller: a solve starts from
//! the last solution and allocates nothing.
//!
//! # The problem
//!
//! ```text
//! minimise    1/2 (x - c)'H(x - c) + 1/2 sum w_i e_i^2        over x (n) and the excesses e >= 0
//! so that     s_i(x) >= 0                                      hard rows,   s = b + G x
//!             s_i(x) + e_i >= 0                                soft rows, with the weight w_i
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
//! A disc is the intersection of its tangents, `1 - cos a s_a - sin a s_b >= 0` for all angles `a`. So each constraint
//! is a combination of *basis rows* `s`, with a gradient `g` and a multiplier `l >= 0`. Given all `l`, the optimum is
//!
//! ```text
//! x(l) = c + H^-1 sum l_i g_i          e_i(l) = l_i / w_i for a soft row
//! D(l) = -l's(c) - 1/2 l'(M + W^-1)l   M_ij = g_i'H^-1 g_j        the dual objective, to be maximised over l >= 0
//! dD/dl_i = -(s_i(x(l)) + l_i / w_i)
//! ```
//!
//! `D` never exceeds the cost of a feasible point, so it grows towards the optimum from below, and without bound if no
//! point is feasible. A soft row adds `1/w` to the diagonal of the Gram matrix `M`, so it never depends on other rows.
//!
//! # The ascent
//!
//! The method is that of Goldfarb and Idnani, *A numerically stable dual method for solving strictly convex quadratic
//! programs*, Mathematical Programming 27 (1983), with the tangents of the discs as lazy cuts after Kelley, *The
//! cutting-plane method for solving convex programs*, SIAM Journal 8 (1960). It keeps a *working set* of constraints
//! held as equations, their multipliers, and the Cholesky factor of their block of `M + W^-1`:
//!
//! 1. **Step** to the optimum of the working set, `(M + W^-1) dl = -(s + l/w)`. If a multiplier would become negative,
//!    stop where it is zero and drop its constraint.
//! 2. **Join**: if no constraint was dropped, add the most violated one, in the norm of `H^-1`. A disc is represented
//!    by its tangent towards the present point. A constraint that depends on held ones replaces one of them: the first
//!    whose multiplier becomes zero as that of the new constraint grows. If none becomes zero, no point is feasible.
//! 3. **Turn**: a disc that is held and still violated is held at the wrong angle. Kelley would add a tangent and
//!    converge slowly; here the angles of all held tangents become unknowns. Turning by `da` changes the gradient by
//!    `l da (sin a g_a - cos a g_b)`; by the curvature of the disc this is a row with the softness `1/l`. One Newton
//!    step on multipliers and angles together is shortened until `D` rises by at least the Armijo share.
//!
//! The optimum is reached when no constraint is violated by more than 5e-10. The computation uses multipliers and basis
//! rows, whose Gram matrix is computed once; only `x` and its slacks are recomputed after each step.
//!
//! # Guarantees
//!
//! - A solve allocates nothing and takes at most [`ActiveSet::max_iterations`] steps.
//! - Equal numbers and an equal working set give equal bits. Only the working set is kept from solve to solve, and the
//!   factor of its Gram block is recomputed, so that no error accumulates.
//! - `Optimal` means that no constraint is violated by more than 5e-10, and that the cost is minimal to about 1e-6 of
//!   the problem's size. The tests check random problems by a certificate and by Clarabel.
//! - Every input has an answer, with a finite `x`. A number that is not finite is reported before the first step.
//! - It is not guaranteed that the iteration limit is never reached. A million random problems took fewer than the 100
//!   steps of the controller's limit (`cargo test --release -p qp million -- --ignored --nocapture`).
//!
//! | module | holds |
//! |---|---|
//! | `active_set` | the solver: step, join, turn, and the dual objective |
//! | `basis` | `G`, `H^-1 G'` and the Gram matrix of the basis rows; constraints as combinations of them |
//! | `factor` | the Cholesky factor of the working set |
//! | `working_set` | constraints that the next solve starts from |

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

mod active_set;
mod basis;
mod factor;
mod working_set;

pub use active_set::{ActiveSet, Outcome, Termination};
pub use working_set::{HeldConstraint, WorkingSet};

#[cfg(test)]
mod tests;
