//! The prediction model at a point of flight other than hover, from [`airframe::at_speed`].
//!
//! States and inputs are those of the [hover model](crate::model), deviations from hover, so that memory and constraints mean the
//! same under each model. What the equations of motion have beside the linear terms acts as one more disturbance on the
//! inputs, which is known.
//!
//! Departure: the cost weighs the miss of the climb, not that of w. At speed u a pitch of dtheta changes w by u dtheta
//! without any climb, and guidance computes the reference of w at the present attitude; a reference held while the vehicle
//! pitches would be one of another climb. With `T` from w to w at the attitude of reference (`lean` of the model), Q becomes `T' Q T`, and the reference
//! of w that at the attitude of reference. Test `a_change_of_pitch_at_constant_climb_costs_no_climb`.

use airframe::linear::{INPUTS, STATES};
use airframe::{AtSpeed, Drag, FlightPoint, Parameters, Trim};
use contract::Scenario;
use nalgebra::{DMatrix, DVector, DVectorView, Vector4};

use crate::model::PredictionModel;

/// Where phi and theta stand in the state.
const ANGLES: [usize; 2] = [1, 2];

/// The model at one point.
#[derive(Debug, Clone)]
pub struct FlightModel {
    /// `Ad`, `Bd` and `Ed`, in place of those of hover.
    pub model: PredictionModel,
    /// The known disturbance `o` \[N, N m, N m, N m\].
    pub offset: Vector4<f64>,
    /// See [`AtSpeed`] \[m/s per rad\].
    pub lean: [f64; 2],
    vehicle: Parameters,
    drag: Drag,
    trim: Trim,
    lag_s: f64,
    sample_s: f64,
}

impl FlightModel {
    /// The model of a scenario's vehicle at `point`.
    pub fn new(scenario: &Scenario, point: &FlightPoint) -> Self {
        let model = PredictionModel::new(scenario);
        let mut at_point = Self {
            offset: Vector4::zeros(),
            lean: [0.0; 2],
            vehicle: scenario.airframe,
            drag: scenario.plant.drag(),
            trim: model.trim,
            lag_s: scenario.mpc.actuator_lag_model_s,
            sample_s: scenario.sample_s(),
            model,
        };
        at_point.move_to(point);
        at_point
    }

    /// Linearises at another point. Allocates nothing.
    pub fn move_to(&mut self, point: &FlightPoint) {
        let at_speed = AtSpeed::new(&self.vehicle, &self.trim, &self.drag, point);
        let PredictionModel { a, b, e, .. } = &mut self.model;
        at_speed.discretise_into(self.lag_s, self.sample_s, [a, b, e]);
        (self.offset, self.lean) = (at_speed.offset, at_speed.lean);
    }

    /// Adds `share` of the state one sample after `x` to `next`.
    pub fn add_prediction(
        &self,
        share: f64,
        x: &DVectorView<f64>,
        u: &Vector4<f64>,
        d: &Vector4<f64>,
        next: &mut DVector<f64>,
    ) {
        next.gemv(share, &self.model.a, x, 1.0);
        next.gemv(share, &self.model.b, u, 1.0);
        next.gemv(share, &self.model.e, &(d + self.offset), 1.0); // as (1)
    }

    /// Turns `given` = (x; r; d; v), n states first, into what this model has for them: the reference of w made at the measured
    /// `attitude_rad` (phi from trim, theta) becomes that at the attitude of reference, and `o` joins the disturbance.
    pub fn put_into(&self, given: &mut DVector<f64>, n: usize, attitude_rad: &[f64; 2]) {
        for ((lean, angle), measured) in self.lean.iter().zip(ANGLES).zip(attitude_rad) {
            given[n] -= lean * (given[n + angle] - measured);
        }
        let mut d = given.rows_mut(n + STATES, INPUTS);
        d += self.offset;
    }

    /// Turns a weight on climb and attitude into one on w and attitude: `T' weight T`.
    pub fn lean_on(&self, weight: &mut DMatrix<f64>) {
        for (lean, angle) in self.lean.iter().zip(ANGLES) {
            for i in 0..weight.nrows() {
                weight[(i, angle)] += lean * weight[(i, 0)];
            }
        }
        for (lean, angle) in self.lean.iter().zip(ANGLES) {
            for i in 0..weight.ncols() {
                weight[(angle, i)] += lean * weight[(0, i)];
            }
        }
    }
}
