//! Prediction model at a flight condition other than hover, from [`airframe::at_speed`].
//!
//! States and inputs are deviations from hover, as in the [hover model](crate::model), so that memory and constraints
//! mean the same under each model. The part of the equations of motion that is not linear in these deviations, the
//! offset `o`, is a known disturbance on the inputs.
//!
//! Departure: the cost weighs the error of the climb, not the error of w. At the speed u, a pitch of dtheta changes w
//! by u dtheta without any climb. Guidance computes the reference of w at the present attitude. If this reference were
//! held while the vehicle pitches, it would stand for another climb. `T` maps w to w at the reference attitude (`lean`
//! of the model): Q becomes `T' Q T`, and the reference of w is mapped likewise. Test
//! `a_change_of_pitch_at_constant_climb_costs_no_climb`.

use airframe::linear::{INPUTS, STATES};
use airframe::{AtSpeed, FlightPoint, Trim};
use nalgebra::{DMatrix, DVector, DVectorView, Vector4};
use settings::Scenario;

use crate::model::PredictionModel;

/// Indices of phi and theta in the state.
const ANGLES: [usize; 2] = [1, 2];

/// Prediction model at one flight condition.
#[derive(Debug, Clone)]
pub struct FlightModel {
    /// Matrices `Ad`, `Bd` and `Ed` at the point.
    pub model: PredictionModel,
    /// Known disturbance `o` \[N, N m, N m, N m\].
    pub offset: Vector4<f64>,
    /// Coefficients [`AtSpeed::lean`] \[m/s per rad\].
    pub lean: [f64; 2],
}

impl FlightModel {
    /// Builds the model of a scenario's vehicle at `point`.
    pub fn new(scenario: &Scenario, point: &FlightPoint) -> Self {
        let trim = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction);
        let AtSpeed { continuous, offset, lean } =
            AtSpeed::new(&scenario.airframe, &trim, &scenario.plant.drag(), point);
        Self { model: PredictionModel::of(scenario, &trim, &continuous), offset, lean }
    }

    /// Computes `next += share * f(x, u, d)`, `f` being the state one sample after `x`.
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
        next.gemv(share, &self.model.e, &(d + self.offset), 1.0); // (1) with the offset
    }

    /// Converts `given` = (x; r; d; v), n states first, to this model: the reference of w, made at the measured
    /// `attitude_rad` (phi from trim, theta), becomes a reference at the reference attitude, and `o` is added to d.
    pub fn put_into(&self, given: &mut DVector<f64>, n: usize, attitude_rad: &[f64; 2]) {
        self.lean_on_reference(given.rows_mut(n, STATES).as_mut_slice(), attitude_rad);
        let mut d = given.rows_mut(n + STATES, INPUTS);
        d += self.offset;
    }

    /// Converts the changes of a reference over a horizon, seven to a sample.
    pub fn lean_on_changes(&self, changes: &mut DVector<f64>) {
        changes.as_mut_slice().chunks_exact_mut(STATES).for_each(|change| self.lean_on_reference(change, &[0.0; 2]));
    }

    /// Converts a reference (w, phi, theta, ...) that was made at `attitude_rad`.
    fn lean_on_reference(&self, reference: &mut [f64], attitude_rad: &[f64; 2]) {
        for ((lean, angle), measured) in self.lean.iter().zip(ANGLES).zip(attitude_rad) {
            reference[0] -= lean * (reference[angle] - measured);
        }
    }

    /// Converts a weight on climb and attitude to a weight on w and attitude: `T' weight T`.
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
