//! Faults of rotors and tilt servo, which act on the true actuator; the command itself is unchanged.
//!
//! | kind | rotor | tilt |
//! |---|---|---|
//! | off | unpowered: spins down to 0 with its lag | its spring returns it to 0 with its lag |
//! | stuck | keeps the speed at the onset | keeps the angle at the onset, or goes to `value` degrees |
//! | wrong | has the share `value` of its thrust and torque | is `value` degrees off its command, within its range |
//! | slow | has the lag `ms` | has the lag `ms` |
//! | saturated | reaches the share `value` of its highest speed | reaches the share `value` of its range, either way |
//!
//! An unpowered rotor has thrust as long as it turns. An unpowered servo returns to the centre; the fault of a servo
//! that keeps its angle is `stuck`. An actuator outside the range that a fault leaves returns to that range with its
//! lag. A lag is never shorter than the actuator's own, and the longest of several lags counts.

use contract::actuation::Actuation;
use settings::fault_schedule::FaultSchedule;
use settings::{Fault, FaultKind, FaultTarget, Scenario};

use crate::memory::Tape;
use crate::rotors::Condition;

/// Default share of thrust and torque of a wrong rotor.
const EFFECTIVENESS: f64 = 0.7;
/// Default offset of a wrong tilt from its command \[deg\].
const TILT_BIAS_DEG: f64 = 5.0;
/// Default lag of a slow actuator \[ms\]: five times the default lag.
const SLOW_MS: f64 = 150.0;
/// Default share of its range that a saturated actuator reaches.
const REACH: f64 = 0.8;

/// Index of the tilt servo, after the three rotors.
const TILT: usize = 3;

/// Faults of the actuators, with the positions at which they are stuck.
#[derive(Debug, Clone)]
pub struct ActuatorFaults {
    faults: FaultSchedule<ActuatorFault>,
    healthy: [Healthy; 4],
}

/// Range and lag of an actuator without faults.
#[derive(Debug, Clone, Copy)]
struct Healthy {
    /// Largest position, in its unit.
    reach: f64,
    lag_s: f64,
}

#[derive(Debug, Clone)]
struct ActuatorFault {
    /// Index 0 to 2 of a rotor, or [`TILT`].
    actuator: usize,
    effect: Effect,
}

#[derive(Debug, Clone, Copy)]
enum Effect {
    Off,
    /// Position at the onset, or the given position; `None` before the onset.
    Stuck(Option<f64>),
    /// Factor on thrust and torque.
    Weak(f64),
    /// Offset of the tilt, and largest tilt \[rad\].
    Bias(f64, f64),
    /// Time constant \[s\].
    Slow(f64),
    /// Largest position, in the actuator's unit.
    Saturated(f64),
}

impl ActuatorFaults {
    /// Builds the actuator faults of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let limits = scenario.limits();
        let rotor = |reach| Healthy { reach, lag_s: scenario.plant.rotor_lag_s };
        let tilt = Healthy { reach: limits.tilt_max_rad, lag_s: scenario.plant.servo_lag_s };
        let [rotor1, rotor2, rotor3] = limits.rotor_speed_max.map(rotor);
        let healthy = [rotor1, rotor2, rotor3, tilt];
        Self { faults: FaultSchedule::new(scenario, |_, fault| ActuatorFault::new(&healthy, fault)), healthy }
    }

    /// Updates fault `number` if it is a fault of an actuator.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, ActuatorFault::new(&self.healthy, fault));
    }

    /// Writes or reads the positions at the onset.
    pub fn remember(&mut self, tape: &mut Tape) {
        for fault in self.faults.all_mut() {
            if let Effect::Stuck(onset) = &mut fault.effect.effect {
                tape.option(onset, Tape::value);
            }
        }
    }

    /// Applies the faults in the period after sample `tick` to actuators in `position` under a `command` within the
    /// limits. Returns the command that they follow, and their condition.
    #[inline]
    pub fn inject(&mut self, tick: u64, position: &Actuation, command: &Actuation) -> (Actuation, Condition) {
        if self.faults.all().is_empty() {
            return (*command, Condition::default());
        }
        let position: [f64; 4] = bytemuck::cast(*position);
        let mut targets: [f64; 4] = bytemuck::cast(*command);
        let mut condition = Condition::default();
        for ActuatorFault { actuator, effect } in self.faults.on_mut(tick) {
            let target = &mut targets[*actuator];
            match effect {
                Effect::Off => *target = 0.0,
                // The target is the position itself, so that the actuator does not move at all.
                Effect::Stuck(onset) => *target = *onset.get_or_insert(position[*actuator]),
                Effect::Weak(factor) => condition.effectiveness[*actuator] *= *factor,
                Effect::Bias(by, limit) => *target = (*target + *by).min(*limit).max(-*limit),
                Effect::Slow(lag_s) => {
                    let slow_s = &mut condition.slow_s[*actuator];
                    *slow_s = Some(slow_s.map_or(*lag_s, |other_s| other_s.max(*lag_s)));
                }
                Effect::Saturated(limit) => *target = target.min(*limit).max(-*limit),
            }
        }
        (bytemuck::cast(targets), condition)
    }
}

impl ActuatorFault {
    /// Builds the fault; `None` if it is not a fault of an actuator.
    fn new(healthy: &[Healthy; 4], fault: &Fault) -> Option<Self> {
        let actuator = match fault.target {
            FaultTarget::Rotor1 => 0,
            FaultTarget::Rotor2 => 1,
            FaultTarget::Rotor3 => 2,
            FaultTarget::Tilt => TILT,
            _ => return None,
        };
        let Healthy { reach, lag_s } = healthy[actuator];
        let effect = match fault.kind {
            FaultKind::Off => Effect::Off,
            FaultKind::Stuck => Effect::Stuck(fault.value.map(|deg| deg.to_radians().clamp(-reach, reach))),
            FaultKind::Wrong if actuator == TILT => {
                Effect::Bias(fault.value.unwrap_or(TILT_BIAS_DEG).to_radians(), reach)
            }
            FaultKind::Wrong => Effect::Weak(fault.value.unwrap_or(EFFECTIVENESS)),
            FaultKind::Slow => Effect::Slow((fault.ms.unwrap_or(SLOW_MS) / 1e3).max(lag_s)),
            FaultKind::Saturated => Effect::Saturated(reach * fault.value.unwrap_or(REACH).max(0.0)),
            _ => return None,
        };
        Some(Self { actuator, effect })
    }
}

#[cfg(test)]
mod tests;
