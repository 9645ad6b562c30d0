//! The faults of the plant: sensors, actuators, air and payload.
//!
//! | module | targets | kinds | acts on |
//! |---|---|---|---|
//! | [`sensors`] | position velocity attitude rates | off stuck garbage wrong slow delayed intermittent noise | what is measured |
//! | [`actuators`] | rotor1 rotor2 rotor3 tilt | off stuck wrong slow saturated | the true actuators |
//! | [`environment`] | wind, payload | step gust, mass | the true vehicle |
//!
//! A fault begins and ends with a sample. It is a function of the tick and of the run's seed, each with a random stream
//! of its own ([`Stream::Fault`](crate::random::Stream)): a faulty flight repeats bit for bit, one fault does not change
//! another's draws, and outside its time a fault leaves the flight as it would be without it.
//!
//! Faults of one sensor or one actuator act in the order of the file, each on what the one before it makes of it; those
//! given while the stack flies come after.
//! Pairs of target and kind that are not in the table are refused by the scenario's check.

pub mod actuators;
pub mod environment;
mod memory;
pub mod sensors;

use contract::Scenario;
use contract::scenario::Fault;

use actuators::ActuatorFaults;
use environment::EnvironmentFaults;
use sensors::SensorFaults;

/// The plant's faults in a run.
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
    /// The faults of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            sensors: SensorFaults::new(scenario),
            actuators: ActuatorFaults::new(scenario),
            environment: EnvironmentFaults::new(scenario),
        }
    }

    /// Takes fault `number` as it is from now on: see [`contract::fault_schedule::FaultSchedule::apply_fault`].
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.sensors.apply_fault(number, fault);
        self.actuators.apply_fault(number, fault);
        self.environment.apply_fault(number, fault);
    }
}

#[cfg(test)]
mod tests;
