//! Faults of rotors and tilt servo. They act on the true actuator; the command itself is unchanged.
//!
//! | kind | rotor | tilt |
//! |---|---|---|
//! | off | unpowered: it spins down to 0 with its lag, and its thrust with it | its spring returns it to 0 with its lag |
//! | stuck | keeps the speed it had at the onset | keeps its angle |
//! | wrong | `value` of its thrust and torque | is `value` degrees off its command, within its range |
//! | slow | its lag is `ms` | likewise |
//! | saturated | reaches `value` of its highest speed | reaches `value` of its range, either way |
//!
//! An unpowered rotor keeps its effectiveness: while it turns, it lifts. An unpowered servo returns to the centre; one
//! that stays where it was is stuck. An actuator outside the range that a fault leaves it returns to it with its lag. A
//! lag never becomes shorter than the actuator's own, and of several the longest counts.

use airframe::Actuation;
use contract::Scenario;
use contract::fault_schedule::FaultSchedule;
use contract::scenario::{Fault, FaultKind, FaultTarget};

use crate::memory::Tape;
use crate::rotors::Condition;

/// Share of thrust and torque that a wrong rotor has left.
const EFFECTIVENESS: f64 = 0.7;
/// Offset of a wrong tilt from its command \[deg\].
const TILT_BIAS_DEG: f64 = 5.0;
/// Lag of a slow actuator \[ms\]: five times the healthy one.
const SLOW_MS: f64 = 150.0;
/// Share of its range that a saturated actuator reaches.
const REACH: f64 = 0.8;

/// Index of the tilt servo, after the three rotors.
const TILT: usize = 3;

/// The faults of the actuators, with the positions in which they are stuck.
#[derive(Debug, Clone)]
pub struct ActuatorFaults {
    faults: FaultSchedule<ActuatorFault>,
    healthy: [Healthy; 4],
}

/// What an actuator can do without a fault.
#[derive(Debug, Clone, Copy)]
struct Healthy {
    /// Largest position, in its unit.
    reach: f64,
    lag_s: f64,
}

#[derive(Debug, Clone)]
struct ActuatorFault {
    /// 0 to 2 for the rotors, or [`TILT`].
    actuator: usize,
    effect: Effect,
}

#[derive(Debug, Clone, Copy)]
enum Effect {
    Off,
    /// Position at the onset, once it has been seen.
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
    /// The actuator faults of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let limits = scenario.limits();
        let rotor = |reach| Healthy { reach, lag_s: scenario.plant.rotor_lag_s };
        let tilt = Healthy { reach: limits.tilt_max_rad, lag_s: scenario.plant.servo_lag_s };
        let [rotor1, rotor2, rotor3] = limits.rotor_speed_max.map(rotor);
        let healthy = [rotor1, rotor2, rotor3, tilt];
        Self { faults: FaultSchedule::new(scenario, |_, fault| ActuatorFault::new(&healthy, fault)), healthy }
    }

    /// Takes fault `number` as it is from now on.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, ActuatorFault::new(&self.healthy, fault));
    }

    /// Writes or reads what they remember.
    pub fn remember(&mut self, tape: &mut Tape) {
        for fault in self.faults.all_mut() {
            if let Effect::Stuck(onset) = &mut fault.effect.effect {
                tape.option(onset, Tape::number);
            }
        }
    }

    /// The faults in the period after sample `tick`, of actuators in `position` under a `command` within the limits: the
    /// command that they follow, and how they follow it.
    #[inline]
    pub fn inject(&mut self, tick: u64, position: &Actuation, command: &Actuation) -> (Actuation, Condition) {
        if self.faults.all().is_empty() {
            return (*command, Condition::default());
        }
        let position = as_array(position);
        let mut targets = as_array(command);
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
        let [o1, o2, o3, tilt_rad] = targets;
        (Actuation { rotor_speed: [o1, o2, o3], tilt_rad }, condition)
    }
}

impl ActuatorFault {
    /// `None` for a fault of something else.
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
            FaultKind::Stuck => Effect::Stuck(None),
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

fn as_array(actuation: &Actuation) -> [f64; 4] {
    let [o1, o2, o3] = actuation.rotor_speed;
    [o1, o2, o3, actuation.tilt_rad]
}

#[cfg(test)]
mod tests;
