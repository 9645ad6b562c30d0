//! Model predictive control: the best plan over the horizon, of which the first move is the demand.
//!
//! ```text
//! U*(t) = (u*_t, ..., u*_{t+Nu-1})                                  (5)
//! u(t)  = u*_t                                                      (6)
//! ```
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`controller`] | the law: model of the tick, unconstrained plan, choice | (5)-(6) |
//! | [`condensed`] | cost over the horizon as a quadratic in the moves, its minimiser as a gain | (4) |
//! | [`preview`] | changes of the reference over the horizon | |
//! | [`at_speed`] | the model at a flight condition other than hover | |
//! | [`schedule`] | gain-scheduled MPC over the velocity | |
//! | [`constraints`] | set of admissible plans | (3), (49)-(51) |
//! | [`clearance`] | bound that shows a plan clear of its limits | |
//! | [`constrained`] | choice between explicit plan, solver and fallback | |
//! | [`solver`] | the constrained problem, by Clarabel or the active-set method of `qp` | |
//!
//! In nominal flight no constraint is active: the plan is one matrix-vector product, of which only the first move is
//! computed if a bound shows the others clear of their limits. Only a plan outside the set goes to the solver. If the
//! solver fails, every move of the unconstrained plan is replaced by the nearest move inside the set.

pub mod at_speed;
pub mod clearance;
pub mod condensed;
pub mod constrained;
pub mod constraints;
pub mod controller;
pub mod preview;
pub mod schedule;
pub mod solver;
