//! Vehicle of the plant: the true motion under the command in force. The plant around it has the time line of commands
//! and the sensors.

use airframe::Trim;
use contract::actuation::Actuation;
use contract::message::{Kinematics, PlantStatus};
use runtime::error::SessionError;
use settings::{Fault, Scenario};

use crate::memory::Tape;

/// Largest position on any axis \[m\]; the check of a scenario keeps missions inside.
const MAX_POSITION_M: f64 = 500.0;
/// Largest body rate on any axis \[rad/s\], sixteen turns a second.
const MAX_RATE_RADPS: f64 = 100.0;

/// Vehicle that the plant moves: [`Tricopter`](crate::tricopter::Tricopter), or a vehicle in another language.
pub trait Vehicle {
    /// Moves from `from_ns` to `until_ns` under one `command`; rotor speeds of 0 stop the motors. A vehicle that has
    /// diverged stays as it is.
    ///
    /// # Errors
    /// Fails if the code of the vehicle fails; the process shall then end.
    fn advance(&mut self, from_ns: u64, until_ns: u64, command: &Actuation) -> Result<(), SessionError>;
    /// Present motion.
    fn motion(&self) -> Kinematics;
    /// Present positions of the actuators.
    fn actuators(&self) -> Actuation;
    /// Mean wind at `now_ns`, NED \[m/s\]; zero unless the vehicle overrides it.
    fn wind_mps(&self, _now_ns: u64) -> [f64; 3] {
        [0.0; 3]
    }
    /// Reason for which the vehicle no longer moves, if any.
    fn diverged(&self) -> Option<PlantStatus>;
    /// Status of a vehicle that has not diverged, during the run or at its end.
    fn phase(&self, is_over: bool) -> PlantStatus {
        if is_over { PlantStatus::Finished } else { PlantStatus::Flying }
    }
    /// Updates fault `number` if it is a fault of actuators, wind or payload; a vehicle without faults ignores it.
    fn apply_fault(&mut self, _number: usize, _fault: &Fault) {}
    /// Writes or reads the memory at sample `tick`.
    fn remember(&mut self, tape: &mut Tape, tick: u64);
}

/// Motion and actuator positions at the start of `scenario`: the hover trim of `[airframe]`, or standing with idle
/// rotors, displaced by `[initial]`.
pub fn start(scenario: &Scenario) -> (Kinematics, Actuation) {
    let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction);
    let initial = &scenario.initial;
    let [roll, pitch, yaw] = initial.attitude_deg.map(f64::to_radians);
    let (rest_rad, actuation) = if initial.standing {
        (0.0, Actuation { rotor_speed: [scenario.idle_speed(); 3], ..trim.actuation })
    } else {
        (trim.roll_rad, trim.actuation)
    };
    let motion = Kinematics {
        position_m: initial.position_m,
        velocity_mps: initial.velocity_mps,
        attitude_rad: [rest_rad + roll, pitch, yaw],
        rates_radps: initial.rates_radps,
    };
    (motion, actuation)
}

/// Bound of the simulation that the numbers of a state violate, if any.
pub fn divergence(numbers: &[f64], position_m: &[f64], rates_radps: &[f64]) -> Option<PlantStatus> {
    if !numbers.iter().all(|value| value.is_finite()) {
        Some(PlantStatus::NonFinite)
    } else if position_m.iter().any(|value| value.abs() > MAX_POSITION_M) {
        Some(PlantStatus::TooFar)
    } else if rates_radps.iter().any(|value| value.abs() > MAX_RATE_RADPS) {
        Some(PlantStatus::TooFast)
    } else {
        None
    }
}
