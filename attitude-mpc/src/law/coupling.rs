//! Term of the equation of w that the hover model lacks, for the disturbance estimate: `attitude.mpc.model =
//! "coupled"`.
//!
//! ```text
//! w' = q u - p v + g cos phi cos theta + F_z / m                                      (11)
//! ```
//!
//! At speed, `w` changes by `q u - p v` when the vehicle pitches or rolls, without any force. An estimate that predicts
//! w by the hover model takes this change for a force. Here the term is added to the one-sample prediction behind the
//! estimate, as the force `m (q u - p v)` on col at the measured state.
//!
//! The plan does not contain the term: guidance makes the reference of w at the measured attitude, so the reference
//! changes with w when the vehicle pitches, and a plan against the term would counteract a change that is wanted. The
//! change of gravity along body z at 35 degrees of pitch, which the hover model lacks too, acts as a force, and the
//! estimate finds it. Test `pitching_at_speed_is_no_force`; the figures are in `docs/mpc.md`.

use contract::message::Kinematics;
use nalgebra::Vector4;
use settings::{Model, Scenario};

/// Coupling term at the newest sample.
#[derive(Debug, Clone)]
pub struct Coupling {
    mass_kg: f64,
    force_n: f64,
}

impl Coupling {
    /// Starts with the coupling of the vehicle of `scenario` at rest, which is 0; `None` with a model without the term.
    pub fn of(scenario: &Scenario) -> Option<Self> {
        let mass_kg = scenario.airframe.mass_kg;
        (scenario.attitude.mpc.model == Model::Coupled).then_some(Self { mass_kg, force_n: 0.0 })
    }

    /// Updates the term from a sample.
    pub fn observe(&mut self, measured: &Kinematics) {
        let Kinematics { velocity_mps: [u, v, _], rates_radps: [p, q, _], .. } = *measured;
        self.force_n = self.mass_kg * (q * u - p * v);
    }

    /// Term as a disturbance on col, lon, lat, ped \[N, N m, N m, N m\].
    pub fn on_inputs(&self) -> Vector4<f64> {
        Vector4::new(self.force_n, 0.0, 0.0, 0.0)
    }
}
