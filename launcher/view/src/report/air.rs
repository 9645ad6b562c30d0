//! Wind of a flight: the wind at each sample, and the true acceleration that the disturbance observer of guidance
//! estimates.

use airframe::Trim;
use contract::message::Truth;
use guidance::observer::{DisturbanceObserver, ObserverStep};
use nalgebra::{Rotation3, Vector2, Vector3};
use outcome::ticks::LoggedTick;
use plant::air::Air;
use settings::{ProgramKind, Scenario};

/// Computes the wind of a flight again, tick by tick.
pub struct Wind {
    /// `None` if the plant was another program, whose air is not known.
    air: Option<Air>,
    roll_trim_rad: f64,
    g_mps2: f64,
    sample_s: f64,
    observer: DisturbanceObserver,
    newest: Option<u64>,
}

impl Wind {
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            air: (scenario.node.plant.kind() == ProgramKind::Own).then(|| Air::new(scenario)),
            roll_trim_rad: Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction).roll_rad,
            g_mps2: scenario.airframe.g_mps2,
            sample_s: scenario.sample_s(),
            observer: DisturbanceObserver::default(),
            newest: None,
        }
    }

    /// Returns the wind at the sample of a tick, NED \[m/s\]; `None` without a TRUTH, or if the plant was another
    /// program.
    pub fn wind_mps(&mut self, tick: &LoggedTick) -> Option<[f64; 3]> {
        let truth = tick.of.truth.as_ref()?;
        Some(self.air.as_mut()?.wind_mps(truth).into())
    }

    /// Returns the true acceleration ahead and to the right that the tilt does not explain \[m/s2\]: the estimate of
    /// guidance's observer if the observer had the true motion and did not filter. `None` at the first sample and after
    /// a hole.
    pub fn acceleration_mps2(&mut self, tick: &LoggedTick) -> Option<[f64; 2]> {
        let Truth { actual, .. } = tick.of.truth.as_ref()?;
        let [phi, theta, psi] = actual.attitude_rad;
        let velocity_ned_mps = Rotation3::from_euler_angles(phi, theta, psi) * Vector3::from(actual.velocity_mps);
        let is_next = self.newest.is_some_and(|newest| newest + 1 == tick.number);
        self.newest = Some(tick.number);
        let step = ObserverStep { elapsed_s: if is_next { self.sample_s } else { 0.0 }, gain: 1.0, periods: 1 };
        let tilt_rad = Vector2::new(phi - self.roll_trim_rad, theta);
        let found = self.observer.update(&velocity_ned_mps, &tilt_rad, psi, self.g_mps2, step);
        is_next.then(|| found.into())
    }
}
