//! Three PID controllers: position error to roll, pitch and climb.
//!
//! ```text
//! phi_ref   = Kp_phi   e_y + Ki_phi   int e_y dt + Kd_phi   de_y/dt        (45)
//! theta_ref = Kp_theta e_x + Ki_theta int e_x dt + Kd_theta de_x/dt        (46)
//! w_ref     = Kp_w     e_z + Ki_w     int e_z dt + Kd_w     de_z/dt        (47)
//! ```
//!
//! Departure: (47) equates the body z velocity with the climb rate. With `exact_w` the output of (47) is the wanted
//! vertical speed, from which w is computed at the present attitude and velocity. Test
//! `exact_w_makes_the_wanted_climb`.

use contract::message::State;
use nalgebra::Vector3;
use settings::GuidanceSettings;

/// Angles and climb by the PID laws, before feed-forward and limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidOutput {
    /// Roll about trim \[rad\].
    pub phi_rad: f64,
    /// Pitch \[rad\].
    pub theta_rad: f64,
    /// Vertical speed, down positive \[m/s\].
    pub climb_mps: f64,
}

/// Applies the three laws to `[error, integral, derivative]`, x ahead, y right, z down \[m, m s, m/s\].
pub fn wanted(k: &GuidanceSettings, [e, i, d]: &[Vector3<f64>; 3]) -> PidOutput {
    PidOutput {
        phi_rad: k.kp_phi * e.y + k.ki_phi * i.y + k.kd_phi * d.y, // (45)
        theta_rad: k.kp_theta * e.x + k.ki_theta * i.x + k.kd_theta * d.x, // (46)
        climb_mps: k.kp_w * e.z + k.ki_w * i.z + k.kd_w * d.z,     // (47)
    }
}

/// Relation of the body z velocity to the vertical speed, at a measured attitude and velocity.
#[derive(Debug, Clone, Copy)]
pub struct ExactW {
    /// Terms of u, up positive, and of v, down positive, in the vertical speed \[m/s\].
    of_u_mps: f64,
    of_v_mps: f64,
    /// Share of w in the vertical speed.
    of_w: f64,
    speed_mps: f64,
}

impl ExactW {
    /// Builds the relation at the measurements of `state`.
    pub fn new(state: &State) -> Self {
        let [u, v, w] = state.measured.velocity_mps;
        let (sin_phi, cos_phi) = libm::sincos(state.measured.attitude_rad[0]);
        let (sin_theta, cos_theta) = libm::sincos(state.measured.attitude_rad[1]);
        Self {
            of_u_mps: u * sin_theta,
            of_v_mps: v * sin_phi * cos_theta,
            of_w: cos_phi * cos_theta,
            speed_mps: (u * u + v * v + w * w).sqrt(),
        }
    }

    /// Body z velocity at which the vertical speed is `climb_mps` \[m/s\]; its magnitude is at most twice the sum of
    /// measured speed and climb, which keeps it finite if the body z axis is horizontal.
    pub fn at(&self, climb_mps: f64) -> f64 {
        let exact = (climb_mps + self.of_u_mps - self.of_v_mps) / self.of_w;
        let most = 2.0 * (self.speed_mps + climb_mps.abs());
        exact.clamp(-most, most)
    }
}
