//! The term of the vertical velocity's equation that the model of hover lacks, for the estimate of the disturbance:
//! `mpc.model = "coupled"`.
//!
//! ```text
//! w' = q u - p v + g cos phi cos theta + F_z / m                                      (11)
//! ```
//!
//! At speed w changes when the vehicle pitches or rolls, by `q u - p v`, and no force is behind it. An estimate that predicts w by the
//! model of hover takes it for one. Here it joins the one-sample prediction that the estimate is made from, as the force
//! `m (q u - p v)` on col, at the measured state.
//!
//! It is not held over the horizon: guidance makes the reference of w at the measured attitude, so the reference changes with w when
//! the vehicle pitches, and a plan against the term would fight what nobody asked for. Gravity at 35 degrees of pitch, which the model of
//! hover lacks too, is a force, and the estimate finds it. Test `pitching_at_speed_is_no_force`; the figures are in `docs/mpc.md`.

use contract::message::Kinematics;
use nalgebra::Vector4;

/// The term at the newest sample.
#[derive(Debug, Clone)]
pub struct Coupling {
    mass_kg: f64,
    force_n: f64,
}

impl Coupling {
    /// The coupling of a vehicle at rest: none.
    pub fn new(mass_kg: f64) -> Self {
        Self { mass_kg, force_n: 0.0 }
    }

    /// Takes in a sample.
    pub fn observe(&mut self, measured: &Kinematics) {
        let Kinematics { velocity_mps: [u, v, _], rates_radps: [p, q, _], .. } = *measured;
        self.force_n = self.mass_kg * (q * u - p * v);
    }

    /// As a disturbance on col, lon, lat, ped.
    pub fn on_inputs(&self) -> Vector4<f64> {
        Vector4::new(self.force_n, 0.0, 0.0, 0.0)
    }
}
