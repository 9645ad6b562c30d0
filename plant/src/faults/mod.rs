//! Faults of the plant: sensors, actuators, air and payload.
//!
//! `Plant` applies the faults of the sensors, and `Tricopter` the faults of the true vehicle.
//!
//! | module | targets | kinds | acts on |
//! |---|---|---|---|
//! | [`sensors`] | position velocity attitude rates acceleration height field flow | off stuck garbage wrong slow delayed intermittent noise | STATE |
//! | [`actuators`] | rotor1 rotor2 rotor3 tilt | off stuck wrong slow saturated | the true actuators |
//! | [`environment`] | wind, payload | step gust, mass | the true vehicle |
//!
//! A fault begins and ends with a sample. Its effect depends on the tick and the run's seed, and each fault has a
//! random stream of its own ([`Stream::Fault`](crate::random::Stream)): a faulty flight repeats bit for bit, and one
//! fault does not change another's draws. Before its onset a fault has no effect on the flight.
//!
//! Faults of one sensor or one actuator act in the order of the file, each on the result of the fault before; faults
//! given in flight come last. Scenario validation rejects pairs of target and kind that are not in the table.

pub mod actuators;
pub mod environment;
pub mod memory;
pub mod sensors;

#[cfg(test)]
mod tests;
