//! Motion of a broken vehicle at the moment at which a new command takes effect.
//!
//! ```text
//! dn/dt = n x w                       J dw/dt = M(Omega) - w x J w
//! d sink/dt = g + F_z(Omega) n_z / m  lag dOmega/dt = command - Omega
//! ```
//!
//! A command takes effect later than its sample ([`contract::delay`]). A spin turns by 13 degrees in 10 ms, so a
//! vehicle under commands for its present motion would fall.

use airframe::mixing::intermediate;
use airframe::{MixingMatrix, Parameters};
use contract::actuation::Actuation;
use nalgebra::{Vector3, Vector4};

/// Longest step of the integration \[s\].
const MAX_STEP_S: f64 = 2e-3;

/// Motion that a descent needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Direction down in the body frame, `n`.
    pub down: Vector3<f64>,
    /// Body rates \[rad/s\].
    pub rates_radps: Vector3<f64>,
    /// Velocity in the body frame, of which the horizontal part is used. In world axes the velocity stays constant
    /// \[m/s\].
    pub velocity_mps: Vector3<f64>,
    /// Vertical speed, down positive \[m/s\].
    pub sink_mps: f64,
    /// Positions of the actuators.
    pub position: Actuation,
}

/// Rigid body of the vehicle with its actuators.
#[derive(Debug, Clone)]
pub struct Body {
    /// Forces and moments of the actuators.
    pub mixing: MixingMatrix,
    /// Mass, inertia and gravity.
    pub vehicle: Parameters,
    /// Time constant of the rotors \[s\].
    pub rotor_lag_s: f64,
}

impl Body {
    /// Motion when a new command takes effect, from the motion `now`. Until then the commands of `course` act, each for
    /// its time \[s\]. The tilt stays, and rotor `dead` gives no thrust.
    pub fn ahead(&self, now: &Motion, course: impl Iterator<Item = (Actuation, f64)>, dead: Option<usize>) -> Motion {
        let mut motion = *now;
        for (command, time_s) in course {
            let steps = (time_s / MAX_STEP_S).ceil();
            for _ in 0..steps as usize {
                motion = self.step(&motion, &command, time_s / steps, dead);
            }
        }
        motion
    }

    /// Motion after a step of the midpoint rule.
    fn step(&self, from: &Motion, command: &Actuation, step_s: f64, dead: Option<usize>) -> Motion {
        let middle = self.moved(from, from, command, step_s / 2.0, dead);
        self.moved(from, &middle, command, step_s, dead)
    }

    /// Moves `from` over a time with the derivatives at `at`.
    fn moved(&self, from: &Motion, at: &Motion, command: &Actuation, time_s: f64, dead: Option<usize>) -> Motion {
        let (Parameters { g_mps2, mass_kg, .. }, inertia) = (self.vehicle, self.vehicle.moments_kgm2());
        let mut acting = at.position;
        if let Some(rotor) = dead {
            acting.rotor_speed[rotor] = 0.0;
        }
        let inputs: Vector4<f64> = self.mixing.forward * intermediate(&acting);
        let moment = Vector3::new(inputs[2], inputs[1], inputs[3]);
        let turning = moment - at.rates_radps.cross(&inertia.component_mul(&at.rates_radps));
        let mut position = from.position;
        for (i, speed) in position.rotor_speed.iter_mut().enumerate() {
            *speed += (command.rotor_speed[i] - at.position.rotor_speed[i]) / self.rotor_lag_s * time_s;
        }
        Motion {
            down: (from.down + at.down.cross(&at.rates_radps) * time_s).normalize(),
            rates_radps: from.rates_radps + turning.component_div(&inertia) * time_s,
            velocity_mps: from.velocity_mps + at.velocity_mps.cross(&at.rates_radps) * time_s,
            sink_mps: from.sink_mps + (g_mps2 + inputs[0] * at.down.z / mass_kg) * time_s,
            position,
        }
    }
}

#[cfg(test)]
mod tests {
    use airframe::spin::Spin;
    use settings::Scenario;

    use super::*;

    fn body() -> Body {
        let scenario = Scenario::default();
        let vehicle = scenario.airframe;
        Body { mixing: MixingMatrix::new(&vehicle, false), vehicle, rotor_lag_s: 0.03 }
    }

    fn course(commands: &[(f64, f64)]) -> impl Iterator<Item = (Actuation, f64)> {
        let of = |speed: f64| Actuation { rotor_speed: [0.0, speed, speed], tilt_rad: 0.0 };
        commands.iter().map(move |(speed, time_s)| (of(*speed), *time_s))
    }

    #[test]
    fn a_spin_stays_a_spin_over_any_delay() {
        let body = body();
        let spin = Spin::solve(&body.vehicle, f64::INFINITY).expect("the vehicle has one");
        let position = Actuation { rotor_speed: [0.0, spin.rotor_speed, spin.rotor_speed], tilt_rad: 0.0 };
        let now =
            Motion { down: spin.down, rates_radps: spin.rates_radps, velocity_mps: spin.down, sink_mps: 0.7, position };
        for time_s in [0.0, 0.003, 0.01, 0.025, 0.16] {
            let then = body.ahead(&now, course(&[(spin.rotor_speed, time_s)]), Some(0));
            assert!((then.down - now.down).amax() < 1e-4 && (then.sink_mps - 0.7).abs() < 1e-4, "{time_s} s: {then:?}");
            assert!((then.velocity_mps - now.velocity_mps).amax() < 1e-4, "along the axis: {then:?}");
            assert!((then.rates_radps - now.rates_radps).amax() < 1e-3, "{time_s} s: {then:?}");
            assert!(time_s > 0.0 || then == now);
        }
    }

    #[test]
    fn rotors_follow_the_command_in_force_and_then_those_under_way() {
        let now = Motion {
            down: Vector3::z(),
            rates_radps: Vector3::zeros(),
            velocity_mps: Vector3::zeros(),
            sink_mps: 0.0,
            position: Actuation { rotor_speed: [0.0, 100.0, 100.0], tilt_rad: 0.0 },
        };
        let then = body().ahead(&now, course(&[(200.0, 0.005), (50.0, 0.01), (400.0, 0.01)]), Some(0));
        let follow = |from: f64, to: f64, time_s: f64| to + (from - to) * (-time_s / 0.03_f64).exp();
        let expected = follow(follow(follow(100.0, 200.0, 0.005), 50.0, 0.01), 400.0, 0.01);
        assert!((then.position.rotor_speed[1] - expected).abs() < 0.2, "{then:?} {expected}");
    }
}
