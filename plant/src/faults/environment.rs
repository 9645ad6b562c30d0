//! Faults of wind and payload.
//!
//! ```text
//! step     wind = vector (1 - cos(pi t / ms)) / 2    t since the onset, up to ms; then vector, to the fault's end
//! gust     wind = vector (1 - cos(2 pi t / T)) / 2   t since the onset, T the duration: smooth, vector at the peak
//! mass     m = m + value                             to the fault's end, at the centre of mass
//! ```
//!
//! The wind is added to the wind of the scenario; a step with ms = 0 has `vector` at once. A step with ms > 0 is the
//! discrete gust of flight control practice (MIL-F-8785C, section 3.7), which stays at its peak; a gust is the discrete
//! gust of certification (CS-25.341, 14 CFR 25.341), which passes. Both are evaluated inside the integration steps.
//! Added mass changes neither the moments of inertia nor the velocity of the vehicle. The effects of several faults are
//! added.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use settings::fault_schedule::{Entry, FaultSchedule};
use settings::{Fault, FaultKind, FaultTarget, Scenario};

use crate::dynamics::Surroundings;

/// Default wind of a step, and of a gust at its peak, NED \[m/s\]: a gentle breeze (Beaufort 3) from the south.
const WIND_MPS: [f64; 3] = [5.0, 0.0, 0.0];
/// Default duration of a gust \[s\].
const GUST_S: f64 = 2.0;
/// Default added mass \[kg\]: almost a fifth of the vehicle's.
const PAYLOAD_KG: f64 = 0.2;

/// Faults of the surroundings.
#[derive(Debug, Clone)]
pub struct EnvironmentFaults {
    faults: FaultSchedule<Effect>,
    sample_ns: u64,
}

#[derive(Debug, Clone, Copy)]
enum Effect {
    /// Wind \[m/s\], and the time of its rise \[ns\].
    Step(Vector3<f64>, u64),
    /// Wind at the peak \[m/s\], and the duration \[ns\].
    Gust(Vector3<f64>, u64),
    /// Added mass \[kg\].
    Mass(f64),
}

impl EnvironmentFaults {
    /// Builds the faults of wind and payload of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let sample_ns = scenario.sample_ns();
        Self { faults: FaultSchedule::new(scenario, |_, fault| Effect::of(fault, sample_ns)), sample_ns }
    }

    /// Updates fault `number` if it is a fault of wind or payload.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, Effect::of(fault, self.sample_ns));
    }

    /// Adds the faults to `calm`, `offset_s` after the beginning `from_ns` of an integration step.
    #[inline]
    pub fn inject(&self, from_ns: u64, offset_s: f64, calm: &Surroundings) -> Surroundings {
        let mut outside = *calm;
        if self.faults.all().is_empty() {
            return outside;
        }
        for Entry { ticks, effect, .. } in self.faults.on(from_ns / self.sample_ns) {
            match effect {
                Effect::Step(wind_mps, rise_ns) => {
                    let since_ns = from_ns - ticks.start * self.sample_ns;
                    let risen = since_ns as f64 / 1e9 + offset_s;
                    let rise_s = *rise_ns as f64 / 1e9;
                    let share = if risen < rise_s { (1.0 - libm::cos(PI * risen / rise_s)) / 2.0 } else { 1.0 };
                    outside.wind_mps += wind_mps * share;
                }
                Effect::Gust(peak_mps, duration_ns) => {
                    let since_ns = from_ns - ticks.start * self.sample_ns;
                    if since_ns < *duration_ns {
                        let (since_s, duration_s) = (since_ns as f64 / 1e9 + offset_s, *duration_ns as f64 / 1e9);
                        outside.wind_mps += peak_mps * ((1.0 - libm::cos(TAU * since_s / duration_s)) / 2.0);
                    }
                }
                Effect::Mass(mass_kg) => outside.payload_kg += mass_kg,
            }
        }
        outside
    }
}

impl Effect {
    /// Builds the effect; `None` if it is not a fault of wind or payload.
    fn of(fault: &Fault, sample_ns: u64) -> Option<Self> {
        let wind_mps = fault.vector.unwrap_or(WIND_MPS).into();
        match (fault.target, fault.kind) {
            (FaultTarget::Wind, FaultKind::Step) => Some(Self::Step(wind_mps, (fault.ms.unwrap_or(0.0) * 1e6) as u64)),
            (FaultTarget::Wind, FaultKind::Gust) => {
                let ticks = Fault { for_s: fault.for_s.or(Some(GUST_S)), ..*fault }.ticks(sample_ns as f64 / 1e9);
                Some(Self::Gust(wind_mps, (ticks.end - ticks.start) * sample_ns))
            }
            (FaultTarget::Payload, FaultKind::Mass) => Some(Self::Mass(fault.value.unwrap_or(PAYLOAD_KG))),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
