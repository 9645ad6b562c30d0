//! Curves: positions over time, and their demands on a vehicle.
//!
//! | module | holds |
//! |---|---|
//! | [`setpoint`] | position, velocity and acceleration at one instant |
//! | [`progress`] | the covered share of a way: trapezoid, min-jerk, laps |
//! | [`legs`] | straight legs at a pace of their own |
//! | [`tridiagonal`] | the equations of the curves through waypoints |
//! | [`through`] | a curve through waypoints, at rest only at its ends |
//! | [`spline`] | the curve of least jerk through waypoints |
//! | [`min_snap`] | the curve of least snap through waypoints |
//! | [`figure`] | circle, helix and figure eight |
//! | [`descent`] | a landing at constant sink rate |
//! | [`curve`] | a curve of any of these shapes, stretched in time |
//! | [`limits`] | the demands of a curve on a vehicle, and the shortest duration within its limits |
//! | [`fastest`] | the times of waypoints at which the curve through them is fastest |
//! | [`stray`] | curves that stray far from their points, and times with which they stay near |
//! | [`heading`] | the heading over time |
//! | [`plan`] | parts of a mission, one after the other |
//! | [`named`] | survey and hover |
//!
//! Positions are NED \[m\]. Curves are built before the flight; evaluating a curve does not allocate. `settings` builds
//! the plan of a scenario: the check before the flight and guidance use the same plan.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod curve;
pub mod descent;
pub mod fastest;
pub mod figure;
pub mod heading;
pub mod legs;
pub mod limits;
pub mod min_snap;
pub mod named;
pub mod plan;
pub mod progress;
pub mod setpoint;
pub mod spline;
pub mod stray;
pub mod through;
pub mod tridiagonal;

pub use limits::{Excess, Quantity, VehicleLimits};
pub use plan::{MissionPlan, PartMotion, PlanPart, Planned};
pub use setpoint::Setpoint;

#[cfg(test)]
mod tests;
