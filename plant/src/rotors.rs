//! The three rotors: thrust and torque (15)-(22), angular momentum, and the forces of moving air on them.
//!
//! Rotor i pushes along its axis `a_i`: up, and for rotor 1 tilted by mu about the body x axis. Its reaction torque and
//! angular momentum are along the same axis, with the sign of its sense of rotation: rotors 1 and 3 turn clockwise seen
//! from above, rotor 2 counter-clockwise.
//!
//! ```text
//! V_i = v_air + omega x r_i
//! F_i = (KF Omega_i^2 - k_in Omega_i V_i,along) a_i - k_H Omega_i V_i,across (15)
//! M_i = s_i KM Omega_i^2 a_i + r_i x F_i                                 (16), (20)-(22)
//! h   = -J_r sum s_i Omega_i a_i
//! ```
//!
//! Departure: the paper has only the first term of each force, and neglects the pitching part of rotor 1's torque
//! (`tilt_reaction`). A hub moves at `V_i` relative to the air, by the velocity of the centre of mass and the body
//! rates. Air along the axis reduces thrust, air across it pushes (the H-force). Both are to first order in the speed,
//! as by blade element theory near hover (Bangura and Mahony, ACRA 2012; Faessler, Franchi and Scaramuzza, IEEE RA-L
//! 3(2), 2018). The vortex ring of a steep descent is not modelled. With `plant.rotor.inertia_kgm2` the rotors are
//! gyroscopes, and a rotor that accelerates turns the vehicle against its rotation; the rotor speed unit then counts as
//! rad/s (see [`airframe::parameters`]). Tests `spinning_rotors_precess`,
//! `a_rotor_that_spins_up_turns_the_vehicle_against_it`, `a_climb_costs_thrust_and_a_cross_wind_pushes`,
//! `a_vehicle_that_turns_is_damped_at_its_hubs`.

use contract::actuation::Actuation;
use nalgebra::Vector3;
use settings::Scenario;

/// Sense of rotation `s_i`: 1 for a torque on the vehicle along the thrust.
const SENSES: [f64; 3] = [1.0, -1.0, 1.0];

/// Condition of the actuators at one instant; healthy by default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// Factor on thrust and torque of each rotor, in addition to the scenario's.
    pub effectiveness: [f64; 3],
    /// Time constants of rotor 1, 2, 3 and the tilt \[s\]; `None` without a fault that prolongs them.
    pub slow_s: [Option<f64>; 4],
}

impl Default for Condition {
    fn default() -> Self {
        Self { effectiveness: [1.0; 3], slow_s: [None; 4] }
    }
}

/// True rotors of the vehicle.
#[derive(Debug, Clone)]
pub struct Rotors {
    kf: f64,
    km: f64,
    /// Hubs in the body frame from the centre of mass \[m\].
    arms: [Vector3<f64>; 3],
    effectiveness: [f64; 3],
    tilt_reaction: bool,
    /// Coefficients `k_in` and `k_H` \[N s2/m\]; `None` if both are 0.
    in_air_ns2pm: Option<[f64; 2]>,
    /// Moment of inertia `J_r` of a rotor \[kg m2\].
    inertia_kgm2: f64,
}

/// Force and moment about the centre of mass, in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// Force \[N\].
    pub force_n: Vector3<f64>,
    /// Moment \[N m\].
    pub moment_nm: Vector3<f64>,
}

/// Angular momentum of the rotors and its rate of change in the body frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Momentum {
    /// Angular momentum h \[N m s\].
    pub own: Vector3<f64>,
    /// Rate of change dh/dt \[N m\].
    pub rate: Vector3<f64>,
}

impl Rotors {
    /// Builds the rotors of the vehicle of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let (plant, vehicle) = (&scenario.plant, scenario.flown_airframe());
        let rotor = &plant.rotor;
        let in_air = [rotor.inflow_ns2pm, rotor.h_force_ns2pm];
        Self {
            kf: vehicle.kf,
            km: vehicle.km,
            arms: hubs(scenario),
            effectiveness: plant.rotor_effectiveness,
            tilt_reaction: plant.tilt_reaction,
            in_air_ns2pm: (in_air != [0.0; 2]).then_some(in_air),
            inertia_kgm2: rotor.inertia_kgm2,
        }
    }

    /// Computes force and moment of the rotors. The centre of mass moves at `air_mps` relative to the air \[m/s\], and
    /// the vehicle turns at `rates_radps` \[rad/s\], both in the body frame.
    #[inline]
    pub fn thrust(
        &self,
        actuators: &Actuation,
        condition: &Condition,
        air_mps: &Vector3<f64>,
        rates_radps: &Vector3<f64>,
    ) -> Wrench {
        let axes = axes(libm::sincos(actuators.tilt_rad));
        let (mut force_n, mut moment_nm) = (Vector3::zeros(), Vector3::zeros());
        for i in 0..3 {
            let speed = actuators.rotor_speed[i];
            let square = self.effectiveness[i] * condition.effectiveness[i] * speed * speed;
            let mut force = axes[i] * (self.kf * square); // (15), (17)-(19)
            if let Some([inflow, h_force]) = self.in_air_ns2pm {
                let hub_mps = air_mps + rates_radps.cross(&self.arms[i]);
                let along = axes[i] * hub_mps.dot(&axes[i]);
                force -= (along * inflow + (hub_mps - along) * h_force) * speed;
            }
            let mut torque = axes[i] * (SENSES[i] * self.km * square); // (16)
            if i == 0 && !self.tilt_reaction {
                torque.y = 0.0;
            }
            force_n += force;
            moment_nm += self.arms[i].cross(&force) + torque; // (20)-(22)
        }
        Wrench { force_n, moment_nm }
    }

    /// Computes the angular momentum of the rotors, whose speeds and tilt change by `rates` per second.
    #[inline]
    pub fn momentum(&self, actuators: &Actuation, rates: &Actuation) -> Momentum {
        if self.inertia_kgm2 == 0.0 {
            return Momentum::default();
        }
        let (sin_mu, cos_mu) = libm::sincos(actuators.tilt_rad);
        let axes = axes((sin_mu, cos_mu));
        let mut momentum = Momentum::default();
        for i in 0..3 {
            let inertia = -SENSES[i] * self.inertia_kgm2;
            momentum.own += axes[i] * (inertia * actuators.rotor_speed[i]);
            momentum.rate += axes[i] * (inertia * rates.rotor_speed[i]);
        }
        let turning = Vector3::new(0.0, cos_mu, sin_mu) * rates.tilt_rad;
        momentum.rate += turning * (-SENSES[0] * self.inertia_kgm2 * actuators.rotor_speed[0]);
        momentum
    }
}

/// Rotor hubs in the body frame from the centre of mass \[m\].
pub fn hubs(scenario: &Scenario) -> [Vector3<f64>; 3] {
    let (vehicle, centre) = (scenario.flown_airframe(), Vector3::from(scenario.plant.airframe.centre_of_mass_m));
    [
        Vector3::new(vehicle.l1_m, 0.0, 0.0) - centre,
        Vector3::new(-vehicle.l2_m, vehicle.l3_m, 0.0) - centre,
        Vector3::new(-vehicle.l2_m, -vehicle.l3_m, 0.0) - centre,
    ]
}

/// Axes along which the rotors push, in the body frame, by sine and cosine of the tilt of rotor 1.
fn axes((sin_mu, cos_mu): (f64, f64)) -> [Vector3<f64>; 3] {
    [Vector3::new(0.0, sin_mu, -cos_mu), -Vector3::z(), -Vector3::z()]
}

#[cfg(test)]
mod tests;
