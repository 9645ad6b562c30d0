//! The vehicle: physics that plant, controller and mixer share.
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`angle`] | wrapping of headings | |
//! | [`parameters`] | mass, inertia, arms, rotor constants | Table I |
//! | [`inertia`] | check that a body can have an inertia tensor | |
//! | [`trim`] | hover equilibrium in closed form | (23)-(30) |
//! | [`mixing`] | conventional inputs to squared rotor speeds and back | (33)-(38) |
//! | [`linear`] | the controller's model and its discretisation | (48) |
//! | [`exponential`] | the exponential of a matrix | |
//! | [`level_flight`] | trimmed flight at speed | (9)-(11) |
//! | [`at_speed`] | the linear model at any flight condition | (8), (11)-(14) |
//! | [`actuator`] | lag, amplitude and rate limits of rotors and servo | (52)-(53) |
//! | [`envelope`] | the conventional inputs that the limits of the actuators allow | |
//! | [`demand_set`] | the envelope as rows of an optimisation problem | |
//! | [`projection`] | the nearest demand inside the envelope | |
//! | [`spin`] | steady spin on the rear rotors, without rotor 1 | |
//! | [`riccati`] | discrete algebraic Riccati equation | |
//!
//! Frames: NED for the world, forward-right-down for the body. SI units and radians, except the rotor speed:
//! the paper prints "RPM" beside constants that only make sense in another unit, so the unit is called
//! *rotor speed unit* here and never converted (see [`parameters`]).
//!
//! This crate has no processes or files. It depends on no other crate of the stack except `qp`, and `contract` for
//! [`Actuation`](contract::actuation::Actuation) alone.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod actuator;
pub mod angle;
pub mod at_speed;
pub mod demand_set;
pub mod envelope;
pub mod exponential;
pub mod inertia;
pub mod level_flight;
pub mod linear;
pub mod mixing;
pub mod parameters;
pub mod projection;
pub mod riccati;
pub mod spin;
pub mod trim;

pub use actuator::{ActuatorLaw, ActuatorLimits};
pub use at_speed::{AtSpeed, FlightPoint};
pub use demand_set::DemandSet;
pub use level_flight::{Drag, LevelFlight};
pub use mixing::MixingMatrix;
pub use parameters::{Parameters, Preset};
pub use trim::Trim;

#[cfg(test)]
mod tests;
