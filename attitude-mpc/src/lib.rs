//! Controller of attitude and vertical velocity: linear MPC, and other laws in its place.
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`model`] | prediction model, lag states, the controller's own actuators | (1)-(2) |
//! | [`law`] | the laws, behind one trait | (3)-(6), (49)-(51) |
//! | [`disturbance`] | estimate of a constant disturbance on the inputs | |
//! | [`goal`] | the goal that the controller follows, also without references | |
//! | [`memory`] | state kept from tick to tick | |
//!
//! From a sample and a reference the controller makes the problem of a law: the goal chosen by the age of the
//! reference, the estimate of the disturbance, and the state at which the demand acts. The decision of the law becomes
//! the demand and updates the memory.
//!
//! Without a fresh state the last demand is repeated, with the status `Stale`. The fallback for that case is in the
//! mixer, nearer to the actuators.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod disturbance;
pub mod goal;
pub mod law;
pub mod memory;
pub mod model;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod tests;

use airframe::angle;
use contract::actuation::Actuation;
use contract::delay::Switch;
use contract::message::{Controls, Reference, SolveStatus, State};
use contract::snapshot::{self, OptionalTick, Snapshot};
use nalgebra::{DVector, Vector4};
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::Core;
use settings::{DelayCompensation, DelayName, Fault, Scenario, ScenarioError};

use disturbance::DisturbanceLaw;
use law::attitude_law::{Aim, AttitudeLaw, EstimateInput, PlanEffort};
use memory::{AttitudeMemory, Whole};
use model::PredictionModel;

/// Index of psi in state and reference, the only angle that is wrapped.
const HEADING: usize = 3;

/// Attitude controller.
pub struct AttitudeMpc {
    model: PredictionModel,
    law: Box<dyn AttitudeLaw>,
    disturbance_law: Option<DisturbanceLaw>,
    delay_compensation: DelayCompensation,
    /// Rotor speed up to which the vehicle counts as standing and follows no demand \[rotor speed unit\]; `None`
    /// without a ground.
    idle_speed: Option<f64>,
    sample_ns: u64,
    memory: AttitudeMemory,
    work: Work,
}

/// States of one tick, n elements each, in buffers so that a tick allocates nothing.
struct Work {
    /// State of this sample.
    x: DVector<f64>,
    /// State predicted for this sample; then a buffer for another prediction.
    predicted: DVector<f64>,
    /// State predicted for the moment at which the demand acts.
    start: DVector<f64>,
}

impl Core for AttitudeMpc {
    type Inputs = (Input<Reference>, Input<State>);
    type Answer = Controls;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self::try_new(scenario)?)
    }

    fn step(&mut self, tick: u64, (references, states): &Self::Inputs) -> Result<Controls, SessionError> {
        Ok(self.step(tick, states.known(), references.known()))
    }

    /// Packs the whole memory, except [`hurry`](Core::hurry), which belongs to the process.
    fn snapshot(&self) -> Snapshot {
        snapshot::pack(&Whole { memory: self.memory, warm_start: self.law.warm_start() })
    }

    /// Continues from a snapshot. Returns `false`, and changes nothing, if the snapshot is foreign, torn or not finite,
    /// or does not fit this model and solver.
    fn restore(&mut self, snapshot: &Snapshot) -> bool {
        let states = self.model.states() as u64;
        let Some(whole) = snapshot::unpack::<Whole>(snapshot).filter(|whole| whole.memory.states == states) else {
            return false;
        };
        let fits = self.law.start_from(&whole.warm_start);
        if fits {
            self.memory = whole.memory;
            if self.disturbance_law.is_none() && !self.law.has_own_estimate() {
                self.memory.disturbance = Vector4::zeros(); // this law would not update an estimate of another law
            }
        }
        fits
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.law.apply_fault(number, fault);
    }

    fn hurry(&mut self, do_less: bool) {
        self.law.hurry(do_less);
    }
}

impl AttitudeMpc {
    /// Builds as [`try_new`](Self::try_new) for a scenario that was checked; panics on an error.
    pub fn new(scenario: &Scenario) -> Self {
        Self::try_new(scenario).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Builds the controller of a scenario; the error names settings for which its problem is singular or infeasible.
    pub fn try_new(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let model = PredictionModel::new(scenario);
        let settings = &scenario.attitude;
        let state = DVector::zeros(model.states());
        Ok(Self {
            law: law::table::build(scenario, &model)?,
            memory: AttitudeMemory::new(model.states(), model.trim.actuation),
            work: Work { x: state.clone(), predicted: state.clone(), start: state },
            disturbance_law: DisturbanceLaw::new(&scenario.airframe, settings.disturbance_gain, scenario.sample_s()),
            delay_compensation: settings.delay_compensation,
            idle_speed: scenario.plant.ground.present.then(|| scenario.idle_speed()),
            sample_ns: scenario.sample_ns(),
            model,
        })
    }

    /// Returns the plans of the newest step, as [`AttitudeLaw::plans`].
    pub fn plans(&mut self) -> Option<[&DVector<f64>; 2]> {
        self.law.plans()
    }

    /// Computes the demand at `tick` from the newest state and reference: deviations of col, lon, lat, ped from trim
    /// \[N, N m, N m, N m\]. Of `state` the step uses only the tick, the measurements, the sensed actuators, and the
    /// command in force with its number and age.
    ///
    /// If the state is missing or older than `tick`, or an input is not finite or huge, the last demand is repeated.
    /// [`goal`] describes the goals that replace an old reference. The status reports each case.
    pub fn step(&mut self, tick: u64, state: &State, reference: &Reference) -> Controls {
        if state.stamp.sequence == 0 || state.stamp.tick < tick {
            return self.repeat(SolveStatus::Stale);
        }
        if !is_finite(state, reference) {
            return self.repeat(SolveStatus::BadInput);
        }
        let mut next = self.memory; // replaces the memory unless the last demand is repeated
        next.goal = self.memory.goal.renewed(reference);
        let goal = next.goal.at(tick, self.sample_ns, state, self.model.trim.roll_rad);
        let tick = state.stamp.tick;
        let samples = self.memory.samples_until(tick);
        let command = Actuation::from(state.command_in_force);

        let input = self.model.inputs_of(&command);
        let since = self.memory.tick.get().map(|_| samples);
        let switch = next.delay.observe(state, input.into(), since, self.sample_ns);
        next.actuation = self.actuate(&command, samples, &switch);
        self.model.observe(&state.measured, &next.actuation, &mut self.work.x);
        self.law.observe(&state.measured);
        // A vehicle that stands on the ground follows no demand, so estimate and integrals would wind up.
        if self.idle_speed.is_some_and(|idle| command.rotor_speed.iter().all(|speed| *speed <= idle)) {
            next.forget();
        } else if self.law.has_own_estimate() {
            self.law.estimate(&EstimateInput { tick, state, modelled: next.actuation, x: &self.work.x }, &mut next);
        } else if samples == 1 && since.is_some() && next.goal.is_followed(tick, self.sample_ns) {
            // The prediction is for one sample, so a gap in the measurements leaves the estimate unchanged. Without a
            // reference the vehicle descends, and the estimate would take the ground for a force.
            self.estimate(&input, &mut next);
        }
        self.predict(tick, &input, &next);
        let mut aim = Aim {
            tick,
            start: &self.work.start,
            reference: self.model.deviation(goal.w_mps, &goal.attitude_rad, &goal.rates_radps),
            attitude_rad: [self.work.x[1], self.work.x[2]],
            goal: &goal,
            age_ns: goal.tick.get().map_or(0, |of| tick.saturating_sub(of)) as f64 * self.sample_ns as f64,
            unfollowed: input - Vector4::from(next.delay.answered(tick)),
        };
        aim.reference[HEADING] = angle::nearest(aim.reference[HEADING], aim.start[HEADING]);
        // With a measured delay, guidance makes the goal for the moment at which the demand acts, else for the sample.
        // With a delay of one sample, the demand then acts one sample later.
        aim.age_ns +=
            if self.delay_compensation == DelayCompensation::Sample(true) { self.sample_ns as f64 } else { 0.0 };
        let Some(decision) = self.law.plan(&aim, &mut next) else {
            return self.repeat(SolveStatus::BadInput); // the inputs are finite, but the plan or a solver would overflow
        };

        next.tick = OptionalTick::some(tick);
        next.x.rows_mut(0, self.work.x.len()).copy_from(&self.work.x);
        next.delay.outputs[0] = decision.demand.into();
        next.fallbacks += u64::from(decision.status > SolveStatus::Solved);
        self.memory = next;
        let led = next.goal.tick.get().is_some_and(|of| of >= tick);
        let status =
            if decision.status <= SolveStatus::Solved && !led { SolveStatus::NoReference } else { decision.status };
        self.publish(status, &decision.account)
    }

    /// Updates the disturbance in `next`, and its gain, by the prediction error of this sample under the inputs `u` of
    /// the command in force.
    fn estimate(&mut self, u: &Vector4<f64>, next: &mut AttitudeMemory) {
        let Some(disturbance_law) = &self.disturbance_law else { return };
        let before = self.memory.disturbance;
        let expected = before + self.law.coupling();
        let Work { x, predicted, .. } = &mut self.work;
        self.law.predict(&self.model, &self.memory.state(), u, &expected, predicted);
        next.disturbance = disturbance_law.update(&before, &mut next.gain, x, predicted);
    }

    /// Simulates the positions of the actuators at this sample, `samples` after the newest sample used. With a measured
    /// delay, the last `switch` of the command acts at its own instant.
    fn actuate(&self, command: &Actuation, samples: u64, switch: &Switch) -> Actuation {
        let before = &self.memory.actuation;
        if !self.delay_compensation.is_measured() || samples == 0 {
            return self.model.actuate(before, command, samples);
        }
        let seconds = |ns: u64| ns as f64 * 1e-9;
        let until_ns = (samples - 1).saturating_mul(self.sample_ns).saturating_add(switch.after_ns);
        let switched = self.model.actuate_for(before, &switch.before, seconds(until_ns));
        self.model.actuate_for(&switched, command, seconds(self.sample_ns.saturating_sub(switch.after_ns)))
    }

    /// Predicts the state at which the demand of `tick` takes effect. The delay compensation selects the moment: this
    /// sample, the next one, or the end of the delay measured in `next`. `input` is the input of the command in force.
    fn predict(&mut self, tick: u64, input: &Vector4<f64>, next: &AttitudeMemory) {
        let Work { x, predicted, start } = &mut self.work;
        let d = &next.disturbance;
        match self.delay_compensation {
            DelayCompensation::Sample(false) => start.copy_from(x),
            DelayCompensation::Sample(true) => {
                self.law.predict(&self.model, &x.as_view(), &self.memory.demand(), d, start);
            }
            DelayCompensation::Named(DelayName::Measured) => {
                start.copy_from(x);
                let mut course = next.delay.course((*input).into(), tick, self.sample_ns);
                if let Some((input, rest_ns)) = course.next() {
                    self.model.advance(start, &input.into(), d, rest_ns * 1e-9);
                }
                for (input, _) in course {
                    self.law.predict(&self.model, &start.as_view(), &input.into(), d, predicted);
                    std::mem::swap(start, predicted);
                }
            }
        }
    }

    /// Builds the message of the demand in memory with `status` and `account`.
    fn publish(&self, status: SolveStatus, account: &PlanEffort) -> Controls {
        Controls {
            demand: self.memory.demand().into(),
            disturbance: self.memory.disturbance.into(),
            status: status as u64,
            iterations: account.iterations,
            solve_ns: account.solve_ns,
            active_constraints: account.touching,
            fallbacks: self.memory.fallbacks,
            ..Controls::default()
        }
    }

    /// Answers an unusable input with the last demand.
    fn repeat(&self, status: SolveStatus) -> Controls {
        self.publish(status, &PlanEffort::default())
    }
}

/// Returns whether every number that the controller needs is finite.
fn is_finite(state: &State, reference: &Reference) -> bool {
    let measured = &state.measured;
    let command = &state.command_in_force;
    [measured.velocity_mps[2], reference.w_mps, command.tilt_rad]
        .iter()
        .chain(&measured.attitude_rad)
        .chain(&measured.rates_radps)
        .chain(&reference.attitude_rad)
        .chain(&reference.rates_radps)
        .chain(&command.rotor_speed)
        .all(|number| number.is_finite())
}
