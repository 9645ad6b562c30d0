//! Figures of a flight, and their differences from those of another flight.

use flight::log::Record;
use settings::Scenario;

use crate::again::replay_script;
use crate::counterfactual::Disturbed;
use crate::plan::ReplayPlan;
use crate::recording::Recording;
use crate::script::Script;
use anyhow::bail;
use guidance::Trajectory;
use serde::Serialize;

use outcome::metrics::Metrics;
use outcome::summary::Summary;
use outcome::ticks::{length_m, position_error_m};

/// Time before a tick from which on the flight is drawn \[s\].
const BEFORE_S: f64 = 0.5;
/// Time after a tick up to which the flight is drawn \[s\].
const AFTER_S: f64 = 4.5;

/// Figures of a flight that costs are computed from.
#[derive(Debug, Clone, Default)]
pub struct FlightCost {
    pub metrics: Metrics,
    /// Largest angle between the body's z axis and the vertical \[deg\].
    pub worst_tilt_deg: f64,
    /// Tick of the first sample.
    pub first: u64,
    /// Position error at each sample from `first` on \[m\].
    pub error_m: Vec<f64>,
    /// True position at each sample from `first` on, NED \[m\].
    pub course_m: Vec<[f64; 3]>,
    pub state_hash: Option<String>,
}

/// Cost of one or several ticks: each figure of the flight minus that of the flight without these ticks.
#[derive(Debug, Clone, Serialize)]
pub struct Cost {
    /// First and last tick.
    pub ticks: (u64, u64),
    /// Time of the first tick \[s\].
    pub at_s: f64,
    pub node: &'static str,
    pub what: String,
    /// Cost in the largest position error \[m\]: 0 if the error is largest at another tick.
    pub max_error_m: f64,
    /// Largest distance between the courses of the flight and of the flight without the ticks \[m\].
    pub max_distance_m: f64,
    /// Cost in the integral of the position error \[m s\].
    pub error_integral_ms: f64,
    /// Cost in the worst tilt \[deg\].
    pub worst_tilt_deg: f64,
    /// Position error around the ticks in the flight without them: time \[s\], error \[m\].
    #[serde(skip)]
    pub without_m: Vec<(f64, f64)>,
}

impl FlightCost {
    /// Returns the position error around an instant: time \[s\], error \[m\].
    pub fn error_around(&self, at_s: f64, sample_s: f64) -> Vec<(f64, f64)> {
        let timed = (self.first..).zip(&self.error_m).map(|(tick, error_m)| (tick as f64 * sample_s, *error_m));
        timed.filter(|(time_s, _)| (at_s - BEFORE_S..=at_s + AFTER_S).contains(time_s)).collect()
    }

    /// Returns the largest distance to the course of `other`, over the samples that both have \[m\].
    pub fn max_distance_m(&self, other: &Self) -> f64 {
        let apart =
            |(one, other): (&[f64; 3], &[f64; 3])| length_m(std::array::from_fn(|axis| one[axis] - other[axis]));
        self.course_m.iter().zip(&other.course_m).map(apart).fold(0.0, f64::max)
    }

    /// Computes the figures of the flight that `fly` hands over message by message, from the sample `first` on.
    ///
    /// # Errors
    /// The flight cannot be flown.
    pub fn of(
        scenario: &Scenario,
        first: u64,
        fly: impl FnOnce(&mut dyn FnMut(&Record)) -> anyhow::Result<()>,
    ) -> anyhow::Result<Self> {
        let (mut summary, trajectory) = (Summary::new(scenario), Trajectory::new(scenario));
        let (mut worst_tilt, mut error_m, mut course_m) = (0.0_f64, vec![], vec![]);
        fly(&mut |record| {
            if record.is_intact() && record.tick() < first {
                return;
            }
            summary.observe(record);
            if let Record::Truth(truth) = record
                && record.is_intact()
                && error_m.len() as u64 <= truth.tick - first
            {
                worst_tilt = worst_tilt.max(truth.actual.tilt_rad());
                let wanted_m = trajectory.at(truth.tick as f64 * scenario.sample_s()).position_m;
                error_m.resize((truth.tick - first) as usize + 1, length_m(position_error_m(wanted_m, truth)));
                course_m.resize((truth.tick - first) as usize + 1, truth.actual.position_m);
            }
        })?;
        let (metrics, state_hash) = (summary.metrics(), summary.state_hash());
        Ok(Self { metrics, worst_tilt_deg: worst_tilt.to_degrees(), first, error_m, course_m, state_hash })
    }

    /// Flies `recording` again as `script` says.
    ///
    /// # Errors
    /// The flight cannot be flown to its end.
    pub fn flown(recording: &Recording, script: Script) -> anyhow::Result<Self> {
        Self::of(&recording.scenario, script.begun_at(), |each| {
            let replayed = replay_script(recording, script, &ReplayPlan::default(), each)?;
            if let Some(why) = replayed.stopped {
                bail!("the flight cannot be flown again to its end: {why}");
            }
            Ok(())
        })
    }
}

impl Cost {
    /// Compares a flight with the flight without the disturbed `ticks`.
    pub fn new(ticks: &[Disturbed], sample_s: f64, flight: &FlightCost, without: &FlightCost) -> Self {
        let (first, last) = (&ticks[0], &ticks[ticks.len() - 1]);
        let at_s = first.tick as f64 * sample_s;
        let cost = |figure: fn(&Metrics) -> f64| figure(&flight.metrics) - figure(&without.metrics);
        Self {
            ticks: (first.tick, last.tick),
            at_s,
            node: first.node,
            what: first.what.clone(),
            max_error_m: cost(|metrics| metrics.max_position_error_m),
            max_distance_m: flight.max_distance_m(without),
            error_integral_ms: cost(|metrics| metrics.position_error_integral_ms),
            worst_tilt_deg: flight.worst_tilt_deg - without.worst_tilt_deg,
            without_m: without.error_around(at_s, sample_s),
        }
    }
}
