//! Measured motion without a navigation unit: the truth with the white noise of `plant.noise`.
//!
//! Angles with noise are not wrapped, so that a measured heading may be beyond half a turn.

use contract::message::Kinematics;
use rand_chacha::ChaCha8Rng;
use settings::{Scenario, SensorSettings};

use crate::memory::Tape;
use crate::random::Stream;
use crate::sensor::Sensor;

/// Sensors of position, velocity, attitude and rates.
#[derive(Debug, Clone)]
pub struct Sensors {
    each: [Sensor; 4],
    /// `true` if any sensor has errors.
    errs: bool,
    random: ChaCha8Rng,
}

impl Sensors {
    /// Builds the sensors of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let (noise, degree) = (&scenario.plant.noise, 1_f64.to_radians());
        let sensor = |noise, unit| Sensor::new(&SensorSettings::default(), noise, unit, scenario.sample_ns());
        let each = [
            sensor(noise.position_m, 1.0),
            sensor(noise.velocity_mps, 1.0),
            sensor(noise.attitude_deg, degree),
            sensor(noise.rates_dps, degree),
        ];
        Self { errs: each.iter().any(Sensor::errs), each, random: Stream::Noise.open(scenario.run.seed) }
    }

    /// Writes or reads the sensors' state and the random stream.
    pub fn remember(&mut self, tape: &mut Tape) {
        self.each.iter_mut().for_each(|sensor| sensor.remember(tape));
        tape.random(&mut self.random);
    }

    /// Measures `actual` at `now_ns`; must be called once per sample, in order.
    pub fn measure(&mut self, now_ns: u64, actual: &Kinematics) -> Kinematics {
        let Self { each: [position, velocity, attitude, rates], errs, random } = self;
        let mut measure = |sensor: &mut Sensor, truth| sensor.measure(now_ns, truth, *errs, random).unwrap_or(truth);
        Kinematics {
            position_m: measure(position, actual.position_m),
            velocity_mps: measure(velocity, actual.velocity_mps),
            attitude_rad: measure(attitude, actual.attitude_rad),
            rates_radps: measure(rates, actual.rates_radps),
        }
    }
}

#[cfg(test)]
mod tests;
