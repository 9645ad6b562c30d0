//! Surroundings of the vehicle: the scheduled wind and disturbance, the shear of the wind over the height, the
//! gusts, and the faults of wind and payload.

use contract::message::Truth;
use nalgebra::Vector3;
use settings::{Fault, Scenario};

use crate::dynamics::{self, StateVector, Surroundings};
use crate::faults::environment::EnvironmentFaults;
use crate::memory::Tape;
use crate::schedule::Schedule;
use crate::turbulence::{self, GustConditions, Turbulence};

/// Surroundings over one flight.
#[derive(Debug, Clone)]
pub struct Air {
    schedule: Schedule,
    turbulence: Option<Turbulence>,
    wind_roughness_m: f64,
    height_zero_m: f64,
    faults: EnvironmentFaults,
    sample_ns: u64,
}

impl Air {
    /// Builds the surroundings of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            schedule: Schedule::new(scenario),
            turbulence: Turbulence::new(scenario),
            wind_roughness_m: scenario.plant.wind_roughness_m,
            height_zero_m: scenario.plant.height_zero_m(),
            faults: EnvironmentFaults::new(scenario),
            sample_ns: scenario.sample_ns(),
        }
    }

    /// Surroundings of a vehicle in the state `x` from `from_ns` on, without faults; must be called in the order of
    /// time.
    pub fn without_faults(&mut self, from_ns: u64, x: &StateVector) -> Surroundings {
        let (mut calm, reference_mps) = self.mean(from_ns, x[2]);
        if let Some(turbulence) = &mut self.turbulence {
            let airspeed_mps = (dynamics::velocity_ned_mps(x) - calm.wind_mps).norm();
            let moment = GustConditions { height_m: self.height_zero_m - x[2], wind_mps: reference_mps, airspeed_mps };
            calm.wind_mps += turbulence.at(from_ns / self.sample_ns, &moment);
        }
        calm
    }

    /// Surroundings at the position `down_m` without turbulence and faults, and the wind at the reference height.
    fn mean(&self, now_ns: u64, down_m: f64) -> (Surroundings, Vector3<f64>) {
        let mut scheduled = self.schedule.at(now_ns);
        let reference_mps = scheduled.wind_mps;
        let shear = turbulence::shear(self.height_zero_m - down_m, self.wind_roughness_m);
        scheduled.wind_mps.x *= shear;
        scheduled.wind_mps.y *= shear;
        (scheduled, reference_mps)
    }

    /// Adds the faults to `calm`, `offset_s` after the beginning `from_ns` of an integration step.
    #[inline]
    pub fn with_faults(&self, from_ns: u64, offset_s: f64, calm: &Surroundings) -> Surroundings {
        self.faults.inject(from_ns, offset_s, calm)
    }

    /// Wind at a sample of a finished flight, NED \[m/s\]. The result equals the wind in flight, because it depends on
    /// settings, seed and true motion alone. Must be called in the order of samples.
    pub fn wind_mps(&mut self, truth: &Truth) -> Vector3<f64> {
        let x = dynamics::assemble(&truth.actual, &truth.actuators.into());
        let from_ns = truth.tick.saturating_mul(self.sample_ns);
        let calm = self.without_faults(from_ns, &x);
        self.with_faults(from_ns, 0.0, &calm).wind_mps
    }

    /// Mean wind `now_ns` after the first sample at the position `down_m`, NED \[m/s\]: from settings and faults,
    /// without turbulence.
    pub fn mean_wind_mps(&self, now_ns: u64, down_m: f64) -> [f64; 3] {
        self.with_faults(now_ns, 0.0, &self.mean(now_ns, down_m).0).wind_mps.into()
    }

    /// Updates fault `number` if it is a fault of wind or payload.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault);
    }

    /// Writes or reads the gusts at sample `tick`.
    pub fn remember(&mut self, tape: &mut Tape, tick: u64) {
        self.turbulence.iter_mut().for_each(|turbulence| turbulence.remember(tape, tick));
    }
}

#[cfg(test)]
mod tests {
    use settings::{FaultKind, FaultTarget};

    use super::*;

    #[test]
    fn the_mean_wind_adds_steps_and_faults() {
        let mut scenario = Scenario::default();
        scenario.plant.wind_ned_mps = vec![(1.0, [2.0, 0.0, 0.0])];
        scenario.fault = vec![Fault {
            vector: Some([0.0, 3.0, 0.0]),
            ..Fault::new(FaultTarget::Wind, FaultKind::Step, 2.0, Some(1.0))
        }];
        let mut wind = Air::new(&scenario);
        let at = |wind: &Air, s: u64| wind.mean_wind_mps(s * 1_000_000_000, -5.0);
        assert_eq!([0, 1, 2, 3].map(|s| at(&wind, s)), [[0.0; 3], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [2.0, 0.0, 0.0]]);
        let given = Fault { vector: Some([1.0; 3]), ..Fault::new(FaultTarget::Wind, FaultKind::Step, 5.0, None) };
        wind.apply_fault(1, &given);
        assert_eq!(at(&wind, 6), [3.0, 1.0, 1.0]);
    }
}
