//! Linear MPC of attitude and vertical velocity.
//!
//! Each tick the optimal plan over the horizon is computed, and its first move is published:
//!
//! ```text
//! U*(t) = (u*_t, ..., u*_{t+Nu-1})                                  (5)
//! u(t)  = u*_t                                                      (6)
//! ```
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`model`] | prediction model, lag states, the controller's own actuators | (1)-(2) |
//! | [`coupling`] | change of w at speed, for the disturbance estimate | |
//! | [`at_speed`] | the model at another flight condition | |
//! | [`schedule`] | gain-scheduled MPC over the velocity | |
//! | [`constraints`] | set of admissible plans | (3), (49)-(51) |
//! | [`condensed`] | cost over the horizon as a quadratic in the moves, its minimiser as a gain | (4) |
//! | [`clearance`] | bound that shows a plan clear of its limits | |
//! | [`constrained`] | choice between explicit plan, solver and fallback | |
//! | [`solver`] | the constrained problem, by Clarabel or the active-set method of `qp` | |
//! | [`disturbance`] | estimate of a constant disturbance on the inputs | |
//! | [`pid`] | PID law, for comparison | |
//! | [`geometric`] | geometric law: tilt first, nonlinear inversion | |
//! | [`indi`] | incremental nonlinear dynamic inversion | |
//! | [`level`] | attitude errors and rigid body of these two | |
//! | [`goal`] | the goal, also without references | |
//! | [`preview`] | its changes over the horizon | |
//! | [`memory`] | state kept from tick to tick | |
//! | `node` | its ports, the same in every mode | |
//!
//! In nominal flight no constraint is active: the plan is one matrix-vector product, of which only the first move is
//! computed where a bound shows the others clear of their limits. Only a plan outside the set goes to the solver. If
//! that fails, every move of the unconstrained plan is replaced by the nearest one inside the set.
//!
//! Without a fresh state no plan is computed: the last demand is repeated, with the status `Stale`. The fallback for
//! that case is in the mixer, nearer to the actuators.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod at_speed;
pub mod clearance;
pub mod condensed;
pub mod constrained;
pub mod constraints;
pub mod coupling;
pub mod disturbance;
pub mod geometric;
pub mod goal;
pub mod indi;
pub mod level;
pub mod memory;
pub mod model;
mod node;
pub mod pid;
pub mod preview;
pub mod schedule;
pub mod solver;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod tests;

use airframe::linear::{INPUTS, STATES};
use airframe::{Actuation, angle};
use bytemuck::Zeroable;
use contract::Scenario;
use contract::delay::{Delay, Switch};
use contract::message::{Controls, Kinematics, Reference, SolveStatus, State};
use contract::scenario::{DelayCompensation, DelayName, Fault, Law, Model, ScenarioError};
use contract::snapshot::{self, OptionalTick, Snapshot};
use nalgebra::{DVector, DVectorView, Vector4};

use condensed::{Condensed, Gain};
use constrained::{Account, Constrained};
use coupling::Coupling;
use disturbance::DisturbanceLaw;
use geometric::Geometric;
use goal::Goal;
use indi::{Indi, Stage};
use level::Level;
use memory::{Memory, WarmStart, Whole};
use model::PredictionModel;
use pid::Pid;
use schedule::Schedule;

/// Index of psi in state and reference, the only angle that is wrapped.
const HEADING: usize = 3;
/// Bound on the demands of a plan \[N, N m\]: the solvers compute up to its fourth power, which is still finite.
const MAX_PLAN: f64 = 1e50;

/// Attitude controller.
pub struct AttitudeMpc {
    model: PredictionModel,
    unconstrained: UnconstrainedLaw,
    constrained: Option<Constrained>,
    law: Option<DisturbanceLaw>,
    delay_compensation: DelayCompensation,
    /// Rotor speed up to which the vehicle stands and follows nothing; `None` without a ground.
    idle_speed: Option<f64>,
    sample_ns: u64,
    memory: Memory,
    work: Work,
}

/// Control law without the actuators' limits.
enum UnconstrainedLaw {
    /// Gain of `U = gain (x; r; d; v)`: the unconstrained plan, or the one move of the regulator.
    Gain(Gain),
    /// Plan by a gain, with the coupling term in the prediction behind the estimate.
    Coupled(Gain, Coupling),
    /// One gain for each of several flight conditions.
    Scheduled(Box<Schedule>),
    Pid(Pid),
    Geometric(Geometric),
    Indi(Indi),
}

impl UnconstrainedLaw {
    /// Updates the model of this tick from a sample.
    fn observe(&mut self, measured: &Kinematics) {
        match self {
            Self::Coupled(_, coupling) => coupling.observe(measured),
            Self::Scheduled(schedule) => schedule.observe(measured),
            Self::Gain(_) | Self::Pid(_) | Self::Geometric(_) | Self::Indi(_) => {}
        }
    }

    /// Returns the change of w by coupling as a disturbance on the inputs, which the estimate must not contain.
    fn coupling(&self) -> Vector4<f64> {
        if let Self::Coupled(_, coupling) = self { coupling.on_inputs() } else { Vector4::zeros() }
    }

    /// Predicts as [`PredictionModel::predict`] by the model of this tick, which is `hover` if the law has no other.
    fn predict(
        &self,
        hover: &PredictionModel,
        x: &DVectorView<f64>,
        u: &Vector4<f64>,
        d: &Vector4<f64>,
        next: &mut DVector<f64>,
    ) {
        if let Self::Scheduled(schedule) = self {
            schedule.predict(x, u, d, next);
        } else {
            hover.predict(x, u, d, next);
        }
    }
}

/// Buffers of one tick, so that a tick allocates nothing.
struct Work {
    /// State of this sample, n.
    x: DVector<f64>,
    /// State predicted for this sample, n; then room for another prediction.
    predicted: DVector<f64>,
    /// State predicted for the moment at which the demand acts, n.
    start: DVector<f64>,
    /// Given numbers `(x; r; d; v)`, n + 15.
    given: DVector<f64>,
    /// Changes of the reference over the horizon, 7Np, or none.
    changes: DVector<f64>,
    /// Unconstrained plan, 4Nu, or the one move of another law.
    unconstrained: DVector<f64>,
    /// Number of its elements that are computed: all, or the first move.
    computed: usize,
    /// Plan to follow, 4Nu, or the one move; of it as much as of the unconstrained one.
    plan: DVector<f64>,
}

impl AttitudeMpc {
    /// Builds as [`try_new`](Self::try_new) for a scenario that was checked; panics on an error.
    pub fn new(scenario: &Scenario) -> Self {
        Self::try_new(scenario).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Builds the controller of a scenario; the error names settings for which its problem is singular or infeasible.
    pub fn try_new(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let model = PredictionModel::new(scenario);
        let (states, settings, sample_s) = (model.states(), &scenario.attitude, scenario.sample_s());
        let level = || Level::new(&scenario.airframe, &model.trim, &model.mixing);
        let of_gain = |gain| match settings.mpc.model {
            Model::Coupled => UnconstrainedLaw::Coupled(gain, Coupling::new(scenario.airframe.mass_kg)),
            _ => UnconstrainedLaw::Gain(gain),
        };
        let (unconstrained, constrained) = match settings.law {
            Law::Mpc => {
                let problem = Condensed::new(&model, scenario)?;
                let constrained = Constrained::new(scenario, &problem, model.trim.roll_rad);
                let law = match settings.mpc.model {
                    Model::Hover | Model::Coupled => of_gain(problem.gain),
                    Model::Scheduled => UnconstrainedLaw::Scheduled(Box::new(Schedule::new(scenario)?)),
                };
                (law, constrained)
            }
            Law::Lqr => (of_gain(condensed::regulator(&model, settings)?), None),
            Law::Pid => (UnconstrainedLaw::Pid(Pid::new(&scenario.airframe, &settings.pid, sample_s)), None),
            Law::Geometric => {
                (UnconstrainedLaw::Geometric(Geometric::new(level(), &settings.geometric, sample_s)), None)
            }
            Law::Indi => (UnconstrainedLaw::Indi(Indi::new(level(), &settings.indi, sample_s)), None),
        };
        let (moves, changes) =
            if settings.law == Law::Mpc { (scenario.nu(), condensed::change_count(scenario)) } else { (1, 0) };
        Ok(Self {
            memory: Memory::new(states, model.trim.actuation),
            work: Work {
                x: DVector::zeros(states),
                predicted: DVector::zeros(states),
                start: DVector::zeros(states),
                given: DVector::zeros(states + condensed::GIVEN),
                changes: DVector::zeros(changes),
                unconstrained: DVector::zeros(INPUTS * moves),
                computed: INPUTS * moves,
                plan: DVector::zeros(INPUTS * moves),
            },
            law: DisturbanceLaw::new(&scenario.airframe, settings.disturbance_gain, sample_s),
            delay_compensation: settings.delay_compensation,
            idle_speed: scenario.plant.ground.present.then(|| scenario.idle_speed()),
            sample_ns: scenario.sample_ns(),
            model,
            unconstrained,
            constrained,
        })
    }

    /// Returns the unconstrained plan of the newest step, 4Nu, or the one move of another law.
    pub fn unconstrained_plan(&mut self) -> &DVector<f64> {
        if let UnconstrainedLaw::Gain(gain) | UnconstrainedLaw::Coupled(gain, _) = &self.unconstrained {
            gain.write_plan(&self.work.given, &self.work.changes, self.work.unconstrained.as_view_mut());
        }
        &self.work.unconstrained
    }

    /// Updates fault `number` if it is a fault of the solver.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.constrained.iter_mut().for_each(|constrained| constrained.apply_fault(number, fault));
    }

    /// Computes the demand at `tick` from the newest state and reference: deviations of col, lon, lat, ped from trim
    /// \[N, N m, N m, N m\]. Of the state only the tick, the measurements, the sensed actuators, and the command in
    /// force with its number and age are used.
    ///
    /// If the state is missing or older than `tick`, or an input is not finite or huge, the last demand is repeated.
    /// [`goal`] describes what replaces an old reference. The status reports each case.
    pub fn step(&mut self, tick: u64, state: &State, reference: &Reference) -> Controls {
        if state.stamp.sequence == 0 || state.stamp.tick < tick {
            return self.repeat(SolveStatus::Stale);
        }
        if !is_finite(state, reference) {
            return self.repeat(SolveStatus::BadInput);
        }
        let newest = self.memory.goal.renewed(reference);
        let goal = newest.at(tick, self.sample_ns, state, self.model.trim.roll_rad);
        let tick = state.stamp.tick;
        let samples = self.memory.samples_until(tick);
        let command = Actuation::from(state.command_in_force);

        let mut delay = self.memory.delay;
        let input = self.model.inputs_of(&command);
        let switch = delay.observe(state, input.into(), self.memory.tick.get().map(|_| samples), self.sample_ns);
        let actuation = self.actuate(&command, samples, &switch);
        self.model.observe(&state.measured, &actuation, &mut self.work.x);
        self.unconstrained.observe(&state.measured);
        let mut stage = self.memory.stage;
        // A vehicle that stands on the ground follows nothing: estimate and integrals would adapt to that.
        let stands = self.idle_speed.is_some_and(|idle| command.rotor_speed.iter().all(|speed| *speed <= idle));
        let (mut integral, mut gain) = (self.memory.integral, self.memory.gain);
        let disturbance = if stands {
            (stage, integral, gain) = (Stage::zeroed(), Vector4::zeros(), disturbance::FIRST_GAIN);
            Vector4::zeros()
        } else if let UnconstrainedLaw::Indi(indi) = &self.unconstrained {
            let actuators = indi.actuators(state.sensed.into(), actuation);
            let states = [self.memory.state(), self.work.x.as_view()];
            indi.observe(tick, (&state.measured, &actuators), states, &self.memory.disturbance, &mut stage)
        } else {
            // Without a reference the vehicle descends, and what stops it may be the ground.
            let may_adapt = newest.is_followed(tick, self.sample_ns);
            if may_adapt { self.estimate(&command, samples, &mut gain) } else { self.memory.disturbance }
        };
        self.predict(tick, &input, &delay, &disturbance);
        let age_ns = goal.tick.get().map_or(0, |of| tick.saturating_sub(of)) as f64 * self.sample_ns as f64;
        preview::write_changes(&goal, age_ns + self.lag_of_goal_ns(), self.sample_ns, &mut self.work.changes);
        let unfollowed = input - Vector4::from(delay.answered(tick));
        self.optimise(tick, &goal, &disturbance, &unfollowed, &mut integral);
        let Work { unconstrained, computed, .. } = &self.work;
        if !unconstrained.rows(0, *computed).iter().all(|u| u.abs() < MAX_PLAN) {
            return self.repeat(SolveStatus::BadInput); // finite inputs, but the plan or a solver would overflow
        }

        self.memory.tick = OptionalTick::some(tick);
        self.memory.goal = newest;
        self.memory.x.rows_mut(0, self.work.x.len()).copy_from(&self.work.x);
        self.memory.actuation = actuation;
        self.memory.delay = delay;
        self.memory.disturbance = disturbance;
        self.memory.gain = gain;
        self.memory.integral = integral;
        self.memory.stage = stage;
        let (status, account) = self.decide(tick);
        let led = newest.tick.get().is_some_and(|of| of >= tick);
        let status = if status <= SolveStatus::Solved && !led { SolveStatus::NoReference } else { status };
        self.publish(status, &account)
    }

    /// Packs the whole memory, for the process that continues this flight, except [`hurry`](Self::hurry), which belongs
    /// to the process.
    pub fn snapshot(&self) -> Snapshot {
        let warm_start = self.constrained.as_ref().map_or(WarmStart::default(), |it| it.solver.warm_start());
        snapshot::pack(&Whole { memory: self.memory, warm_start })
    }

    /// Continues from a snapshot. Returns `false`, and changes nothing, if the snapshot is foreign, torn or not finite,
    /// or does not fit this model and solver.
    pub fn restore(&mut self, snapshot: &Snapshot) -> bool {
        let states = self.model.states() as u64;
        let Some(whole) = snapshot::unpack::<Whole>(snapshot).filter(|whole| whole.memory.states == states) else {
            return false;
        };
        let fits = self.constrained.as_mut().is_none_or(|it| it.solver.start_from(&whole.warm_start));
        if fits {
            self.memory = whole.memory;
            if self.law.is_none() && !matches!(self.unconstrained, UnconstrainedLaw::Indi(_)) {
                self.memory.disturbance = Vector4::zeros(); // of another law: nothing here would renew it
            }
        }
        fits
    }

    /// Sets whether the next steps avoid the solver, because a deadline was missed.
    pub fn hurry(&mut self, hurried: bool) {
        if let Some(constrained) = &mut self.constrained {
            constrained.hurried = hurried;
        }
    }

    /// Updates the disturbance estimate by the prediction error of this sample, and its `gain`.
    fn estimate(&mut self, command: &Actuation, samples: u64, gain: &mut f64) -> Vector4<f64> {
        let before = self.memory.disturbance;
        match &self.law {
            // The prediction is for one sample, so a gap in the measurements leaves the estimate unchanged.
            Some(law) if samples == 1 && self.memory.tick.get().is_some() => {
                let u = self.model.inputs_of(command);
                let x = self.memory.state();
                let expected = before + self.unconstrained.coupling();
                self.unconstrained.predict(&self.model, &x, &u, &expected, &mut self.work.predicted);
                law.update(&before, gain, &self.work.x, &self.work.predicted)
            }
            _ => before,
        }
    }

    /// Positions of the actuators at this sample, `samples` after the newest one used; with a measured delay the last
    /// `switch` of the command counts where it was.
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

    /// Predicts the state at which the demand of `tick` takes effect: as the delay compensation says at this sample, at
    /// the next, or after the measured `delay`. `input` is that of the command in force.
    fn predict(&mut self, tick: u64, input: &Vector4<f64>, delay: &Delay, disturbance: &Vector4<f64>) {
        let Work { x, predicted, start, .. } = &mut self.work;
        match self.delay_compensation {
            DelayCompensation::Sample(false) => start.copy_from(x),
            DelayCompensation::Sample(true) => {
                let last = self.memory.demand();
                self.unconstrained.predict(&self.model, &x.as_view(), &last, disturbance, start);
            }
            DelayCompensation::Named(DelayName::Measured) => {
                start.copy_from(x);
                let mut course = delay.course((*input).into(), tick, self.sample_ns);
                if let Some((input, rest_ns)) = course.next() {
                    self.model.advance(start, &input.into(), disturbance, rest_ns * 1e-9);
                }
                for (input, _) in course {
                    self.unconstrained.predict(&self.model, &start.as_view(), &input.into(), disturbance, predicted);
                    std::mem::swap(start, predicted);
                }
            }
        }
    }

    /// Time from the moment of a goal of this sample to the one at which the demand acts \[ns\]: guidance makes the
    /// goal for that moment if the delay is measured, and else for the sample.
    fn lag_of_goal_ns(&self) -> f64 {
        if self.delay_compensation == DelayCompensation::Sample(true) { self.sample_ns as f64 } else { 0.0 }
    }

    /// Computes the unconstrained plan from the state at which the demand of `tick` takes effect, or its first move if
    /// no limit is near the others. `unfollowed` is the input of the command in force less the demand that it answers.
    fn optimise(
        &mut self,
        tick: u64,
        goal: &Goal,
        disturbance: &Vector4<f64>,
        unfollowed: &Vector4<f64>,
        integral: &mut Vector4<f64>,
    ) {
        let Work { x, start, given, changes, unconstrained, computed, .. } = &mut self.work;
        let n = self.model.states();
        let attitude_rad = [x[1], x[2]]; // where guidance made the reference
        let mut r = self.model.deviation(goal.w_mps, &goal.attitude_rad, &goal.rates_radps);
        r[HEADING] = angle::nearest(r[HEADING], start[HEADING]);
        given.rows_mut(0, n).copy_from(start);
        given.rows_mut(n, STATES).copy_from_slice(&r);
        given.rows_mut(n + STATES, INPUTS).copy_from(disturbance);
        given.rows_mut(n + STATES + INPUTS, INPUTS).copy_from(&self.memory.demand());
        match &mut self.unconstrained {
            UnconstrainedLaw::Gain(gain) | UnconstrainedLaw::Coupled(gain, _) => {
                let is_clear = self.constrained.as_ref().is_none_or(|it| it.is_clear(given, changes, tick));
                *computed = if is_clear { INPUTS } else { unconstrained.len() };
                gain.write_plan(given, changes, unconstrained.rows_mut(0, *computed));
            }
            UnconstrainedLaw::Scheduled(schedule) => schedule.plan(given, changes, &attitude_rad, unconstrained),
            UnconstrainedLaw::Pid(pid) => unconstrained.copy_from(&pid.step(start, &r, unfollowed, integral)),
            UnconstrainedLaw::Geometric(geometric) => {
                unconstrained.copy_from(&geometric.step(&start.as_view(), &r, unfollowed, integral));
            }
            UnconstrainedLaw::Indi(indi) => {
                unconstrained.copy_from(&indi.step(&start.as_view(), &r, disturbance));
            }
        }
    }

    /// Chooses the plan and stores its first move as the demand.
    fn decide(&mut self, tick: u64) -> (SolveStatus, Account) {
        let Work { unconstrained, computed, given, plan, .. } = &mut self.work;
        let (status, account) = match &mut self.constrained {
            Some(constrained) if *computed == unconstrained.len() => {
                constrained.choose(unconstrained, given, tick, plan)
            }
            _ => {
                plan.rows_mut(0, *computed).copy_from(&unconstrained.rows(0, *computed));
                (SolveStatus::Explicit, Account::default())
            }
        };
        self.memory.fallbacks += u64::from(status > SolveStatus::Solved);
        self.memory.delay.outputs[0] = plan.fixed_rows::<INPUTS>(0).into_owned().into(); // (6)
        (status, account)
    }

    /// Builds the message of the demand in memory with `status` and `account`.
    fn publish(&self, status: SolveStatus, account: &Account) -> Controls {
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
        self.publish(status, &Account::default())
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
