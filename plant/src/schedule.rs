//! Wind and disturbance as steps in time, each value held until the next.

use nalgebra::Vector3;
use settings::Scenario;

use crate::dynamics::Surroundings;

/// Values, each with the time from which on it holds \[ns\].
type Steps<T> = Vec<(u64, T)>;

/// External influences on the vehicle over time.
#[derive(Debug, Clone)]
pub struct Schedule {
    /// Velocity of the air, NED \[m/s\].
    wind: Steps<Vector3<f64>>,
    /// Force, NED \[N\], and moment, body \[N m\].
    disturbance: Steps<[Vector3<f64>; 2]>,
}

impl Schedule {
    /// Reads the tables of `scenario`, which validation requires to be sorted.
    pub fn new(scenario: &Scenario) -> Self {
        let nanoseconds = |s: f64| (s * 1e9).round() as u64;
        let plant = &scenario.plant;
        Self {
            wind: plant.wind_ned_mps.iter().map(|&(from_s, wind)| (nanoseconds(from_s), wind.into())).collect(),
            disturbance: plant
                .disturbance
                .iter()
                .map(|&(from_s, force, moment)| (nanoseconds(from_s), [force.into(), moment.into()]))
                .collect(),
        }
    }

    /// Values in force at `now_ns`; zero before the first entry.
    pub fn at(&self, now_ns: u64) -> Surroundings {
        let [force_n, moment_nm] = held(&self.disturbance, now_ns);
        Surroundings { wind_mps: held(&self.wind, now_ns), force_n, moment_nm, payload_kg: 0.0 }
    }
}

/// Last value of a table that holds at `now_ns`.
fn held<T: Copy + Default>(table: &[(u64, T)], now_ns: u64) -> T {
    table.iter().rev().find(|(from_ns, _)| *from_ns <= now_ns).map_or(T::default(), |&(_, value)| value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_holds_from_its_time_to_the_next() {
        let mut scenario = Scenario::default();
        scenario.plant.wind_ned_mps = vec![(1.0, [1.0, 0.0, 0.0]), (2.5, [0.0, 2.0, 0.0])];
        scenario.plant.disturbance = vec![(2.0, [0.0, 0.0, 3.0], [0.4, 0.0, 0.0])];
        let schedule = Schedule::new(&scenario);
        let at = |ms: u64| schedule.at(ms * 1_000_000);
        assert_eq!(at(0), Surroundings::default());
        assert_eq!(at(999), Surroundings::default());
        assert_eq!(at(1000).wind_mps, Vector3::new(1.0, 0.0, 0.0));
        assert_eq!((at(1999).force_n, at(1999).moment_nm), (Vector3::zeros(), Vector3::zeros()));
        assert_eq!((at(2000).force_n, at(2000).moment_nm), (Vector3::new(0.0, 0.0, 3.0), Vector3::new(0.4, 0.0, 0.0)));
        assert_eq!(at(2499).wind_mps, Vector3::new(1.0, 0.0, 0.0));
        assert_eq!(at(90_000).wind_mps, Vector3::new(0.0, 2.0, 0.0));
    }
}
