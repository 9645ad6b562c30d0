//! The equations of motion: how the state of vehicle and actuators changes.
//!
//! ```text
//! [Xb Yb Zb]' = Cbn [X Y Z]'                                      (7)
//! phi'   = p + (q sin phi + r cos phi) tan theta                  (8)
//! theta' = q cos phi - r sin phi
//! psi'   = (q sin phi + r cos phi) / cos theta
//! u' =  r v - q w - g sin theta           + Fx / m                (9)
//! v' = -r u + p w + g cos theta sin phi   + Fy / m                (10)
//! w' =  q u - p v + g cos theta cos phi   + Fz / m                (11)
//! p' = (Iyy - Izz) / Ixx q r + Mx / Ixx                           (12)
//! q' = (Izz - Ixx) / Iyy p r + My / Iyy                           (13)
//! r' = (Ixx - Iyy) / Izz p q + Mz / Izz                           (14)
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
//! Departure: two slips of the print are mended. The second row of the direction cosine matrix in (7) ends in
//! `cos phi sin psi, -sin phi cos theta`, which is no rotation and contradicts the gravity in (10); it must be
//! `cos phi cos psi, sin phi cos theta`. And (14) has `Iyy - Ixx`, with which a free tumble gains energy.
//! Tests `gravity_is_the_third_column_of_the_rotation`, `a_free_tumble_keeps_energy_and_angular_momentum`.
//!
//! Departure: what the paper neglects can be switched on: drag in moving air, a disturbance, the pitching moment
//! `M1 sin mu` of the tilted rotor, a loss of thrust and torque. All are off unless the scenario says otherwise.
//! Test `val_plant_cases`, and one test of direction for each. What a fault does to the vehicle enters here too, as its
//! [`Condition`] and as payload.

use airframe::{Actuation, ActuatorLaw, Parameters};
use contract::Scenario;
use contract::message::Kinematics;
use nalgebra::{Matrix3, Vector3};

/// X Y Z \[m\], u v w \[m/s\], phi theta psi \[rad\], p q r \[rad/s\], `Omega_1..3` \[rotor speed unit\], mu \[rad\].
pub type StateVector = [f64; 16];

/// What acts on the vehicle from outside at one instant.
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

/// How the actuators are at one instant; by default sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// Factor on thrust and torque of each rotor, beside the scenario's.
    pub effectiveness: [f64; 3],
    /// Time constants of rotor 1, 2, 3 and the tilt where a fault prolongs them \[s\].
    pub slow_s: [Option<f64>; 4],
}

impl Default for Condition {
    fn default() -> Self {
        Self { effectiveness: [1.0; 3], slow_s: [None; 4] }
    }
}

/// The vehicle as it really is.
#[derive(Debug, Clone)]
pub struct Dynamics {
    vehicle: Parameters,
    law: ActuatorLaw,
    effectiveness: [f64; 3],
    tilt_reaction: bool,
    drag_linear_nspm: Vector3<f64>,
    drag_quadratic_ns2pm2: f64,
}

impl Dynamics {
    /// The vehicle of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let plant = &scenario.plant;
        Self {
            vehicle: scenario.airframe,
            law: scenario.actuator_law(),
            effectiveness: plant.rotor_effectiveness,
            tilt_reaction: plant.tilt_reaction,
            drag_linear_nspm: plant.drag_linear_nspm.into(),
            drag_quadratic_ns2pm2: plant.drag_quadratic_ns2pm2,
        }
    }

    /// The nearest command the actuators can follow.
    pub fn clip(&self, command: &Actuation) -> Actuation {
        self.law.limits.clip(command)
    }

    /// Rate of change of `x`, per second, under an already clipped `command`.
    pub fn derivative(
        &self,
        x: &StateVector,
        command: &Actuation,
        condition: &Condition,
        outside: &Surroundings,
    ) -> StateVector {
        let Parameters { g_mps2: g, ixx_kgm2: ixx, iyy_kgm2: iyy, izz_kgm2: izz, .. } = self.vehicle;
        let m = self.vehicle.mass_kg + outside.payload_kg;
        let [_, _, _, u, v, w, phi, theta, psi, p, q, r, ..] = *x;
        let (sin_phi, cos_phi) = phi.sin_cos();
        let (sin_theta, cos_theta) = theta.sin_cos();
        let cbn = direction_cosines((sin_phi, cos_phi), (sin_theta, cos_theta), psi.sin_cos());

        let actuators = actuation(x);
        let (thrust, torque) = self.rotors(&actuators, condition);
        let air_velocity = Vector3::new(u, v, w) - cbn * outside.wind_mps;
        let [fx, fy, fz]: [f64; 3] = (thrust + self.drag(&air_velocity) + cbn * outside.force_n).into();
        let [mx, my, mz]: [f64; 3] = (torque + outside.moment_nm).into();

        let [dx, dy, dz]: [f64; 3] = cbn.tr_mul(&Vector3::new(u, v, w)).into(); // (7)
        let turn = (q * sin_phi + r * cos_phi) / cos_theta;
        let dphi = p + turn * sin_theta; // (8)
        let dtheta = q * cos_phi - r * sin_phi; // (8)
        let dpsi = turn; // (8)
        let du = r * v - q * w - g * sin_theta + fx / m; // (9)
        let dv = -r * u + p * w + g * cos_theta * sin_phi + fy / m; // (10)
        let dw = q * u - p * v + g * cos_theta * cos_phi + fz / m; // (11)
        let dp = ((iyy - izz) * q * r + mx) / ixx; // (12)
        let dq = ((izz - ixx) * p * r + my) / iyy; // (13)
        let dr = ((ixx - iyy) * p * q + mz) / izz; // (14)
        let [do1, do2, do3, dmu] = self.actuator_rates(&actuators, command, condition);
        [dx, dy, dz, du, dv, dw, dphi, dtheta, dpsi, dp, dq, dr, do1, do2, do3, dmu]
    }

    /// Force \[N\] and moment \[N m\] of the three rotors, body frame.
    fn rotors(&self, actuators: &Actuation, condition: &Condition) -> (Vector3<f64>, Vector3<f64>) {
        let Parameters { l1_m: l1, l2_m: l2, l3_m: l3, kf, km, .. } = self.vehicle;
        let (sin_mu, cos_mu) = actuators.tilt_rad.sin_cos();
        let effectiveness = |i: usize| self.effectiveness[i] * condition.effectiveness[i];
        let square = |i: usize| effectiveness(i) * actuators.rotor_speed[i] * actuators.rotor_speed[i];
        let [f1, f2, f3] = [kf * square(0), kf * square(1), kf * square(2)]; // (15)
        let [m1, m2, m3] = [km * square(0), km * square(1), km * square(2)]; // (16)
        let reaction = if self.tilt_reaction { m1 * sin_mu } else { 0.0 };

        let fx = 0.0; // (17)
        let fy = f1 * sin_mu; // (18)
        let fz = -(f1 * cos_mu + f2 + f3); // (19)
        let mx = -l3 * (f2 - f3); // (20)
        let my = -l2 * (f2 + f3) + l1 * f1 * cos_mu + reaction; // (21)
        let mz = l1 * f1 * sin_mu - m1 * cos_mu + m2 - m3; // (22)
        (Vector3::new(fx, fy, fz), Vector3::new(mx, my, mz))
    }

    /// Rates of change of `Omega_1..3` and mu, per second.
    fn actuator_rates(&self, position: &Actuation, command: &Actuation, condition: &Condition) -> [f64; 4] {
        let rates = |law: &ActuatorLaw| {
            let Actuation { rotor_speed: [o1, o2, o3], tilt_rad } = law.rate(position, command);
            [o1, o2, o3, tilt_rad]
        };
        let mut all = rates(&self.law);
        for (i, slow_s) in condition.slow_s.iter().enumerate() {
            if let Some(lag_s) = *slow_s {
                all[i] = rates(&ActuatorLaw { rotor_lag_s: lag_s, servo_lag_s: lag_s, ..self.law })[i];
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

/// A state vector from its two halves.
pub fn assemble(motion: &Kinematics, actuators: &Actuation) -> StateVector {
    let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = motion;
    let mut x = [0.0; 16];
    x[0..3].copy_from_slice(position_m);
    x[3..6].copy_from_slice(velocity_mps);
    x[6..9].copy_from_slice(attitude_rad);
    x[9..12].copy_from_slice(rates_radps);
    x[12..15].copy_from_slice(&actuators.rotor_speed);
    x[15] = actuators.tilt_rad;
    x
}

/// The motion in a state vector.
pub fn kinematics(x: &StateVector) -> Kinematics {
    Kinematics {
        position_m: [x[0], x[1], x[2]],
        velocity_mps: [x[3], x[4], x[5]],
        attitude_rad: [x[6], x[7], x[8]],
        rates_radps: [x[9], x[10], x[11]],
    }
}

/// The actuator positions in a state vector.
pub fn actuation(x: &StateVector) -> Actuation {
    Actuation { rotor_speed: [x[12], x[13], x[14]], tilt_rad: x[15] }
}

/// `Cbn` of (7), from navigation to body frame, out of (sin, cos) of roll, pitch and yaw.
fn direction_cosines(roll: (f64, f64), pitch: (f64, f64), yaw: (f64, f64)) -> Matrix3<f64> {
    let ((s_phi, c_phi), (s_theta, c_theta), (s_psi, c_psi)) = (roll, pitch, yaw);
    #[rustfmt::skip]
    let cbn = Matrix3::new(
        c_theta * c_psi,                         c_theta * s_psi,                         -s_theta,
        s_phi * s_theta * c_psi - c_phi * s_psi, s_phi * s_theta * s_psi + c_phi * c_psi, s_phi * c_theta,
        c_phi * s_theta * c_psi + s_phi * s_psi, c_phi * s_theta * s_psi - s_phi * c_psi, c_phi * c_theta,
    );
    cbn
}

#[cfg(test)]
mod tests;
