//! Outer disturbance observer: horizontal acceleration that the attitude does not explain.
//!
//! ```text
//! a = (v_ned[k] - v_ned[k-1]) / Ts                  measured, turned into the heading frame
//! d += b Ts (a - (-g tan theta, g tan(phi - phi_trim)) - d)
//! phi_ref -= atan(d_y / g),   theta_ref += atan(d_x / g)
//! ```
//!
//! A first-order observer of bandwidth b, as in disturbance-observer based control (Chen et al., IEEE Transactions on
//! Industrial Electronics 63(2), 2016): wind and drag appear as an acceleration, which a lean of the vehicle cancels.
//!
//! After n periods the step is taken n times with the mean acceleration. The noise of a velocity sample enters the
//! estimate with one difference and leaves the estimate with the next, if each difference has the weight of the time
//! that it spans. With less weight a part of the noise would stay and decay within 1 / b.

use bytemuck::{Pod, Zeroable};
use nalgebra::{Vector2, Vector3};

/// Disturbance estimate, and the velocity of the previous sample.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct DisturbanceObserver {
    /// Velocity of the last sample, NED \[m/s\].
    pub velocity_ned_mps: Vector3<f64>,
    /// Disturbance ahead and to the right \[m/s2\].
    pub estimate_mps2: Vector2<f64>,
}

/// Time and gain of one update.
#[derive(Debug, Clone, Copy)]
pub struct ObserverStep {
    /// Time since the last sample \[s\]; 0 at the first.
    pub elapsed_s: f64,
    /// Gain b Ts of one period.
    pub gain: f64,
    /// Number of periods for which the update is made; 1 after a silence.
    pub periods: u64,
}

impl DisturbanceObserver {
    /// Updates the estimate from a sample and returns it: the disturbance ahead and to the right \[m/s2\]. `tilt_rad`
    /// has roll about trim and pitch; `psi_rad` is the heading.
    pub fn update(
        &mut self,
        velocity_ned_mps: &Vector3<f64>,
        tilt_rad: &Vector2<f64>,
        psi_rad: f64,
        g_mps2: f64,
        step: ObserverStep,
    ) -> Vector2<f64> {
        if step.elapsed_s > 0.0 {
            let acceleration =
                HeadingFrame::new(psi_rad).turn(&((velocity_ned_mps - self.velocity_ned_mps) / step.elapsed_s));
            let explained = Vector2::new(-g_mps2 * libm::tan(tilt_rad.y), g_mps2 * libm::tan(tilt_rad.x));
            for _ in 0..step.periods {
                self.estimate_mps2 += (acceleration.xy() - explained - self.estimate_mps2) * step.gain;
            }
        }
        self.velocity_ned_mps = *velocity_ned_mps;
        self.estimate_mps2
    }
}

/// Heading frame: x ahead and y to the right, both horizontal, z down.
#[derive(Debug, Clone, Copy)]
pub struct HeadingFrame {
    sin: f64,
    cos: f64,
}

impl HeadingFrame {
    /// Builds the frame of the heading `psi_rad`.
    pub fn new(psi_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(psi_rad);
        Self { sin, cos }
    }

    /// Turns `ned` into this frame.
    pub fn turn(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        let Self { sin, cos } = *self;
        Vector3::new(cos * ned.x + sin * ned.y, cos * ned.y - sin * ned.x, ned.z)
    }

    /// Turns a vector of this frame back to NED.
    pub fn back(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        Self { sin: -self.sin, ..*self }.turn(vector)
    }
}
