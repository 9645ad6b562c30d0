//! Interface of a law: its inputs at a sample, and its results.
//!
//! ```text
//! observe    the model of this tick, from the measured motion
//! estimate   the disturbance, by the laws that have an estimate of their own
//! predict    the state at which the demand acts, and the state expected at the next sample
//! plan       the demand
//! ```
//!
//! All that a law remembers from tick to tick is in [`AttitudeMemory`] and [`WarmStart`], which have one layout for all
//! laws, so that a process with another law can continue the flight. A law writes to a copy of the memory, which the
//! controller keeps if the law returns a demand.

use airframe::linear::STATES;
use contract::actuation::Actuation;
use contract::message::{Kinematics, SolveStatus, State};
use nalgebra::{DVector, DVectorView, Vector4};
use settings::Fault;

use crate::goal::Goal;
use crate::memory::{AttitudeMemory, WarmStart};
use crate::model::PredictionModel;

/// Bound on the demands of a plan \[N, N m\]: the solvers compute up to its fourth power, which is still finite.
const MAX_PLAN: f64 = 1e50;

/// Control law of attitude and vertical velocity.
pub trait AttitudeLaw {
    /// Updates the model of this tick from a sample.
    fn observe(&mut self, _measured: &Kinematics) {}

    /// Returns whether the law estimates the disturbance itself. Otherwise the controller estimates it by the law's
    /// prediction.
    fn has_own_estimate(&self) -> bool {
        false
    }

    /// Updates the law's own estimate of the disturbance in `memory`, which has the state of the previous sample.
    fn estimate(&self, _sample: &EstimateInput, _memory: &mut AttitudeMemory) {}

    /// Returns the change of w by coupling as a disturbance on the inputs, which the estimate must not contain.
    fn coupling(&self) -> Vector4<f64> {
        Vector4::zeros()
    }

    /// Predicts as [`PredictionModel::predict`] by the model of this tick, which is `hover` if the law has no other
    /// model.
    fn predict(
        &self,
        hover: &PredictionModel,
        x: &DVectorView<f64>,
        u: &Vector4<f64>,
        d: &Vector4<f64>,
        next: &mut DVector<f64>,
    ) {
        hover.predict(x, u, d, next);
    }

    /// Computes the demand for `aim` under the disturbance in `memory`, and updates the integrals there; `None` if the
    /// demand would overflow.
    fn plan(&mut self, aim: &Aim, memory: &mut AttitudeMemory) -> Option<Decision>;

    /// Returns the unconstrained plan of the newest tick, 4Nu, and the plan that is followed; `None` under a law that
    /// does not plan ahead. If only the first move was computed, only this move of the followed plan is valid.
    fn plans(&mut self) -> Option<[&DVector<f64>; 2]> {
        None
    }

    /// Updates fault `number` if it is a fault of the law's solver.
    fn apply_fault(&mut self, _number: usize, _fault: &Fault) {}

    /// Sets whether the next steps avoid the solver, because a deadline was missed.
    fn hurry(&mut self, _hurried: bool) {}

    /// Returns the constraints that the next solve starts from.
    fn warm_start(&self) -> WarmStart {
        WarmStart::default()
    }

    /// Makes the next solve start from `from`. Returns `false`, and changes nothing, if `from` does not fit the solver.
    fn start_from(&mut self, _from: &WarmStart) -> bool {
        true
    }
}

/// Inputs of [`AttitudeLaw::estimate`] at a sample.
pub struct EstimateInput<'a> {
    /// Number of the sample.
    pub tick: u64,
    /// Measured motion, and the actuators by telemetry.
    pub state: &'a State,
    /// Positions of the actuators as the controller simulates them.
    pub modelled: Actuation,
    /// State `x` of the sample.
    pub x: &'a DVector<f64>,
}

/// Problem of one tick. States and references are (w, phi, theta, psi, p, q, r, ...) as deviations from trim.
pub struct Aim<'a> {
    /// Number of the sample.
    pub tick: u64,
    /// Predicted state when the demand takes effect, n.
    pub start: &'a DVector<f64>,
    /// Reference; its heading has the full turns that bring it nearest to the heading of `start`.
    pub reference: [f64; STATES],
    /// Roll from trim and pitch of the sample \[rad\], at which guidance made the reference.
    pub attitude_rad: [f64; 2],
    /// Goal that `reference` was made from, with its preview.
    pub goal: &'a Goal,
    /// Time from the moment of the goal to the moment at which the demand acts \[ns\].
    pub age_ns: f64,
    /// Input of the command in force less the demand that it answers \[N, N m, N m, N m\].
    pub unfollowed: Vector4<f64>,
}

/// Demand of a law, with the status and the effort of its plan.
#[derive(Debug, Clone, Copy)]
pub struct Decision {
    /// Demand col, lon, lat, ped \[N, N m, N m, N m\].
    pub demand: Vector4<f64>,
    /// Status of the plan.
    pub status: SolveStatus,
    /// Effort of the plan, and the limits it touches.
    pub account: PlanEffort,
}

impl Decision {
    /// Makes the decision of a law without limits; `None` if the demand would overflow.
    pub fn explicit(demand: Vector4<f64>) -> Option<Self> {
        is_computable(demand.as_slice()).then_some(Self {
            demand,
            status: SolveStatus::Explicit,
            account: PlanEffort::default(),
        })
    }
}

/// Effort of a plan, and the limits it touches.
#[derive(Debug, Clone, Copy, Default)]
pub struct PlanEffort {
    /// Number of iterations of the solver.
    pub iterations: u64,
    /// Time in the solver \[ns\].
    pub solve_ns: u64,
    /// Number of actuator limits that the plan touches.
    pub touching: u64,
}

/// Returns whether solvers can compute with the moves of a plan.
pub fn is_computable(plan: &[f64]) -> bool {
    plan.iter().all(|u| u.abs() < MAX_PLAN)
}
