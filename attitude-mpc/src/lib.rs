//! Linear MPC of attitude and vertical velocity.
//!
//! Every tick the best plan over the horizon is found, and only its first move is published:
//!
//! ```text
//! U*(t) = (u*_t, ..., u*_{t+Nu-1})                                  (5)
//! u(t)  = u*_t                                                      (6)
//! ```
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`model`] | prediction model, lag states, the controller's own actuators | (1)-(2) |
//! | [`constraints`] | what a move may be | (3), (49)-(51) |
//! | [`condensed`] | cost over the horizon as a quadratic in the moves, its minimiser as a gain | (4) |
//! | [`riccati`] | terminal weight | |
//! | [`solver`] | the constrained problem, by Clarabel | |
//! | [`disturbance`] | estimate of a constant disturbance on the inputs | |
//! | [`memory`] | all that survives a tick | |
//! | `process` | the process around it | |
//!
//! In nominal flight no constraint is active: the plan is one matrix-vector product, and it is checked, not solved. Only
//! a plan that leaves the set goes to the solver. A solve that fails leaves no gap: the last good plan goes on, one move
//! per tick, and after it the unconstrained one, which the mixer clamps.

pub mod condensed;
pub mod constraints;
pub mod disturbance;
pub mod memory;
pub mod model;
mod process;
pub mod riccati;
pub mod solver;

pub use process::run;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod tests;

use airframe::Actuation;
use airframe::linear::{INPUTS, STATES};
use contract::Scenario;
use contract::message::{Controls, Reference, SolveStatus, State};
use nalgebra::{DMatrix, DVector, Vector4};

use condensed::Condensed;
use constraints::MoveSet;
use disturbance::DisturbanceLaw;
use memory::Memory;
use model::PredictionModel;
use solver::{ConicSolver, Outcome};

/// An unconstrained plan that leaves the set by no more than this is published as it is.
const NEGLIGIBLE: f64 = 1e-9;
/// A plan is feasible when it leaves the set by no more than this.
const FEASIBLE: f64 = 1e-6;

/// The attitude controller.
pub struct AttitudeMpc {
    model: PredictionModel,
    /// `U* = gain (x; r; d)`.
    gain: DMatrix<f64>,
    constrained: Option<Constrained>,
    law: Option<DisturbanceLaw>,
    delay_compensation: bool,
    memory: Memory,
    work: Work,
}

/// The set of the moves, and the solver that keeps them inside.
struct Constrained {
    set: MoveSet,
    solver: ConicSolver,
}

/// Room for the numbers of one tick, so that a tick allocates nothing.
struct Work {
    /// The state of this sample, n.
    x: DVector<f64>,
    /// The state predicted for this sample, then for the next, n.
    predicted: DVector<f64>,
    /// `(x; r; d)`, n + 7 + 4.
    given: DVector<f64>,
    /// The unconstrained plan, 4Nu.
    unconstrained: DVector<f64>,
    /// The solver's plan, 4Nu.
    solved: DVector<f64>,
}

/// What to publish, and how it was found.
struct Decision {
    status: SolveStatus,
    demand: Vector4<f64>,
    touching: u64,
    outcome: Outcome,
}

impl AttitudeMpc {
    /// Builds the controller of a checked scenario.
    ///
    /// # Panics
    /// When weights or vehicle make the problem singular; scenario validation refuses those.
    pub fn new(scenario: &Scenario) -> Self {
        Self::with_iterations(scenario, solver::MAX_ITERATIONS)
    }

    /// The same with another limit on the solver's iterations.
    fn with_iterations(scenario: &Scenario, max_iterations: u32) -> Self {
        let model = PredictionModel::new(scenario);
        let (states, moves) = (model.states(), scenario.mpc.nu);
        let Condensed { hessian, gain } = Condensed::new(&model, &scenario.mpc);
        let constrained = MoveSet::new(scenario)
            .map(|set| Constrained { solver: ConicSolver::new(&hessian, &set, max_iterations), set });
        Self {
            memory: Memory::new(states, model.trim.actuation, moves),
            work: Work {
                x: DVector::zeros(states),
                predicted: DVector::zeros(states),
                given: DVector::zeros(gain.ncols()),
                unconstrained: DVector::zeros(INPUTS * moves),
                solved: DVector::zeros(INPUTS * moves),
            },
            law: DisturbanceLaw::new(&scenario.airframe, scenario.mpc.disturbance_gain),
            delay_compensation: scenario.mpc.delay_compensation,
            model,
            gain,
            constrained,
        }
    }

    /// The demand for a measured state and the reference it shall follow: deviations of col, lon, lat, ped from trim
    /// \[N, N m, N m, N m\]. Of the state it uses the tick, what was measured, and the command in force.
    pub fn step(&mut self, state: &State, reference: &Reference) -> Controls {
        if !is_finite(state, reference) {
            return self.repeat();
        }
        let tick = state.stamp.tick;
        let samples = self.memory.samples_until(tick);
        let command = Actuation::from(state.command_in_force);

        let actuation = self.model.actuate(&self.memory.actuation, &command, samples);
        self.model.observe(&state.measured, &actuation, &mut self.work.x);
        let disturbance = self.estimate(&command, samples);
        self.optimise(reference, &disturbance);
        if !self.work.unconstrained.iter().all(|u| u.is_finite()) {
            return self.repeat(); // finite, but so large that the plan overflowed
        }

        self.memory.tick = Some(tick);
        self.memory.x.copy_from(&self.work.x);
        self.memory.actuation = actuation;
        self.memory.disturbance = disturbance;
        let decision = self.decide(tick);
        self.publish(&decision)
    }

    /// The disturbance estimate, after a look at what the model failed to predict for this sample.
    fn estimate(&mut self, command: &Actuation, samples: u64) -> Vector4<f64> {
        let before = self.memory.disturbance;
        match &self.law {
            // The prediction is for one sample: a gap in the measurements leaves the estimate as it is.
            Some(law) if samples == 1 && self.memory.tick.is_some() => {
                let u = self.model.inputs_of(command);
                self.model.predict(&self.memory.x, &u, &before, &mut self.work.predicted);
                law.update(&before, &self.work.x, &self.work.predicted)
            }
            _ => before,
        }
    }

    /// Finds the unconstrained plan from this sample, or from the next, when the demand of this tick will act.
    fn optimise(&mut self, reference: &Reference, disturbance: &Vector4<f64>) {
        let Work { x, predicted, given, unconstrained, .. } = &mut self.work;
        let n = self.model.states();
        let start = if self.delay_compensation {
            self.model.predict(x, &self.memory.demand, disturbance, predicted);
            predicted
        } else {
            x
        };
        let Reference { w_mps, attitude_rad, rates_radps, .. } = reference;
        given.rows_mut(0, n).copy_from(start);
        given.rows_mut(n, STATES).copy_from_slice(&self.model.deviation(*w_mps, attitude_rad, rates_radps));
        given.rows_mut(n + STATES, INPUTS).copy_from(disturbance);
        unconstrained.gemv(1.0, &self.gain, given, 0.0); // (5)
    }

    /// Chooses between the unconstrained plan, the solver's, the rest of the last one, and the unconstrained after all.
    fn decide(&mut self, tick: u64) -> Decision {
        let Self { memory, work: Work { unconstrained, solved, .. }, .. } = self;
        let Some(Constrained { set, solver }) = &mut self.constrained else {
            memory.keep(unconstrained, tick);
            return Decision::first_of(unconstrained.as_slice(), SolveStatus::Explicit, 0, Outcome::default());
        };

        let (violation, touching) = set.judge(unconstrained.as_slice(), FEASIBLE);
        if violation <= NEGLIGIBLE {
            memory.keep(unconstrained, tick);
            return Decision::first_of(unconstrained.as_slice(), SolveStatus::Explicit, touching, Outcome::default());
        }

        let outcome = solver.solve(unconstrained, solved);
        let (violation, touching) = set.judge(solved.as_slice(), FEASIBLE);
        if outcome.solved && violation <= FEASIBLE {
            memory.keep(solved, tick);
            return Decision::first_of(solved.as_slice(), SolveStatus::Solved, touching, outcome);
        }

        memory.fallbacks += 1;
        let rest = memory.rest_of_plan(tick);
        let (violation, touching) = set.judge(rest, FEASIBLE);
        if !rest.is_empty() && violation <= FEASIBLE {
            return Decision::first_of(rest, SolveStatus::ShiftedPlan, touching, outcome);
        }
        let (_, touching) = set.judge(unconstrained.as_slice(), FEASIBLE);
        Decision::first_of(unconstrained.as_slice(), SolveStatus::UnconstrainedGain, touching, outcome)
    }

    /// Remembers the demand of a decision, and says how it came about.
    fn publish(&mut self, decision: &Decision) -> Controls {
        self.memory.demand = decision.demand;
        Controls {
            demand: decision.demand.into(),
            disturbance: self.memory.disturbance.into(),
            status: decision.status as u64,
            iterations: decision.outcome.iterations,
            solve_ns: decision.outcome.solve_ns,
            active_constraints: decision.touching,
            fallbacks: self.memory.fallbacks,
            ..Controls::default()
        }
    }

    /// The answer to an input that cannot be used: the demand stays what it was.
    fn repeat(&mut self) -> Controls {
        let demand = self.memory.demand;
        self.publish(&Decision { status: SolveStatus::BadInput, demand, touching: 0, outcome: Outcome::default() })
    }
}

impl Decision {
    /// The first move of a plan is the demand.
    fn first_of(moves: &[f64], status: SolveStatus, touching: u64, outcome: Outcome) -> Self {
        Self { demand: Vector4::from_column_slice(&moves[..INPUTS]), status, touching, outcome } // (6)
    }
}

/// Whether every number that the controller uses is one.
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
