//! Faults of the air and of what is carried.
//!
//! ```text
//! step     wind = vector                             while it lasts, in addition to the scenario's wind
//! gust     wind = vector (1 - cos(2 pi t / T)) / 2   t since its beginning, T its duration: smooth, vector at its peak
//! mass     m = m + value                             while it lasts, at the centre of mass
//! ```
//!
//! A gust is evaluated inside the integration steps. The mass neither changes the moments of inertia nor the velocity
//! at which the vehicle flies when it is taken up. Several faults add up.

use std::f64::consts::TAU;
use std::ops::Range;

use contract::Scenario;
use contract::scenario::{Fault, FaultKind, FaultTarget};
use nalgebra::Vector3;

use crate::dynamics::Surroundings;

/// Wind of a step, and a gust at its peak, NED \[m/s\]: a fresh breeze from the south.
const WIND_MPS: [f64; 3] = [5.0, 0.0, 0.0];
/// Duration of a gust \[s\].
const GUST_S: f64 = 2.0;
/// Mass taken up \[kg\]: almost a fifth of the vehicle's.
const PAYLOAD_KG: f64 = 0.2;

/// The faults of the surroundings.
#[derive(Debug, Clone)]
pub struct EnvironmentFaults(Vec<EnvironmentFault>);

#[derive(Debug, Clone)]
struct EnvironmentFault {
    lasts_ns: Range<u64>,
    effect: Effect,
}

#[derive(Debug, Clone, Copy)]
enum Effect {
    /// \[m/s\]
    Step(Vector3<f64>),
    /// \[m/s\]
    Gust(Vector3<f64>),
    /// \[kg\]
    Mass(f64),
}

impl EnvironmentFaults {
    /// Those of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        Self(scenario.fault.iter().filter_map(|fault| EnvironmentFault::new(scenario, fault)).collect())
    }

    /// What becomes of `calm` at `offset_s` after `from_ns`, the beginning of an integration step.
    pub fn strike(&self, from_ns: u64, offset_s: f64, calm: &Surroundings) -> Surroundings {
        let mut outside = *calm;
        for EnvironmentFault { lasts_ns, effect } in self.0.iter().filter(|fault| fault.lasts_ns.contains(&from_ns)) {
            match effect {
                Effect::Step(wind_mps) => outside.wind_mps += wind_mps,
                Effect::Gust(peak_mps) => {
                    let since_s = (from_ns - lasts_ns.start) as f64 / 1e9 + offset_s;
                    let duration_s = (lasts_ns.end - lasts_ns.start) as f64 / 1e9;
                    outside.wind_mps += peak_mps * ((1.0 - (TAU * since_s / duration_s).cos()) / 2.0);
                }
                Effect::Mass(mass_kg) => outside.payload_kg += mass_kg,
            }
        }
        outside
    }
}

impl EnvironmentFault {
    /// `None` for a fault of something else.
    fn new(scenario: &Scenario, fault: &Fault) -> Option<Self> {
        let wind_mps = fault.vector.unwrap_or(WIND_MPS).into();
        let (effect, for_s) = match (fault.target, fault.kind) {
            (FaultTarget::Wind, FaultKind::Step) => (Effect::Step(wind_mps), fault.for_s),
            (FaultTarget::Wind, FaultKind::Gust) => (Effect::Gust(wind_mps), fault.for_s.or(Some(GUST_S))),
            (FaultTarget::Payload, FaultKind::Mass) => (Effect::Mass(fault.value.unwrap_or(PAYLOAD_KG)), fault.for_s),
            _ => return None,
        };
        let ticks = Fault { for_s, ..fault.clone() }.ticks(scenario.sample_s());
        let nanoseconds = |tick: u64| tick.saturating_mul(scenario.sample_ns());
        Some(Self { lasts_ns: nanoseconds(ticks.start)..nanoseconds(ticks.end), effect })
    }
}

#[cfg(test)]
mod tests;
