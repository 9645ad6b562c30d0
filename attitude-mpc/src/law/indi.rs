//! Incremental nonlinear dynamic inversion: the measured acceleration replaces a model of every force and moment that
//! the actuators do not produce.
//!
//! ```text
//! nu = kp e + kd (q w_ref - w)                    wanted acceleration, in the axes of the level frame
//! u  = H(u_a) + J (nu - H(dw/dt))                 u_a: inputs that the actuators produce
//! ```
//!
//! `H` is one low-pass, two first-order filters in series with the bandwidth `attitude.indi.filter_radps`. Filtering
//! the acceleration delays it, and the actuators must be delayed alike (Smeur, Chu and de Croon, *Adaptive incremental
//! nonlinear dynamic inversion for attitude control of micro air vehicles*, Journal of Guidance, Control, and Dynamics
//! 39(3), 2016). `H` is linear, so the law filters the difference once, and both terms always have the same delay:
//!
//! ```text
//! u = J nu - d        d = H(J dw/dt - u_a)
//! ```
//!
//! `dw/dt` is the difference of two gyro samples over the sample time, the mean angular acceleration between them;
//! `u_a` is the mean of the inputs that the actuators produce at these two samples. `d` is published as the
//! disturbance. It contains the gyroscopic moment and every error of the model. The climb has a loop of the same kind,
//! with the derivative of the vertical speed. The actuators' positions enter by the exact map of [`airframe::mixing`],
//! not by its derivative.
//!
//! With `attitude.indi.actuators` = "sensed" the positions come from the telemetry, as in that article. Departure from
//! the article: with "modelled", the default, the controller simulates the positions under the command in force, with
//! the lag `attitude.actuator_lag_model_s`; docs/laws.md shows the cost of a wrong lag. Tests
//! `the_actuators_alone_are_no_disturbance`, `a_constant_moment_leaves_no_offset`,
//! `sensed_actuators_need_no_model_of_their_lag`.

use contract::actuation::Actuation;
use contract::snapshot::OptionalTick;
use nalgebra::Vector4;
use settings::{IndiActuators, IndiGains, PidGains};

use super::attitude_law::{Aim, AttitudeLaw, Decision, EstimateInput};
use super::geometric::Axes;
use super::level::RigidBody;
use crate::memory::{AttitudeMemory, FilterStage};

/// INDI law. The controller stores its filter.
#[derive(Debug, Clone)]
pub struct Indi {
    axes: Axes,
    level: RigidBody,
    actuators: IndiActuators,
    sample_s: f64,
    /// Share of the difference to its input that a low-pass takes in at each sample.
    share: f64,
}

impl Indi {
    /// Builds the law of a vehicle with `gains` and a sample time \[s\].
    pub fn new(level: RigidBody, gains: &IndiGains, sample_s: f64) -> Self {
        let IndiGains { kp, kd, filter_radps, actuators } = *gains;
        let axes = Axes::new(&PidGains { kp, ki: [0.0; 4], kd }, sample_s);
        Self { axes, level, actuators, sample_s, share: -libm::expm1(-filter_radps * sample_s) }
    }

    /// Positions of the actuators to use: the `sensed` ones if the settings select them and all are finite, else the
    /// `modelled` ones.
    pub fn actuators(&self, sensed: Actuation, modelled: Actuation) -> Actuation {
        if self.actuators == IndiActuators::Sensed && sensed.is_finite() { sensed } else { modelled }
    }
}

impl AttitudeLaw for Indi {
    fn has_own_estimate(&self) -> bool {
        true
    }

    /// Updates the filter. A gap between the samples leaves the disturbance `d` unchanged.
    fn estimate(&self, sample: &EstimateInput, memory: &mut AttitudeMemory) {
        let EstimateInput { tick, state, modelled, x: now } = *sample;
        let (now, sink_mps) = (now.as_view(), state.measured.sink_mps());
        let produced = self.level.produced(&now, &self.actuators(state.sensed.into(), modelled));
        let last = memory.stage;
        memory.stage = FilterStage { tick: OptionalTick::some(tick), sink_mps, produced, ..last };
        if last.tick.get().is_none_or(|last| last.checked_add(1) != Some(tick)) {
            return;
        }
        let before = memory.state();
        let faster = |i: usize| (now[i] - before[i]) / self.sample_s;
        let measured = Vector4::new((sink_mps - last.sink_mps) / self.sample_s, faster(5), faster(4), faster(6));
        let produced = (last.produced + produced) * 0.5;
        let beyond = measured - produced.component_div(&self.level.inertia());
        let AttitudeMemory { stage, disturbance: d, .. } = memory;
        stage.first += (self.level.inputs(&now, &beyond) - stage.first) * self.share;
        *d += (stage.first - *d) * self.share;
    }

    fn plan(&mut self, aim: &Aim, memory: &mut AttitudeMemory) -> Option<Decision> {
        let (x, none) = (&aim.start.as_view(), Vector4::zeros());
        let wanted = self.axes.accelerations(&self.level.errors(x, &aim.reference), &none, &mut none.clone());
        Decision::explicit(self.level.demand(x, &wanted, &-memory.disturbance))
    }
}

#[cfg(test)]
mod tests;
