//! Sensors of position, velocity, attitude and rates, and the filter behind them.
//!
//! ```text
//! truth -> sensor of its own rate and latency, with errors -> raw -> filter -> measured
//! ```
//!
//! Angles with errors are not wrapped, so that a measured heading may be beyond half a turn.

use contract::Scenario;
use contract::message::Kinematics;
use contract::scenario::Filter;
use rand_chacha::ChaCha8Rng;

use crate::filter::ComplementaryFilter;
use crate::memory::Tape;
use crate::random::Stream;
use crate::sensor::Sensor;

/// Sensors, and the filter behind them.
#[derive(Debug, Clone)]
pub struct Sensors {
    position: Sensor,
    velocity: Sensor,
    attitude: Sensor,
    rates: Sensor,
    /// `true` if any sensor has errors.
    errs: bool,
    random: ChaCha8Rng,
    filter: Option<ComplementaryFilter>,
}

impl Sensors {
    /// Builds the sensors of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let (noise, settings) = (&scenario.plant.noise, &scenario.plant.sensors);
        let sample_ns = scenario.sample_ns();
        let degree = 1_f64.to_radians();
        let position = Sensor::new(&settings.position, noise.position_m, 1.0, sample_ns);
        let velocity = Sensor::new(&settings.velocity, noise.velocity_mps, 1.0, sample_ns);
        let attitude = Sensor::new(&settings.attitude, noise.attitude_deg, degree, sample_ns);
        let rates = Sensor::new(&settings.rates, noise.rates_dps, degree, sample_ns);
        let errs = [&position, &velocity, &attitude, &rates].into_iter().any(Sensor::errs);
        Self {
            errs,
            position,
            velocity,
            attitude,
            rates,
            random: Stream::Noise.open(scenario.run.seed),
            filter: (settings.filter == Filter::Complementary)
                .then(|| ComplementaryFilter::new(settings.filter_radps, scenario.sample_s())),
        }
    }

    /// Writes or reads the sensors' state and the random stream.
    pub fn remember(&mut self, tape: &mut Tape) {
        for sensor in [&mut self.position, &mut self.velocity, &mut self.attitude, &mut self.rates] {
            sensor.remember(tape);
        }
        tape.random(&mut self.random);
        if let Some(filter) = &mut self.filter {
            filter.remember(tape);
        }
    }

    /// Measures `actual` at `now_ns`; must be called once per sample, in order.
    pub fn measure(&mut self, now_ns: u64, actual: &Kinematics) -> Kinematics {
        let Self { errs, random, .. } = self;
        let mut read = |sensor: &mut Sensor, truth| sensor.read(now_ns, truth, *errs, random);
        let raw = Kinematics {
            position_m: read(&mut self.position, actual.position_m),
            velocity_mps: read(&mut self.velocity, actual.velocity_mps),
            attitude_rad: read(&mut self.attitude, actual.attitude_rad),
            rates_radps: read(&mut self.rates, actual.rates_radps),
        };
        self.filter.as_mut().map_or(raw, |filter| filter.update(&raw))
    }
}

#[cfg(test)]
mod tests;
