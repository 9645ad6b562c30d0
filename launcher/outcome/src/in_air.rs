//! Errors, effort and commands of a flight in the air.

use contract::message::{SolveStatus, Truth, mixer_flags};
use flight::log::Record;
use settings::Scenario;

use crate::bounds::Outside;
use crate::following::Following;
use crate::metrics::Metrics;
use crate::ticks::length_m;

/// Gathers the data of the metrics, message by message.
#[derive(Debug, Clone)]
pub struct InAir {
    metrics: Metrics,
    square_sum_m2: f64,
    samples: u64,
    following: Following,
    /// Ticks on which the mixer flew without a demand.
    fallback_ticks: u64,
    /// Sum of u'Ru over the demands, and their number.
    effort: (f64, u64),
    /// Number of demands without a reference of their tick.
    pub without_reference: u64,
    pub outside: Outside,
    sample_s: f64,
    /// Weights of the demand in the cost (4).
    r: [f64; 4],
}

impl InAir {
    /// Begins without a sample.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            metrics: Metrics::default(),
            square_sum_m2: 0.0,
            samples: 0,
            following: Following::default(),
            fallback_ticks: 0,
            effort: (0.0, 0),
            without_reference: 0,
            outside: Outside::new(scenario),
            sample_s: scenario.sample_s(),
            r: scenario.attitude.mpc.r,
        }
    }

    /// Takes in the true motion at `t` \[s\], with its position error, NED \[m\].
    pub fn truth(&mut self, t: f64, truth: &Truth, error: [f64; 3]) {
        self.following.observe(&Record::Truth(*truth));
        let distance = length_m(error);
        let m = &mut self.metrics;
        m.max_position_error_m = m.max_position_error_m.max(distance);
        m.final_position_error_m = distance;
        m.position_error_integral_ms += distance * self.sample_s;
        m.max_altitude_error_m = m.max_altitude_error_m.max(error[2].abs());
        self.square_sum_m2 += distance * distance;
        self.samples += 1;
        self.metrics.fallback_s = self.fallback_ticks as f64 * self.sample_s;
        self.outside.observe(t, &self.metrics);
    }

    /// Takes in an answer to a state.
    pub fn answer(&mut self, record: &Record) {
        self.following.observe(record);
        match record {
            Record::Controls(controls) => {
                let effort = controls.demand.iter().zip(self.r).map(|(u, r)| u * u * r).sum::<f64>();
                self.effort = (self.effort.0 + effort, self.effort.1 + 1);
                self.without_reference += u64::from(controls.status == SolveStatus::NoReference as u64);
            }
            Record::Actuators(actuators) => {
                self.metrics.commands_saturated += u64::from(mixer_flags::saturated(actuators.flags));
                self.fallback_ticks += u64::from(mixer_flags::fallback(actuators.flags));
                self.metrics.negative_squares += u64::from(actuators.flags & mixer_flags::NEGATIVE_SQUARE != 0);
            }
            Record::Reference(_) | Record::State(_) | Record::Truth(_) => {}
        }
    }

    /// Metrics so far of errors, effort and commands.
    pub fn metrics(&self) -> Metrics {
        let [phi, theta, psi, p, q, r, w] = self.following.rms();
        Metrics {
            rms_position_error_m: (self.square_sum_m2 / self.samples.max(1) as f64).sqrt(),
            fallback_s: self.fallback_ticks as f64 * self.sample_s,
            rms_attitude_error_deg: [phi, theta, psi].map(f64::to_degrees),
            rms_rates_error_dps: [p, q, r].map(f64::to_degrees),
            rms_w_error_mps: w,
            demand_effort: self.effort.0 / self.effort.1 as f64,
            ..self.metrics
        }
    }
}
