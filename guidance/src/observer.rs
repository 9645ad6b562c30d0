//! The outer disturbance observer: the horizontal acceleration that the attitude does not explain.
//!
//! ```text
//! a = (v_ned[k] - v_ned[k-1]) / Ts                  measured, turned into the heading frame
//! d += b Ts (a - (-g tan theta, g tan(phi - phi_trim)) - d)
//! phi_ref -= atan(d_y / g),   theta_ref += atan(d_x / g)
//! ```
//!
//! A first-order observer of bandwidth b, as in disturbance-observer based control (Chen et al., IEEE Transactions on
//! Industrial Electronics 63(2), 2016): wind and drag appear as an acceleration, and are leant against.
//!
//! After n periods the velocity counts as grown evenly, and the step is taken n times with the mean acceleration. Noise
//! of a sample enters the estimate with b and leaves it with the next difference: one that weighed less than the time it
//! spans would leave it there, to decay within 1 / b.

use bytemuck::{Pod, Zeroable};
use nalgebra::{Vector2, Vector3};

/// Estimate and what it needs of the previous sample.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Observer {
    /// Velocity of the last sample, NED \[m/s\].
    pub velocity_ned_mps: Vector3<f64>,
    /// The disturbance ahead and to the right \[m/s2\].
    pub estimate_mps2: Vector2<f64>,
}

/// How far the estimate goes with one sample.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Time since the last sample; 0 at the first \[s\].
    pub elapsed_s: f64,
    /// Share b Ts of the gap to close in a period.
    pub gain: f64,
    /// Periods of it that are believed; at most as many as a gap that is no silence has.
    pub periods: u64,
}

impl Observer {
    /// Takes in a sample, `tilt_rad` being roll about trim and pitch; the disturbance ahead and to the right \[m/s2\].
    pub fn update(
        &mut self,
        velocity_ned_mps: &Vector3<f64>,
        tilt_rad: &Vector2<f64>,
        psi_rad: f64,
        g_mps2: f64,
        step: Step,
    ) -> Vector2<f64> {
        if step.elapsed_s > 0.0 {
            let acceleration =
                to_heading_frame(&((velocity_ned_mps - self.velocity_ned_mps) / step.elapsed_s), psi_rad);
            let explained = Vector2::new(-g_mps2 * libm::tan(tilt_rad.y), g_mps2 * libm::tan(tilt_rad.x));
            for _ in 0..step.periods {
                self.estimate_mps2 += (acceleration.xy() - explained - self.estimate_mps2) * step.gain;
            }
        }
        self.velocity_ned_mps = *velocity_ned_mps;
        self.estimate_mps2
    }
}

/// `ned` turned by `psi_rad` about the vertical: x ahead, y to the right, z down.
pub fn to_heading_frame(ned: &Vector3<f64>, psi_rad: f64) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(psi_rad);
    Vector3::new(cos * ned.x + sin * ned.y, cos * ned.y - sin * ned.x, ned.z)
}
