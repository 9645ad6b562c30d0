//! Equations of motion of vehicle and actuators.
//!
//! ```text
//! [Xb Yb Zb]' = Cbn [X Y Z]'                                      (7)
//! e'     = 1/2 e (0, p, q, r)                                     (8)
//! [u v w]' = -[p q r] x [u v w] + Cbn [0 0 g] + F / m             (9)-(11)
//! J [p q r]' = M - [p q r] x (J [p q r] + h)                      (12)-(14)
//! Fi = KF Omega_i^2                                               (15)
//! Mi = KM Omega_i^2                                               (16)
//! Fx = 0                                                          (17)
//! Fy =   F1 sin mu                                                (18)
//! Fz = -(F1 cos mu + F2 + F3)                                     (19)
//! Mx = -l3 (F2 - F3)                                              (20)
//! My = -l2 (F2 + F3) + l1 F1 cos mu                               (21)
//! Mz =  l1 F1 sin mu - M1 cos mu + M2 - M3                        (22)
//! ```
//!
//! Departure: the attitude is the unit quaternion `e` from body to NED axes, where (8) has Euler angles, which are
//! singular at 90 degrees of pitch. Test `a_loop_passes_through_90_degrees_of_pitch`. Only messages have Euler angles.
//!
//! Departure: two misprints are corrected. The second row of the direction cosine matrix in (7) ends in
//! `cos phi sin psi, -sin phi cos theta`, which is no rotation and contradicts the gravity in (10); it must be
//! `cos phi cos psi, sin phi cos theta`. And (14) has `Iyy - Ixx`, with which a free tumble gains energy.
//! Tests `gravity_is_the_third_column_of_the_rotation`, `a_free_tumble_keeps_energy_and_angular_momentum`.
//!
//! Departure: effects that the paper neglects can be switched on: drag in moving air, a disturbance, the pitching
//! moment `M1 sin mu` of the tilted rotor, a loss of thrust and torque, products of inertia, a centre of mass off the
//! origin of the arms, the rotors' angular momentum `h`, and forces of moving air on the rotors
//! ([`Rotors`](crate::rotors)). All are off by default. Test `val_plant_cases`, and one test of direction for each
//! effect. Faults act here too, as [`Condition`] of the actuators and as payload.

use airframe::ActuatorLaw;
use contract::actuation::Actuation;
use contract::message::{Kinematics, PlantStatus};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use settings::Scenario;

use crate::ground::{BodyMotion, Ground};
use crate::landing::Footing;
use crate::memory::Tape;
use crate::rotors::{Condition, Rotors};

/// State X Y Z \[m\], u v w \[m/s\], attitude quaternion (i, j, k, scalar), p q r \[rad/s\], `Omega_1..3`
/// \[rotor speed unit\], mu \[rad\].
pub type StateVector = [f64; 17];

/// External influences on the vehicle at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surroundings {
    /// Velocity of the air, NED \[m/s\].
    pub wind_mps: Vector3<f64>,
    /// Disturbing force, NED \[N\].
    pub force_n: Vector3<f64>,
    /// Disturbing moment, body \[N m\].
    pub moment_nm: Vector3<f64>,
    /// Mass carried at the centre of mass, in addition to the vehicle's \[kg\].
    pub payload_kg: f64,
}

/// True vehicle, which may differ from the controller's model.
#[derive(Debug, Clone)]
pub struct Dynamics {
    g_mps2: f64,
    mass_kg: f64,
    /// Inertia J \[kg m2\], and its inverse.
    inertia: Matrix3<f64>,
    inverse_inertia: Matrix3<f64>,
    rotors: Rotors,
    ground: Option<Ground>,
    law: ActuatorLaw,
    drag_linear_nspm: Vector3<f64>,
    drag_quadratic_ns2pm2: f64,
}

impl Dynamics {
    /// Builds the vehicle of `scenario`.
    ///
    /// # Panics
    /// If the inertia has no inverse, which scenario validation rejects.
    pub fn new(scenario: &Scenario) -> Self {
        let plant = &scenario.plant;
        let vehicle = scenario.flown_airframe();
        let inertia = Matrix3::from(scenario.flown_inertia_kgm2());
        Self {
            g_mps2: vehicle.g_mps2,
            mass_kg: vehicle.mass_kg,
            inertia,
            inverse_inertia: inertia.try_inverse().expect("a checked inertia has an inverse"),
            rotors: Rotors::new(scenario),
            ground: Ground::new(scenario),
            law: scenario.actuator_law(),
            drag_linear_nspm: plant.drag_linear_nspm.into(),
            drag_quadratic_ns2pm2: plant.drag_quadratic_ns2pm2,
        }
    }

    /// Returns the nearest command that the actuators can follow.
    pub fn clip(&self, command: &Actuation) -> Actuation {
        self.law.limits.clip(command)
    }

    /// Contact of the vehicle at `x` with the ground; `Footing::None` without a ground.
    pub fn footing(&self, x: &StateVector) -> Footing {
        self.ground.as_ref().map_or(Footing::None, |ground| ground.footing(&motion(x)))
    }

    /// Crash or tip-over at `x`, one step after `before`; `None` if neither happens.
    pub fn breaks(&self, before: &StateVector, x: &StateVector) -> Option<PlantStatus> {
        let ground = self.ground.as_ref()?;
        ground.breaks(&motion(x), ground.carries(&motion(before)))
    }

    /// Moves the anchors of the feet for the state `x` at the end of a step; returns the distance that the feet have
    /// slid on the ground \[m\].
    pub fn settle(&mut self, x: &StateVector) -> f64 {
        self.ground.as_mut().map_or(0.0, |ground| ground.settle(&motion(x)))
    }

    /// Writes or reads the anchors of the feet.
    pub fn remember(&mut self, tape: &mut Tape) {
        self.ground.iter_mut().for_each(|ground| ground.remember(tape));
    }

    /// Rate of change of `x`, per second, under an already clipped `command`.
    pub fn derivative(
        &self,
        x: &StateVector,
        command: &Actuation,
        condition: &Condition,
        outside: &Surroundings,
    ) -> StateVector {
        let velocity = Vector3::new(x[3], x[4], x[5]);
        let attitude = Quaternion::new(x[9], x[6], x[7], x[8]);
        let rates = Vector3::new(x[10], x[11], x[12]);
        let cnb = rotation(&attitude);
        let actuators = actuation(x);
        let speeds = self.actuator_rates(&actuators, command, condition);

        let air = velocity - cnb.tr_mul(&outside.wind_mps);
        let thrust = self.rotors.thrust(&actuators, condition, &air, &rates);
        let momentum = self.rotors.momentum(&actuators, &speeds);
        let mut force = thrust.force_n + self.drag(&air) + cnb.tr_mul(&outside.force_n);
        let mut moment = thrust.moment_nm + outside.moment_nm - momentum.rate;
        if let Some(ground) = &self.ground {
            let (ground_n, ground_nm) = ground.push(&motion(x));
            force += ground_n;
            moment += ground_nm;
        }
        let mass_kg = self.mass_kg + outside.payload_kg;

        let way = cnb * velocity; // (7)
        let turn = attitude * Quaternion::from_imag(rates * 0.5); // (8)
        let gravity = cnb.row(2).transpose() * self.g_mps2;
        let faster = velocity.cross(&rates) + gravity + force / mass_kg; // (9)-(11)
        let spin = self.inertia * rates + momentum.own;
        let quicker = self.inverse_inertia * (moment + spin.cross(&rates)); // (12)-(14)
        let Actuation { rotor_speed: [do1, do2, do3], tilt_rad: dmu } = speeds;
        let [[dx, dy, dz], [du, dv, dw], [dp, dq, dr]]: [[f64; 3]; 3] = [way.into(), faster.into(), quicker.into()];
        [dx, dy, dz, du, dv, dw, turn.i, turn.j, turn.k, turn.w, dp, dq, dr, do1, do2, do3, dmu]
    }

    /// Rates of change of `Omega_1..3` and mu, per second.
    fn actuator_rates(&self, position: &Actuation, command: &Actuation, condition: &Condition) -> Actuation {
        let mut all = self.law.rate(position, command);
        for (i, slow_s) in condition.slow_s.iter().enumerate() {
            if let Some(lag_s) = *slow_s {
                let slow = ActuatorLaw { rotor_lag_s: lag_s, servo_lag_s: lag_s, ..self.law }.rate(position, command);
                match all.rotor_speed.get_mut(i) {
                    Some(rotor) => *rotor = slow.rotor_speed[i],
                    None => all.tilt_rad = slow.tilt_rad,
                }
            }
        }
        all
    }

    /// Drag \[N\] against the body velocity relative to the air \[m/s\].
    fn drag(&self, velocity_mps: &Vector3<f64>) -> Vector3<f64> {
        -(self.drag_linear_nspm.component_mul(velocity_mps)
            + self.drag_quadratic_ns2pm2 * velocity_mps.norm() * velocity_mps)
    }
}

/// Builds a state vector from motion and actuator positions.
pub fn assemble(motion: &Kinematics, actuators: &Actuation) -> StateVector {
    let Kinematics { position_m, velocity_mps, attitude_rad: [roll, pitch, yaw], rates_radps } = motion;
    let attitude = UnitQuaternion::from_euler_angles(*roll, *pitch, *yaw);
    let mut x = [0.0; 17];
    x[0..3].copy_from_slice(position_m);
    x[3..6].copy_from_slice(velocity_mps);
    x[6..10].copy_from_slice(attitude.coords.as_slice());
    x[10..13].copy_from_slice(rates_radps);
    x[13..16].copy_from_slice(&actuators.rotor_speed);
    x[16] = actuators.tilt_rad;
    x
}

fn motion(x: &StateVector) -> BodyMotion {
    BodyMotion {
        position_m: Vector3::new(x[0], x[1], x[2]),
        velocity_mps: Vector3::new(x[3], x[4], x[5]),
        rates_radps: Vector3::new(x[10], x[11], x[12]),
        cnb: rotation(&Quaternion::new(x[9], x[6], x[7], x[8])),
    }
}

/// Motion in a state vector; roll and yaw are within half a turn, pitch within a quarter.
pub fn kinematics(x: &StateVector) -> Kinematics {
    let cnb = rotation(&Quaternion::new(x[9], x[6], x[7], x[8]));
    let pitch = libm::asin((-cnb[(2, 0)]).clamp(-1.0, 1.0));
    let roll = libm::atan2(cnb[(2, 1)], cnb[(2, 2)]);
    let yaw = libm::atan2(cnb[(1, 0)], cnb[(0, 0)]);
    Kinematics {
        position_m: [x[0], x[1], x[2]],
        velocity_mps: [x[3], x[4], x[5]],
        attitude_rad: [roll, pitch, yaw],
        rates_radps: [x[10], x[11], x[12]],
    }
}

/// Velocity in a state vector, NED \[m/s\].
pub fn velocity_ned_mps(x: &StateVector) -> Vector3<f64> {
    let motion = motion(x);
    motion.cnb * motion.velocity_mps
}

/// Actuator positions in a state vector.
pub fn actuation(x: &StateVector) -> Actuation {
    Actuation { rotor_speed: [x[13], x[14], x[15]], tilt_rad: x[16] }
}

/// Normalises the quaternion in `x`, whose length changes by rounding and by the error of the integration.
pub fn normalise(x: &mut StateVector) {
    let length = (x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9]).sqrt();
    x[6..10].iter_mut().for_each(|part| *part /= length);
}

/// Rotation matrix from body to navigation frame, the transpose of `Cbn` of (7).
fn rotation(attitude: &Quaternion<f64>) -> Matrix3<f64> {
    let (i, j, k, s) = (attitude.i, attitude.j, attitude.k, attitude.w);
    #[rustfmt::skip]
    let cnb = Matrix3::new(
        1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j - s * k),       2.0 * (i * k + s * j),
        2.0 * (i * j + s * k),       1.0 - 2.0 * (i * i + k * k), 2.0 * (j * k - s * i),
        2.0 * (i * k - s * j),       2.0 * (j * k + s * i),       1.0 - 2.0 * (i * i + j * j),
    );
    cnb
}

#[cfg(test)]
mod tests;
