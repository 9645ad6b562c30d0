//! Control laws: each law computes the demand from the goal and from the state at which the demand acts.
//!
//! A law is a file here with an implementation of [`AttitudeLaw`](attitude_law::AttitudeLaw), and a row in [`table`].
//! The controller handles the parts common to all laws: the age of a goal, the delay, the disturbance by the linear
//! model, old messages. Test `every_law_takes_over_from_every_other_in_flight`.
//!
//! | module | holds |
//! |---|---|
//! | [`attitude_law`] | inputs and results of a law |
//! | [`table`] | all laws, by their names in a scenario |
//! | [`mpc`] | model predictive control, (3)-(6) |
//! | [`lqr`] | linear-quadratic regulator with the cost of `mpc` |
//! | [`pid`] | PID law, for comparison |
//! | [`geometric`] | geometric law: tilt first, nonlinear inversion |
//! | [`indi`] | incremental nonlinear dynamic inversion |
//! | [`coupling`] | change of w at speed, for the disturbance estimate under `mpc` and `lqr` |
//! | [`level`] | attitude errors and rigid body of `geometric` and `indi` |

pub mod attitude_law;
pub mod coupling;
pub mod geometric;
pub mod indi;
pub mod level;
pub mod lqr;
pub mod mpc;
pub mod pid;
pub mod table;
