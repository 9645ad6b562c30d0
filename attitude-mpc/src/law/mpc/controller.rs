//! The MPC law: the unconstrained plan by the model of the tick, and the plan inside the limits.
//!
//! The memory has no part of the model, so that a process with another model can continue the flight. Both processes
//! plan from the same state, disturbance and last demand, so only the difference of their gains makes the demand jump.
//! Test `a_controller_of_another_model_continues_the_flight`.

use airframe::linear::INPUTS;
use contract::message::{Kinematics, SolveStatus};
use nalgebra::{DVector, DVectorView, Vector4};
use settings::{Fault, Model, Scenario, ScenarioError};

use super::condensed::{self, Condensed, GIVEN, Gain};
use super::constrained::Constrained;
use super::preview;
use super::schedule::GainSchedule;
use crate::law::attitude_law::{Aim, AttitudeLaw, Decision, PlanEffort, is_computable};
use crate::law::coupling::Coupling;
use crate::memory::{AttitudeMemory, WarmStart};
use crate::model::PredictionModel;

/// Model predictive control law, with its buffers.
pub struct Mpc {
    unconstrained_law: UnconstrainedLaw,
    constrained: Option<Constrained>,
    sample_ns: u64,
    /// Given numbers `(x; r; d; v)`, n + 15.
    given: DVector<f64>,
    /// Changes of the reference over the horizon, 7Np, or none.
    changes: DVector<f64>,
    /// Unconstrained plan, 4Nu.
    unconstrained: DVector<f64>,
    /// Number of elements of `unconstrained` that are computed: all, or the first move.
    computed: usize,
    /// Plan to follow, 4Nu; its first `computed` elements are valid.
    followed: DVector<f64>,
}

/// Plan without the actuators' limits.
enum UnconstrainedLaw {
    /// One gain for every condition; with the model `coupled`, the coupling term for the prediction of the estimate.
    Gain(Gain, Option<Coupling>),
    /// One gain for each of several flight conditions.
    Scheduled(Box<GainSchedule>),
}

impl Mpc {
    /// Builds the law of `scenario` for a `model`; the error names settings for which its problem is singular or
    /// infeasible.
    pub fn new(scenario: &Scenario, model: &PredictionModel) -> Result<Self, ScenarioError> {
        let problem = Condensed::new(model, scenario)?;
        let moves = DVector::zeros(INPUTS * scenario.nu());
        Ok(Self {
            constrained: Constrained::new(scenario, &problem, model.trim.roll_rad),
            unconstrained_law: match scenario.attitude.mpc.model {
                Model::Hover | Model::Coupled => UnconstrainedLaw::Gain(problem.gain, Coupling::of(scenario)),
                Model::Scheduled => UnconstrainedLaw::Scheduled(Box::new(GainSchedule::new(scenario)?)),
            },
            sample_ns: scenario.sample_ns(),
            given: DVector::zeros(model.states() + GIVEN),
            changes: DVector::zeros(condensed::change_count(scenario)),
            computed: moves.len(),
            unconstrained: moves.clone(),
            followed: moves,
        })
    }
}

impl AttitudeLaw for Mpc {
    fn observe(&mut self, measured: &Kinematics) {
        match &mut self.unconstrained_law {
            UnconstrainedLaw::Gain(_, coupling) => coupling.iter_mut().for_each(|it| it.observe(measured)),
            UnconstrainedLaw::Scheduled(schedule) => schedule.observe(measured),
        }
    }

    fn coupling(&self) -> Vector4<f64> {
        match &self.unconstrained_law {
            UnconstrainedLaw::Gain(_, Some(coupling)) => coupling.on_inputs(),
            _ => Vector4::zeros(),
        }
    }

    fn predict(
        &self,
        hover: &PredictionModel,
        x: &DVectorView<f64>,
        u: &Vector4<f64>,
        d: &Vector4<f64>,
        next: &mut DVector<f64>,
    ) {
        match &self.unconstrained_law {
            UnconstrainedLaw::Gain(..) => hover.predict(x, u, d, next),
            UnconstrainedLaw::Scheduled(schedule) => schedule.predict(x, u, d, next),
        }
    }

    fn plan(&mut self, aim: &Aim, memory: &mut AttitudeMemory) -> Option<Decision> {
        let Self { given, changes, unconstrained, computed, followed, .. } = self;
        condensed::write_given(aim, memory, given);
        preview::write_changes(aim.goal, aim.age_ns, self.sample_ns, changes);
        match &mut self.unconstrained_law {
            UnconstrainedLaw::Gain(gain, _) => {
                let is_clear = self.constrained.as_ref().is_none_or(|it| it.is_clear(given, changes, aim.tick));
                *computed = if is_clear { INPUTS } else { unconstrained.len() };
                gain.write_plan(given, changes, unconstrained.rows_mut(0, *computed));
            }
            UnconstrainedLaw::Scheduled(schedule) => schedule.plan(given, changes, &aim.attitude_rad, unconstrained),
        }
        if !is_computable(&unconstrained.as_slice()[..*computed]) {
            return None;
        }
        let (status, account) = match &mut self.constrained {
            Some(constrained) if *computed == unconstrained.len() => {
                constrained.choose(unconstrained, given, aim.tick, followed)
            }
            _ => {
                followed.rows_mut(0, *computed).copy_from(&unconstrained.rows(0, *computed));
                (SolveStatus::Explicit, PlanEffort::default())
            }
        };
        Some(Decision { demand: followed.fixed_rows::<INPUTS>(0).into_owned(), status, account }) // (6)
    }

    fn plans(&mut self) -> Option<[&DVector<f64>; 2]> {
        if let UnconstrainedLaw::Gain(gain, _) = &self.unconstrained_law {
            gain.write_plan(&self.given, &self.changes, self.unconstrained.as_view_mut());
        }
        Some([&self.unconstrained, &self.followed])
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.constrained.iter_mut().for_each(|constrained| constrained.apply_fault(number, fault));
    }

    fn hurry(&mut self, hurried: bool) {
        self.constrained.iter_mut().for_each(|constrained| constrained.hurried = hurried);
    }

    fn warm_start(&self) -> WarmStart {
        self.constrained.as_ref().map_or(WarmStart::default(), |it| it.solver.warm_start())
    }

    fn start_from(&mut self, from: &WarmStart) -> bool {
        self.constrained.as_mut().is_none_or(|it| it.solver.start_from(from))
    }
}
