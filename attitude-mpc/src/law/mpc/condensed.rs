//! Condensed optimal control problem: the states are eliminated, which leaves a quadratic cost in the moves.
//!
//! ```text
//! J(U) = sum_{k=1}^{Np-1} |x_k - r|_Q^2 + |x_Np - r|_P^2
//!      + sum_{k=0}^{Nu-1} (|u_k - u_s|_R^2 + |u_k - u_{k-1}|_R2^2)                          (4)
//! ```
//!
//! The given numbers are `c = (x; r; d; v)`, `v` being the last demand `u_{-1}`. Each deviation from the target is
//! linear in `c` and in the moves `U`. With `Q_k` = Q, or P for k = Np, and the block diagonal `Rb` of R:
//!
//! ```text
//! x_k - r = E_k c + G_k U
//! J(U)    = 2 (1/2 U'H U + f'U) + constant
//! H       = sum G_k' Q_k G_k + Rb,   f = sum G_k' Q_k E_k c - Rb u_s,   both with the terms of R2 added
//! U*      = -H^-1 f                            without constraints
//! ```
//!
//! If the reference changes over the horizon ([`crate::law::mpc::preview`]), `x_k` follows `r + dr_k`, and `u_(k-1)`
//! follows the target of that reference, which is linear in `dr_k` too.
//!
//! Departure: the paper regulates to zero; here the states follow `r`, and the inputs and the lag states follow `u_s`.
//! `u_s = -d` holds the vehicle at trim against the disturbance. If `d` is estimated, `u_s = S r - d` holds it at the
//! reference: `S r` makes up for the part of gravity that acts on w at a roll other than trim. Pannocchia and Rawlings,
//! *AICHE Journal* 49 (2003), compute such a target each sample; here the target is linear in `(r; d)` and part of the
//! gain. Tests `a_constant_disturbance_leaves_no_offset`, `a_roll_away_from_trim_leaves_no_offset`.
//!
//! Departure: after Nu the paper uses `u = K x` without giving K; here the last move is held. Test
//! `val_first_move_gains`.

use airframe::linear::{INPUTS, STATES};
use airframe::riccati;
use nalgebra::{Cholesky, DMatrix, DVector, DVectorViewMut, Dyn, Vector4};
use settings::{Attitude, MpcSettings, Scenario, ScenarioError, Terminal};

use crate::disturbance::DRIVEN;
use crate::law::attitude_law::Aim;
use crate::law::mpc::at_speed::FlightModel;
use crate::memory::AttitudeMemory;
use crate::model::PredictionModel;

/// Number of given numbers besides the state: r, d, v.
pub const GIVEN: usize = STATES + INPUTS + INPUTS;
/// Index of p in state and reference; q and r follow.
pub const RATES: usize = 4;

/// Number added to the diagonal of `Q` in the Riccati equation, because states without weight leave `Q` semidefinite.
const DARE_REGULARISATION: f64 = 1e-9;

/// Smallest accepted pivot, the squared diagonal element of the Cholesky factor, as a share of the Hessian's diagonal
/// element. The shipped profiles have 0.05, and 4e-4 with 200 moves; rounding begins at 1e-13.
const INDEPENDENT: f64 = 1e-11;

/// Quadratic cost in the moves, and its minimiser as a gain.
#[derive(Debug, Clone)]
pub struct Condensed {
    /// Hessian `H`, 4Nu x 4Nu.
    pub hessian: DMatrix<f64>,
    /// Gain of `U*`.
    pub gain: Gain,
    /// Predicted states of the first Nu samples.
    pub course: PredictedStates,
}

/// Gain of `U* = given (x; r; d; v) + changes (dr_1; ...; dr_Np)`. Each move is col, lon, lat, ped.
#[derive(Debug, Clone)]
pub struct Gain {
    /// Gain of the given numbers, 4Nu x (n + 15).
    pub given: DMatrix<f64>,
    /// Gain of the changes of the reference, 4Nu x 7Np; without a preview it has no columns.
    pub changes: DMatrix<f64>,
}

impl Gain {
    /// Writes the first moves for the given numbers and the changes of the reference to `plan`, as many as `plan` has
    /// room for.
    pub fn write_plan(&self, given: &DVector<f64>, changes: &DVector<f64>, mut plan: DVectorViewMut<f64>) {
        plan.fill(0.0);
        self.add_plan(1.0, given, changes, plan);
    }

    /// Adds `share` of the first moves for the given numbers and the changes of the reference to `plan`, as many as
    /// `plan` has room for.
    pub fn add_plan(&self, share: f64, given: &DVector<f64>, changes: &DVector<f64>, mut plan: DVectorViewMut<f64>) {
        for row in (0..plan.nrows()).step_by(INPUTS) {
            let mut u: Vector4<f64> = plan.fixed_rows::<INPUTS>(row).into_owned();
            for (gain, numbers) in [(&self.given, given), (&self.changes, changes)] {
                for (column, number) in gain.column_iter().zip(numbers.iter()) {
                    u += column.fixed_rows::<INPUTS>(row) * share * *number; // (5)
                }
            }
            plan.fixed_rows_mut::<INPUTS>(row).copy_from(&u);
        }
    }
}

/// Predicted states of the first Nu samples, stacked: `free (x; r; d; v) + forced U`.
#[derive(Debug, Clone)]
pub struct PredictedStates {
    /// Matrix of the given numbers, nNu x (n + 15).
    pub free: DMatrix<f64>,
    /// Matrix of the moves, nNu x 4Nu.
    pub forced: DMatrix<f64>,
}

impl Condensed {
    /// Condenses the problem of a model and its weights; the error names weights for which it is singular.
    pub fn new(model: &PredictionModel, scenario: &Scenario) -> Result<Self, ScenarioError> {
        Self::weighted(model, scenario, |_| {}, scenario.attitude.disturbance_gain > 0.0)
    }

    /// Condenses the problem of a model at a flight condition. The inputs' target always holds the reference: `follows`
    /// in `input_targets` is `true`.
    pub fn at_speed(flight: &FlightModel, scenario: &Scenario) -> Result<Self, ScenarioError> {
        Self::weighted(&flight.model, scenario, |q| flight.lean_on(q), true)
    }

    /// Condenses with `Q` as changed by `change_q`; `follows` as in [`input_targets`].
    fn weighted(
        model: &PredictionModel,
        scenario: &Scenario,
        change_q: impl FnOnce(&mut DMatrix<f64>),
        follows: bool,
    ) -> Result<Self, ScenarioError> {
        let (n, weights) = (model.states(), &scenario.attitude.mpc);
        let (np, nu) = (scenario.np(), scenario.nu());
        let (mut q, r) = stage_weights(n, weights);
        change_q(&mut q);
        let p = terminal_weight(model, weights, &q, &r)?;
        let r2 = DMatrix::from_diagonal(&DVector::from_row_slice(&weights.r_rate));
        let inputs = input_targets(model, follows);
        let targets = targets(model, &inputs);

        // `free` maps (x; r; d; v) to the states without moves; `forced` maps the moves to their effect on the states.
        let mut free = DMatrix::zeros(n, n + GIVEN);
        free.columns_mut(0, n).fill_with_identity();
        let mut forced = DMatrix::zeros(n, INPUTS * nu);
        let mut hessian = DMatrix::zeros(INPUTS * nu, INPUTS * nu);
        let mut gradient = DMatrix::zeros(INPUTS * nu, n + GIVEN);
        let mut pull_of_changes = DMatrix::zeros(INPUTS * nu, change_count(scenario));
        let mut course =
            PredictedStates { free: DMatrix::zeros(n * nu, n + GIVEN), forced: DMatrix::zeros(n * nu, INPUTS * nu) };

        for k in 1..=np {
            let newest = (k - 1).min(nu - 1); // after Nu the last move is held
            free = &model.a * free;
            add(&mut free, 0, n + STATES, &model.e);
            forced = &model.a * forced;
            add(&mut forced, 0, INPUTS * newest, &model.b);
            if k <= nu {
                course.free.rows_mut(n * (k - 1), n).copy_from(&free);
                course.forced.rows_mut(n * (k - 1), n).copy_from(&forced);
            }
            let pull = forced.transpose() * if k < np { &q } else { &p };
            hessian += &pull * &forced; // (4)
            gradient += &pull * (&free - &targets);
            if pull_of_changes.ncols() > 0 {
                add(&mut pull_of_changes, 0, STATES * (k - 1), &(pull * targets.columns(n, STATES)));
            }
        }
        for k in 0..nu {
            add(&mut hessian, INPUTS * k, INPUTS * k, &r);
            add(&mut gradient, INPUTS * k, 0, &-(&r * &inputs));
            add(&mut hessian, INPUTS * k, INPUTS * k, &r2);
            if let Some(before) = k.checked_sub(1).map(|before| INPUTS * before) {
                add(&mut hessian, before, before, &r2);
                add(&mut hessian, INPUTS * k, before, &-&r2);
                add(&mut hessian, before, INPUTS * k, &-&r2);
            } else {
                add(&mut gradient, 0, n + STATES + INPUTS, &-&r2);
            }
            if pull_of_changes.ncols() > 0 {
                add(&mut pull_of_changes, INPUTS * k, STATES * k, &(&r * inputs.columns(n, STATES)));
            }
        }
        let factor = factor(&hessian)?;
        let gain = Gain { given: -factor.solve(&gradient), changes: factor.solve(&pull_of_changes) };
        if gain.given.iter().chain(&course.free).chain(&course.forced).all(|x| x.is_finite()) {
            Ok(Self { hessian, gain, course })
        } else {
            Err(singular_hessian())
        }
    }
}

/// Writes the given numbers `(x; r; d; v)` of `aim`, with the disturbance and the last demand in `memory`.
pub fn write_given(aim: &Aim, memory: &AttitudeMemory, given: &mut DVector<f64>) {
    let n = aim.start.len();
    given.rows_mut(0, n).copy_from(aim.start);
    given.rows_mut(n, STATES).copy_from_slice(&aim.reference);
    given.rows_mut(n + STATES, INPUTS).copy_from(&memory.disturbance);
    given.rows_mut(n + STATES + INPUTS, INPUTS).copy_from(&memory.demand());
}

/// Number of the changes of the reference over the horizon, 7Np: 0 without a preview.
pub fn change_count(scenario: &Scenario) -> usize {
    if scenario.guidance.preview_s > 0.0 { STATES * scenario.np() } else { 0 }
}

/// Weights `Q`, n x n with zeros for the lag states, and `R`.
fn stage_weights(n: usize, weights: &MpcSettings) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut q = DMatrix::zeros(n, n);
    q.view_mut((0, 0), (STATES, STATES)).set_diagonal(&DVector::from_row_slice(&weights.q));
    (q, DMatrix::from_diagonal(&DVector::from_row_slice(&weights.r)))
}

/// Terminal weight `P`, n x n.
fn terminal_weight(
    model: &PredictionModel,
    weights: &MpcSettings,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>, ScenarioError> {
    let n = model.states();
    match weights.terminal {
        Terminal::Zero => Ok(DMatrix::zeros(n, n)),
        Terminal::Q => Ok(q.clone()),
        Terminal::Dare => dare(model, q, r),
    }
}

/// Matrix of the cost over an infinite horizon, n x n; the error names weights for which none exists.
fn dare(model: &PredictionModel, q: &DMatrix<f64>, r: &DMatrix<f64>) -> Result<DMatrix<f64>, ScenarioError> {
    let regularised = q + DMatrix::identity(q.nrows(), q.nrows()) * DARE_REGULARISATION;
    riccati::solve(&model.a, &model.b, &regularised, r).ok_or_else(|| {
        ScenarioError::of(
            "`attitude.mpc.q`, `attitude.mpc.r` and `airframe` leave the Riccati equation without a solution".into(),
            "weights and inertias nearer to each other, or `attitude.mpc.terminal` = \"q\" with `attitude.law` = \"mpc\""
                .into(),
        )
    })
}

/// Cholesky factor of a Hessian of moves; an error if a pivot is no larger than rounding, because the moves are then
/// linearly dependent.
fn factor(hessian: &DMatrix<f64>) -> Result<Cholesky<f64, Dyn>, ScenarioError> {
    let cholesky = hessian.clone().cholesky().ok_or_else(singular_hessian)?;
    let left =
        cholesky.l_dirty().diagonal().component_mul(&cholesky.l_dirty().diagonal()).component_div(&hessian.diagonal());
    if left.iter().all(|share| *share > INDEPENDENT) { Ok(cholesky) } else { Err(singular_hessian()) }
}

fn singular_hessian() -> ScenarioError {
    ScenarioError::of(
        "`attitude.mpc.r` is so small beside `attitude.mpc.q` that the moves of a plan cannot be told apart".into(),
        "a larger `attitude.mpc.r`, a smaller `attitude.mpc.q`, or a shorter `attitude.mpc.control_horizon_s`".into(),
    )
}

/// Gain of the linear-quadratic regulator, the same cost over an infinite horizon without constraints: `u = gain (x; r;
/// d; v)`, 4 x (n + 15). The regulator has no preview.
pub fn regulator(model: &PredictionModel, settings: &Attitude) -> Result<Gain, ScenarioError> {
    let (q, r) = stage_weights(model.states(), &settings.mpc);
    let s = dare(model, &q, &r)?;
    let bs = model.b.transpose() * s;
    let k = factor(&(&bs * &model.b + r))?.solve(&(bs * &model.a));
    let n = model.states();
    let inputs = input_targets(model, settings.disturbance_gain > 0.0);
    let mut gain = &k * targets(model, &inputs) + inputs;
    let mut on_state = gain.columns_mut(0, n);
    on_state -= &k;
    let is_finite = gain.iter().all(|x| x.is_finite());
    if is_finite { Ok(Gain { given: gain, changes: DMatrix::zeros(INPUTS, 0) }) } else { Err(singular_hessian()) }
}

/// Targets of the states by `(x; r; d; v)`, n x (n + 15): `r` for the first seven, the targets of the inputs for the
/// lag states.
fn targets(model: &PredictionModel, inputs: &DMatrix<f64>) -> DMatrix<f64> {
    let n = model.states();
    let mut targets = DMatrix::zeros(n, n + GIVEN);
    targets.view_mut((0, n), (STATES, STATES)).fill_with_identity();
    if model.has_lag() {
        targets.rows_mut(STATES, INPUTS).copy_from(inputs);
    }
    targets
}

/// Targets `u_s` of the inputs by `(x; r; d; v)`, 4 x (n + 15): `S r - d` if `follows`, else `-d`.
///
/// At rest `x = r` and `r = A r + E (u_s + d)`; the rows of the velocities that the inputs drive determine `u_s`. Rates
/// in `r` are left out, because a vehicle that turns is not at rest.
fn input_targets(model: &PredictionModel, follows: bool) -> DMatrix<f64> {
    let n = model.states();
    let mut inputs = DMatrix::zeros(INPUTS, n + GIVEN);
    if follows {
        let leaving = DMatrix::identity(STATES, STATES) - model.a.view((0, 0), (STATES, STATES));
        let driven = model.e.select_rows(&DRIVEN);
        let mut held =
            driven.lu().solve(&leaving.select_rows(&DRIVEN)).expect("each input drives a velocity of its own");
        held.columns_mut(RATES, 3).fill(0.0);
        inputs.view_mut((0, n), (INPUTS, STATES)).copy_from(&held);
    }
    inputs.view_mut((0, n + STATES), (INPUTS, INPUTS)).fill_diagonal(-1.0);
    inputs
}

/// Adds `block` to the part of `matrix` whose first element is at `row`, `column`.
fn add(matrix: &mut DMatrix<f64>, row: usize, column: usize, block: &DMatrix<f64>) {
    let mut part = matrix.view_mut((row, column), block.shape());
    part += block;
}

#[cfg(test)]
mod tests;
