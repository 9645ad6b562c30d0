//! Sensors of position, velocity, attitude and rates, each with errors, a rate and a latency of its own, and the filter
//! behind them.
//!
//! ```text
//! truth -- every 1 / rate_hz --> + bias + noise -> quantum -- latency_ms --> raw -> filter -> measured
//! ```
//!
//! The noise is white: of a standard deviation (`plant.noise`), or of a density, one-sided as in data sheets, whose
//! deviation grows with the root of the bandwidth, `density sqrt(rate / 2)`. The bias starts at a random value and
//! walks from there. Between two measurements a sensor repeats the last one that arrived; the first has no latency.
//! Angles with errors are not wrapped, so that a measured heading may be beyond half a turn.

use std::collections::VecDeque;

use contract::Scenario;
use contract::message::Kinematics;
use contract::scenario::{Filter, Sensor as Settings};
use rand_chacha::ChaCha8Rng;

use crate::filter::ComplementaryFilter;
use crate::memory::Tape;
use crate::random::{Stream, normal};

/// Most measurements under way in a sensor: the longest latency at the highest rate.
const UNDER_WAY: usize = 1024;

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

/// Sensor, in the units of [`Kinematics`].
#[derive(Debug, Clone)]
struct Sensor {
    /// Deviation of a measurement, per axis.
    deviation: [f64; 3],
    /// Deviation of the bias at the start, and of its walk in a sample, per axis.
    bias_deviation: [f64; 3],
    bias_step: [f64; 3],
    quantum: [f64; 3],
    /// Time between two measurements, and from a measurement to its arrival \[ns\].
    period_ns: u64,
    latency_ns: u64,
    bias: Option<[f64; 3]>,
    /// Time of the next measurement \[ns\].
    due_ns: u64,
    /// Measurements under way with the times of their arrival, oldest first.
    under_way: VecDeque<(u64, [f64; 3])>,
    /// Last measurement that arrived.
    newest: Option<[f64; 3]>,
}

impl Sensor {
    /// Builds a sensor that is read every `sample_ns`, with `noise` as the deviation of each measurement and the errors
    /// of `settings`; `unit` converts the units of the settings to those of [`Kinematics`].
    fn new(settings: &Settings, noise: f64, unit: f64, sample_ns: u64) -> Self {
        let own_ns = if settings.rate_hz > 0.0 { (1e9 / settings.rate_hz).round() as u64 } else { sample_ns };
        let period_ns = own_ns.max(sample_ns);
        let bandwidth = (1e9 / period_ns as f64 / 2.0).sqrt();
        let sample_s = sample_ns as f64 / 1e9;
        Self {
            deviation: settings.noise_density.map(|density| libm::hypot(density * bandwidth, noise) * unit),
            bias_deviation: settings.bias.map(|bias| bias * unit),
            bias_step: settings.bias_walk.map(|walk| walk * sample_s.sqrt() * unit),
            quantum: settings.quantum.map(|quantum| quantum * unit),
            period_ns,
            latency_ns: (settings.latency_ms * 1e6) as u64,
            bias: None,
            due_ns: 0,
            under_way: VecDeque::with_capacity(UNDER_WAY),
            newest: None,
        }
    }

    fn remember(&mut self, tape: &mut Tape) {
        tape.option(&mut self.bias, |tape, bias| tape.numbers(bias));
        tape.word(&mut self.due_ns);
        tape.queue(&mut self.under_way, UNDER_WAY, |tape, (arrives_ns, value)| {
            tape.word(arrives_ns);
            tape.numbers(value);
        });
        tape.option(&mut self.newest, |tape, newest| tape.numbers(newest));
    }

    /// Returns whether the sensor has errors.
    fn errs(&self) -> bool {
        let errors = [self.deviation, self.bias_deviation, self.bias_step, self.quantum];
        errors.as_flattened().iter().any(|error| *error > 0.0)
    }

    /// Reads the sensor at `now_ns`. With `errs` six numbers are drawn, needed or not, so that one sensor's draws do
    /// not depend on another's settings.
    fn read(&mut self, now_ns: u64, truth: [f64; 3], errs: bool, random: &mut ChaCha8Rng) -> [f64; 3] {
        let mut draw = || -> [f64; 3] { std::array::from_fn(|_| if errs { normal(random) } else { 0.0 }) };
        let (noise, walk) = (draw(), draw());
        let steps = if self.bias.is_some() { self.bias_step } else { self.bias_deviation };
        let before = self.bias.unwrap_or([0.0; 3]);
        let bias = std::array::from_fn(|i| before[i] + steps[i] * walk[i]);
        self.bias = Some(bias);
        if now_ns >= self.due_ns {
            self.due_ns = (now_ns / self.period_ns + 1) * self.period_ns;
            let measured = std::array::from_fn(|i| {
                let value = truth[i] + bias[i] + self.deviation[i] * noise[i];
                if self.quantum[i] > 0.0 { (value / self.quantum[i]).round() * self.quantum[i] } else { value }
            });
            if self.under_way.len() < UNDER_WAY {
                self.under_way.push_back((now_ns + self.latency_ns, measured));
            }
            self.newest.get_or_insert(measured);
        }
        while let Some((arrives_ns, value)) = self.under_way.front().copied()
            && arrives_ns <= now_ns
        {
            self.newest = Some(value);
            self.under_way.pop_front();
        }
        self.newest.unwrap_or(truth)
    }
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
