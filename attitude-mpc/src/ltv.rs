//! Linearisation at every sample, at the measured state: `mpc.model = "ltv"`.
//!
//! Model, Hessian and optimum are those of [`condensed`], recomputed each sample in preallocated matrices. Only the
//! states for the present given numbers are predicted, not a matrix for all given numbers, and the optimum comes from
//! one Cholesky factor. Test `ltv_is_the_condensed_problem_of_the_model`.
//!
//! The terminal weight is the Riccati solution at hover, in terms of the climb: solving that equation each sample would
//! take as long as all other steps. The model is constant over the horizon.

use airframe::linear::{INPUTS, STATES};
use airframe::{FlightPoint, Trim};
use contract::Scenario;
use contract::message::Kinematics;
use contract::scenario::{Mpc, ScenarioError};
use nalgebra::{Cholesky, DMatrix, DVector, Matrix4, SVector, Vector4};

use crate::at_speed::FlightModel;
use crate::condensed;
use crate::disturbance::DRIVEN;

/// Model of this sample, and buffers for its problem.
pub struct Ltv {
    /// Model at the measured state.
    pub flight: FlightModel,
    weights: Mpc,
    /// Horizons Np and Nu \[samples\].
    np: usize,
    nu: usize,
    /// Weights `Q` and `P` at hover, n x n.
    stage: DMatrix<f64>,
    terminal: DMatrix<f64>,
    /// Weights `Q` and `P` in terms of w.
    q: DMatrix<f64>,
    p: DMatrix<f64>,
    /// Effect of the moves on the states of a sample, n x 4Nu, and of the next.
    forced: DMatrix<f64>,
    forced_next: DMatrix<f64>,
    /// Product `Q forced`.
    pull: DMatrix<f64>,
    /// Hessian, 4Nu x 4Nu.
    hessian: DMatrix<f64>,
    /// Given numbers `(x; r; d; v)`, converted to the model.
    given: DVector<f64>,
    /// Changes of the reference, converted likewise.
    changes: DVector<f64>,
    /// States without a move, of a sample and of the next; then their deviation from the target.
    free: DVector<f64>,
    free_next: DVector<f64>,
}

impl Ltv {
    /// Allocates the problem of a scenario; the error is that of [`condensed::state_weights`].
    pub fn new(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let trim = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction);
        let hover =
            FlightPoint { velocity_mps: [0.0; 3], roll_rad: trim.roll_rad, pitch_rad: 0.0, rates_radps: [0.0; 3] };
        let flight = FlightModel::new(scenario, &hover);
        let (stage, terminal) = condensed::state_weights(&flight.model, &scenario.mpc)?;
        let (n, moves) = (stage.nrows(), INPUTS * scenario.nu());
        Ok(Self {
            weights: scenario.mpc.clone(),
            np: scenario.np(),
            nu: scenario.nu(),
            q: stage.clone(),
            p: terminal.clone(),
            stage,
            terminal,
            forced: DMatrix::zeros(n, moves),
            forced_next: DMatrix::zeros(n, moves),
            pull: DMatrix::zeros(n, moves),
            hessian: DMatrix::zeros(moves, moves),
            given: DVector::zeros(n + condensed::GIVEN),
            changes: DVector::zeros(condensed::change_count(scenario)),
            free: DVector::zeros(n),
            free_next: DVector::zeros(n),
            flight,
        })
    }

    /// Linearises at the measured state.
    pub fn observe(&mut self, measured: &Kinematics) {
        let Kinematics { velocity_mps, attitude_rad: [roll_rad, pitch_rad, _], rates_radps, .. } = *measured;
        self.flight.move_to(&FlightPoint { velocity_mps, roll_rad, pitch_rad, rates_radps });
    }

    /// Writes the unconstrained `plan` for `given` = (x; r; d; v) and the `changes` of r, a reference made at the
    /// measured `attitude_rad`. Fills the plan with NaN if the Hessian is not positive definite.
    pub fn plan(
        &mut self,
        given: &DVector<f64>,
        changes: &DVector<f64>,
        attitude_rad: &[f64; 2],
        plan: &mut DVector<f64>,
    ) {
        let n = self.free.len();
        self.given.copy_from(given);
        self.flight.put_into(&mut self.given, n, attitude_rad);
        self.changes.copy_from(changes);
        self.flight.lean_on_changes(&mut self.changes);
        let d = self.given.fixed_rows::<INPUTS>(n + STATES).into_owned();
        let last = self.given.fixed_rows::<INPUTS>(n + STATES + INPUTS).into_owned();
        for (weight, at_hover) in [(&mut self.q, &self.stage), (&mut self.p, &self.terminal)] {
            weight.copy_from(at_hover);
            self.flight.lean_on(weight);
        }

        plan.fill(0.0);
        self.hessian.fill(0.0);
        self.forced.fill(0.0);
        self.forced_next.fill(0.0);
        self.free.copy_from(&self.given.rows(0, n));
        let model = &self.flight.model;
        for k in 1..=self.np {
            let newest = INPUTS * (k - 1).min(self.nu - 1); // after Nu the last move is held
            let moved = newest + INPUTS; // later moves have no effect yet
            self.free_next.gemv(1.0, &model.a, &self.free, 0.0);
            self.free_next.gemv(1.0, &model.e, &d, 1.0);
            std::mem::swap(&mut self.free, &mut self.free_next);
            multiply(&mut self.forced_next, &model.a, &self.forced, moved);
            std::mem::swap(&mut self.forced, &mut self.forced_next);
            let mut block = self.forced.columns_mut(newest, INPUTS);
            block += &model.b;
            multiply(&mut self.pull, if k < self.np { &self.q } else { &self.p }, &self.forced, moved);
            for column in 0..moved {
                let forced = self.forced.column(column);
                for row in 0..=column {
                    self.hessian[(column, row)] += self.pull.column(row).dot(&forced); // (4), its lower triangle
                }
            }
            let (reference, held) = self.target(k, &d);
            self.free_next.rows_mut(0, STATES).copy_from(&reference);
            if n > STATES {
                self.free_next.rows_mut(STATES, INPUTS).copy_from(&held);
            }
            self.free_next -= &self.free;
            plan.rows_mut(0, moved).gemv_tr(1.0, &self.pull.columns(0, moved), &self.free_next, 1.0);
        }
        for first in (0..plan.len()).step_by(INPUTS) {
            let (_, held) = self.target(first / INPUTS + 1, &d);
            for i in 0..INPUTS {
                let (r, r2) = (self.weights.r[i], self.weights.r_rate[i]);
                self.hessian[(first + i, first + i)] += r + r2;
                plan[first + i] += r * held[i];
                if first > 0 {
                    self.hessian[(first + i - INPUTS, first + i - INPUTS)] += r2;
                    self.hessian[(first + i, first + i - INPUTS)] -= r2;
                } else {
                    plan[i] += r2 * last[i];
                }
            }
        }
        let hessian = std::mem::replace(&mut self.hessian, DMatrix::zeros(0, 0));
        if let Some(factor) = Cholesky::new(hessian) {
            factor.solve_mut(plan);
            self.hessian = factor.unpack_dirty();
        } else {
            self.hessian = DMatrix::zeros(plan.len(), plan.len()); // the numbers given were not finite
            plan.fill(f64::NAN);
        }
    }

    /// Reference of sample `k`, and the target `u_s` of the input before it, which holds the vehicle there against the
    /// disturbance: see [`condensed`].
    fn target(&self, k: usize, d: &Vector4<f64>) -> (SVector<f64, STATES>, Vector4<f64>) {
        let n = self.free.len();
        let model = &self.flight.model;
        let mut reference = self.given.fixed_rows::<STATES>(n).into_owned();
        if !self.changes.is_empty() {
            reference += self.changes.fixed_rows::<STATES>(STATES * (k - 1));
        }
        let driven = Matrix4::from_fn(|row, column| model.e[(DRIVEN[row], column)]);
        let leaving = Vector4::from_fn(|row, _| {
            let row = DRIVEN[row];
            let angles_and_w =
                (0..condensed::RATES).map(|i| (f64::from(u8::from(i == row)) - model.a[(row, i)]) * reference[i]);
            angles_and_w.sum()
        });
        let held = driven.try_inverse().map_or(Vector4::repeat(f64::NAN), |inverse| inverse * leaving) - d;
        (reference, held)
    }
}

/// Computes the first `columns` of `out = a b`, without the workspace that nalgebra's product allocates.
fn multiply(out: &mut DMatrix<f64>, a: &DMatrix<f64>, b: &DMatrix<f64>, columns: usize) {
    for column in 0..columns {
        out.column_mut(column).gemv(1.0, a, &b.column(column), 0.0);
    }
}
