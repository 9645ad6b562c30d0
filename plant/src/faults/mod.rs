//! Faults of the plant: sensors, actuators, air and payload.
//!
//! | module | targets | kinds | acts on |
//! |---|---|---|---|
//! | [`sensors`] | position velocity attitude rates | off stuck garbage wrong slow delayed intermittent noise | STATE |
//! | [`actuators`] | rotor1 rotor2 rotor3 tilt | off stuck wrong slow saturated | the true actuators |
//! | [`environment`] | wind, payload | step gust, mass | the true vehicle |
//!
//! A fault begins and ends with a sample. Its effect depends on the tick and the run's seed, and each fault has a
//! random stream of its own ([`Stream::Fault`](crate::random::Stream)): a faulty flight repeats bit for bit, and one
//! fault does not change another's draws. Before its onset a fault has no effect on the flight.
//!
//! Faults of one sensor or one actuator act in the order of the file, each on the result of the one before; faults
//! given in flight come last. Scenario validation rejects pairs of target and kind that are not in the table.

pub mod actuators;
pub mod environment;
mod memory;
pub mod sensors;

use contract::Scenario;
use contract::scenario::Fault;

use actuators::ActuatorFaults;
use environment::EnvironmentFaults;
use sensors::SensorFaults;

/// Faults of the plant in a run.
#[derive(Debug, Clone)]
pub struct Faults {
    /// Faults of the four measured quantities.
    pub sensors: SensorFaults,
    /// Faults of the three rotors and the tilt servo.
    pub actuators: ActuatorFaults,
    /// Faults of wind and payload.
    pub environment: EnvironmentFaults,
}

impl Faults {
    /// Builds the faults of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            sensors: SensorFaults::new(scenario),
            actuators: ActuatorFaults::new(scenario),
            environment: EnvironmentFaults::new(scenario),
        }
    }

    /// Updates fault `number` as in [`contract::fault_schedule::FaultSchedule::apply_fault`].
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.sensors.apply_fault(number, fault);
        self.actuators.apply_fault(number, fault);
        self.environment.apply_fault(number, fault);
    }
}

#[cfg(test)]
mod tests;
