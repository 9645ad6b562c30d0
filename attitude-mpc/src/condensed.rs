//! The optimal control problem, condensed: the states are eliminated, and what is left is a quadratic in the moves.
//!
//! ```text
//! J(U) = sum_{k=1}^{Np-1} |x_k - r|_Q^2 + |x_Np - r|_P^2 + sum_{k=0}^{Nu-1} |u_k + d|_R^2      (4)
//! ```
//!
//! With `c = (x; r; d)` the given numbers, each miss of the target is linear in them and in the moves `U`:
//!
//! ```text
//! x_k - r = E_k c + G_k U
//! J(U)    = 2 (1/2 U'H U + f'U) + constant,   H = sum G_k' Q_k G_k + Rb,   f = sum G_k' Q_k E_k c + Rb d
//! U*      = -H^-1 f                            without constraints
//! ```
//!
//! Departure: the paper regulates to zero; we follow `r`, with `-d` as the target of the inputs and of the lag states,
//! so that a disturbance leaves no offset. Test `a_constant_disturbance_leaves_no_offset`.
//!
//! Departure: the paper closes the tail with `u = K x` and does not say which K; we hold the last move. Test
//! `val_first_move_gains`.

use airframe::linear::{INPUTS, STATES};
use contract::scenario::{Mpc, ScenarioError, Terminal};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::model::PredictionModel;
use crate::riccati;

/// Makes `Q` definite for the Riccati equation, where states without weight would leave it semidefinite.
const DARE_REGULARISATION: f64 = 1e-9;

/// Least share of a diagonal element of the Hessian that its Cholesky factor must leave: the shipped profiles leave 0.05,
/// and with 200 moves 1e-3; rounding begins at 1e-13.
const INDEPENDENT: f64 = 1e-11;

/// The quadratic in the moves, and its minimiser as a gain.
#[derive(Debug, Clone)]
pub struct Condensed {
    /// `H`, 4Nu x 4Nu.
    pub hessian: DMatrix<f64>,
    /// `U* = gain (x; r; d)`, 4Nu x (n + 7 + 4). Each move is col, lon, lat, ped.
    pub gain: DMatrix<f64>,
    /// The states on the way.
    pub course: Course,
}

/// The states of the first Nu samples, one below the other: `free (x; r; d) + forced U`.
#[derive(Debug, Clone)]
pub struct Course {
    /// nNu x (n + 7 + 4).
    pub free: DMatrix<f64>,
    /// nNu x 4Nu.
    pub forced: DMatrix<f64>,
}

impl Condensed {
    /// Condenses the problem of a model and its weights; an error names the weights that leave nothing to compute with.
    pub fn new(model: &PredictionModel, weights: &Mpc) -> Result<Self, ScenarioError> {
        let n = model.states();
        let (q, r) = stage_weights(n, weights);
        let p = terminal_weight(model, weights, &q, &r)?;
        let targets = targets(model);

        // The course of the states without a move, by (x; r; d), and what each move adds to it.
        let mut free = DMatrix::zeros(n, n + STATES + INPUTS);
        free.columns_mut(0, n).fill_with_identity();
        let mut forced = DMatrix::zeros(n, INPUTS * weights.nu);
        let mut hessian = DMatrix::zeros(INPUTS * weights.nu, INPUTS * weights.nu);
        let mut gradient = DMatrix::zeros(INPUTS * weights.nu, n + STATES + INPUTS);
        let mut course = Course {
            free: DMatrix::zeros(n * weights.nu, n + STATES + INPUTS),
            forced: DMatrix::zeros(n * weights.nu, INPUTS * weights.nu),
        };

        for k in 1..=weights.np {
            let newest = (k - 1).min(weights.nu - 1); // after Nu the last move is held
            free = &model.a * free;
            add(&mut free, 0, n + STATES, &model.e);
            forced = &model.a * forced;
            add(&mut forced, 0, INPUTS * newest, &model.b);
            if k <= weights.nu {
                course.free.rows_mut(n * (k - 1), n).copy_from(&free);
                course.forced.rows_mut(n * (k - 1), n).copy_from(&forced);
            }
            let pull = forced.transpose() * if k < weights.np { &q } else { &p };
            hessian += &pull * &forced; // (4)
            gradient += pull * (&free - &targets);
        }
        for k in 0..weights.nu {
            add(&mut hessian, INPUTS * k, INPUTS * k, &r);
            add(&mut gradient, INPUTS * k, n + STATES, &r);
        }
        let gain = -factor(&hessian)?.solve(&gradient);
        if gain.iter().chain(&course.free).chain(&course.forced).all(|x| x.is_finite()) {
            Ok(Self { hessian, gain, course })
        } else {
            Err(blurred())
        }
    }
}

/// `Q`, n x n with nothing on the lag states, and `R`.
fn stage_weights(n: usize, weights: &Mpc) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut q = DMatrix::zeros(n, n);
    q.view_mut((0, 0), (STATES, STATES)).set_diagonal(&DVector::from_row_slice(&weights.q));
    (q, DMatrix::from_diagonal(&DVector::from_row_slice(&weights.r)))
}

/// `P`, n x n.
fn terminal_weight(
    model: &PredictionModel,
    weights: &Mpc,
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

/// The cost of all time to come, n x n.
fn dare(model: &PredictionModel, q: &DMatrix<f64>, r: &DMatrix<f64>) -> Result<DMatrix<f64>, ScenarioError> {
    let regularised = q + DMatrix::identity(q.nrows(), q.nrows()) * DARE_REGULARISATION;
    riccati::solve(&model.a, &model.b, &regularised, r).ok_or_else(|| {
        ScenarioError::of(
            "`mpc.q`, `mpc.r` and `airframe` leave the Riccati equation without a solution".into(),
            "weights and inertias nearer to each other, or `mpc.terminal` = \"q\" with `mpc.law` = \"mpc\"".into(),
        )
    })
}

/// The Cholesky factor of a Hessian of moves, when it is one: where what is left of a diagonal element is rounding, the
/// moves cannot be told apart.
fn factor(hessian: &DMatrix<f64>) -> Result<Cholesky<f64, Dyn>, ScenarioError> {
    let cholesky = hessian.clone().cholesky().ok_or_else(blurred)?;
    let left =
        cholesky.l_dirty().diagonal().component_mul(&cholesky.l_dirty().diagonal()).component_div(&hessian.diagonal());
    if left.iter().all(|share| *share > INDEPENDENT) { Ok(cholesky) } else { Err(blurred()) }
}

fn blurred() -> ScenarioError {
    ScenarioError::of(
        "`mpc.r` is so small beside `mpc.q` that the moves of a plan cannot be told apart".into(),
        "a larger `mpc.r`, a smaller `mpc.q`, or a shorter `mpc.nu`".into(),
    )
}

/// The linear-quadratic regulator: the same cost over an infinite horizon, without constraints. Its one move is
/// `u = gain (x; r; d)`, 4 x (n + 7 + 4).
pub fn regulator(model: &PredictionModel, weights: &Mpc) -> Result<DMatrix<f64>, ScenarioError> {
    let (q, r) = stage_weights(model.states(), weights);
    let s = dare(model, &q, &r)?;
    let bs = model.b.transpose() * s;
    let k = factor(&(&bs * &model.b + r))?.solve(&(bs * &model.a));
    let n = model.states();
    let mut gain = &k * targets(model);
    let mut on_state = gain.columns_mut(0, n);
    on_state -= &k;
    add(&mut gain, 0, n + STATES, &-DMatrix::identity(INPUTS, INPUTS));
    if gain.iter().all(|x| x.is_finite()) { Ok(gain) } else { Err(blurred()) }
}

/// Where the states shall go, by `(x; r; d)`: the seven to `r`, the lag states to `-d`. n x (n + 7 + 4).
fn targets(model: &PredictionModel) -> DMatrix<f64> {
    let n = model.states();
    let mut targets = DMatrix::zeros(n, n + STATES + INPUTS);
    targets.view_mut((0, n), (STATES, STATES)).fill_with_identity();
    if model.has_lag() {
        targets.view_mut((STATES, n + STATES), (INPUTS, INPUTS)).fill_diagonal(-1.0);
    }
    targets
}

/// Adds `block` to the part of `matrix` whose first element is at `row`, `column`.
fn add(matrix: &mut DMatrix<f64>, row: usize, column: usize, block: &DMatrix<f64>) {
    let mut part = matrix.view_mut((row, column), block.shape());
    part += block;
}

#[cfg(test)]
mod tests;
