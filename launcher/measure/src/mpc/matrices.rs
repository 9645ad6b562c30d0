//! The problems of a sequence as matrices, for whoever solves them.
//!
//! A problem is known by `H`, the set of the plans, and the numbers `(x; r; d)` that a tick brings. These are put together
//! here from the messages, as the controller does it: the estimate `d` and the demand that the prediction starts with
//! are what it published. A test holds the plans against its own.

use attitude_mpc::AttitudeMpc;
use attitude_mpc::condensed::Condensed;
use attitude_mpc::constraints::PlanSet;
use attitude_mpc::model::PredictionModel;
use contract::message::{Controls, Reference};
use contract::scenario::ScenarioError;
use nalgebra::{DMatrix, DVector, Vector4};

use super::problems::Sequence;

/// The optimisation problems of a sequence, in the order of the flight.
pub struct Problems {
    /// `H`, 4Nu x 4Nu.
    pub hessian: DMatrix<f64>,
    /// From `(x; r; d)` to the unconstrained plan, 4Nu x (n + 7 + 4).
    pub gain: DMatrix<f64>,
    /// What a plan may be; `None` where the flight had no constraints.
    pub set: Option<PlanSet>,
    /// What changes from tick to tick.
    pub ticks: Vec<Problem>,
}

/// What one tick brings.
pub struct Problem {
    /// What the controller answered.
    pub controls: Controls,
    /// Sample number.
    pub tick: u64,
    /// `(x; r; d)`, n + 7 + 4.
    pub given: DVector<f64>,
    /// The unconstrained plan `U*`, 4Nu.
    pub centre: DVector<f64>,
}

impl Problems {
    /// Takes `sequence` through its controller and states the problems it meets.
    pub fn of(sequence: &Sequence) -> Result<Self, ScenarioError> {
        let scenario = sequence.scenario_for(sequence.scenario.mpc.solver);
        let model = PredictionModel::new(&scenario);
        let Condensed { hessian, gain, course } = Condensed::new(&model, &scenario.mpc)?;
        let set = PlanSet::new(&scenario, &course, model.trim.roll_rad);

        let mut mpc = AttitudeMpc::new(&scenario);
        let mut actuation = model.trim.actuation;
        let mut last: Option<(u64, Vector4<f64>)> = None;
        let mut x = DVector::zeros(model.states());
        let mut ticks = vec![];
        for (state, reference) in &sequence.samples {
            let tick = state.stamp.tick;
            let samples = last.map_or(1, |(before, _)| tick.saturating_sub(before));
            let demand = last.map_or(Vector4::zeros(), |(_, demand)| demand);
            actuation = model.actuate(&actuation, &state.command_in_force.into(), samples);
            model.observe(&state.measured, &actuation, &mut x);
            let controls = mpc.step(state.stamp.tick, state, reference);
            let d = Vector4::from(controls.disturbance);
            let mut start = x.clone();
            if scenario.mpc.delay_compensation {
                model.predict(&x, &demand, &d, &mut start);
            }
            let given = given(&start, &model, reference, &d);
            ticks.push(Problem { controls, tick, centre: &gain * &given, given });
            last = Some((tick, controls.demand.into()));
        }
        Ok(Self { hessian, gain, set, ticks })
    }
}

fn given(start: &DVector<f64>, model: &PredictionModel, reference: &Reference, d: &Vector4<f64>) -> DVector<f64> {
    let r = model.deviation(reference.w_mps, &reference.attitude_rad, &reference.rates_radps);
    DVector::from_iterator(start.len() + r.len() + d.len(), start.iter().chain(&r).chain(d.iter()).copied())
}

#[cfg(test)]
mod tests {
    use contract::message::SolveStatus;

    use super::*;
    use crate::mpc::problems;

    #[test]
    fn the_problems_are_those_of_the_controller() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for sequence in problems::shipped(folder.path()).expect("the flights are whole") {
            let problems = Problems::of(&sequence).unwrap();
            let (mut explicit, mut solved) = (0, 0);
            for Problem { controls, centre, .. } in &problems.ticks {
                let wanted = centre.fixed_rows::<4>(0).into_owned();
                let inside = problems.set.as_ref().is_none_or(|set| set.violation(centre) <= 0.0);
                if controls.status == SolveStatus::Explicit as u64 {
                    let miss = (wanted - Vector4::from(controls.demand)).amax();
                    assert!(inside && miss < 1e-9 * wanted.amax().max(1.0), "{}: {miss:e}", sequence.name);
                    explicit += 1;
                } else {
                    assert!(!inside, "{}", sequence.name);
                    solved += 1;
                }
            }
            assert!(explicit > 100 && (solved > 10 || sequence.name == "survey"), "{explicit} {solved}");
        }
    }
}
