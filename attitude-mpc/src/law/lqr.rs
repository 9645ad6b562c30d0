//! Linear-quadratic regulator: the cost of the [MPC](super::mpc) over an infinite horizon, without constraints and
//! without a preview.

use airframe::linear::INPUTS;
use contract::message::Kinematics;
use nalgebra::{DVector, Vector4};
use settings::{Scenario, ScenarioError};

use super::attitude_law::{Aim, AttitudeLaw, Decision};
use super::coupling::Coupling;
use super::mpc::condensed::{self, GIVEN, Gain};
use crate::memory::AttitudeMemory;
use crate::model::PredictionModel;

/// Linear-quadratic regulator, with its buffers.
pub struct Lqr {
    /// Gain of `u = gain (x; r; d; v)`.
    gain: Gain,
    coupling: Option<Coupling>,
    /// Given numbers `(x; r; d; v)`, n + 15.
    given: DVector<f64>,
    /// Demand, 4.
    demand: DVector<f64>,
    /// Changes of the reference: always empty, because the regulator has no preview.
    unchanged: DVector<f64>,
}

impl Lqr {
    /// Builds the regulator of a `model` with the weights of `scenario`; the error names weights for which no regulator
    /// exists.
    pub fn new(scenario: &Scenario, model: &PredictionModel) -> Result<Self, ScenarioError> {
        Ok(Self {
            gain: condensed::regulator(model, &scenario.attitude)?,
            coupling: Coupling::of(scenario),
            given: DVector::zeros(model.states() + GIVEN),
            demand: DVector::zeros(INPUTS),
            unchanged: DVector::zeros(0),
        })
    }
}

impl AttitudeLaw for Lqr {
    fn observe(&mut self, measured: &Kinematics) {
        self.coupling.iter_mut().for_each(|coupling| coupling.observe(measured));
    }

    fn coupling(&self) -> Vector4<f64> {
        self.coupling.as_ref().map_or_else(Vector4::zeros, Coupling::on_inputs)
    }

    fn plan(&mut self, aim: &Aim, memory: &mut AttitudeMemory) -> Option<Decision> {
        condensed::write_given(aim, memory, &mut self.given);
        self.gain.write_plan(&self.given, &self.unchanged, self.demand.as_view_mut());
        Decision::explicit(self.demand.fixed_rows::<INPUTS>(0).into_owned())
    }
}
