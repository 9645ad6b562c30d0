//! One sensor with errors and a rate of its own.
//!
//! ```text
//! truth -- every 1 / rate_hz --> + bias + noise -> quantum -> measurement
//! ```
//!
//! The noise is white: of a standard deviation (`plant.noise`), or of a density, one-sided as in data sheets, whose
//! deviation grows with the root of the bandwidth, `density sqrt(rate / 2)`. The bias starts at a random value and
//! walks from there; with a time constant it also decays to 0 (first-order Gauss-Markov).

use rand_chacha::ChaCha8Rng;
use settings::SensorSettings;

use crate::memory::Tape;
use crate::random::normal;

/// Sensor of three numbers, in the units of its reader.
#[derive(Debug, Clone)]
pub struct Sensor {
    /// Deviation of a measurement, per axis.
    deviation: [f64; 3],
    /// Deviation of the bias at the start, and of its walk in a sample, per axis.
    bias_deviation: [f64; 3],
    bias_step: [f64; 3],
    /// Share of the bias that is left after a sample.
    bias_left: f64,
    quantum: [f64; 3],
    /// Time between two measurements \[ns\].
    period_ns: u64,
    bias: Option<[f64; 3]>,
    /// Time of the next measurement \[ns\].
    due_ns: u64,
}

impl Sensor {
    /// Builds a sensor that is read every `sample_ns`, with `noise` as the deviation of each measurement and the errors
    /// of `settings`; `unit` converts the units of the settings to those of the reader.
    pub fn new(settings: &SensorSettings, noise: f64, unit: f64, sample_ns: u64) -> Self {
        let own_ns = if settings.rate_hz > 0.0 { (1e9 / settings.rate_hz).round() as u64 } else { sample_ns };
        let period_ns = own_ns.max(sample_ns);
        let bandwidth = (1e9 / period_ns as f64 / 2.0).sqrt();
        let sample_s = sample_ns as f64 / 1e9;
        Self {
            deviation: settings.noise_density.map(|density| libm::hypot(density * bandwidth, noise) * unit),
            bias_deviation: settings.bias.map(|bias| bias * unit),
            bias_step: settings.bias_walk.map(|walk| walk * sample_s.sqrt() * unit),
            bias_left: if settings.bias_s > 0.0 { libm::exp(-sample_s / settings.bias_s) } else { 1.0 },
            quantum: settings.quantum.map(|quantum| quantum * unit),
            period_ns,
            bias: None,
            due_ns: 0,
        }
    }

    /// Writes or reads the bias and the time of the next measurement.
    pub fn remember(&mut self, tape: &mut Tape) {
        tape.option(&mut self.bias, Tape::value);
        tape.value(&mut self.due_ns);
    }

    /// Restarts the sensor's time at 0, the start of the flight: the next measurement is due at once.
    pub fn rewind(&mut self) {
        self.due_ns = 0;
    }

    /// Returns whether the sensor has errors.
    pub fn errs(&self) -> bool {
        let errors = [self.deviation, self.bias_deviation, self.bias_step, self.quantum];
        errors.as_flattened().iter().any(|error| *error > 0.0)
    }

    /// Standard deviation of a measurement with its rounding, per axis.
    pub fn deviation(&self) -> [f64; 3] {
        // The error of rounding is uniform: its variance is the square of its width divided by twelve.
        std::array::from_fn(|i| libm::hypot(self.deviation[i], self.quantum[i] / 12_f64.sqrt()))
    }

    /// Measures at `now_ns`; `None` if no measurement is due. With `errs` six numbers are drawn, needed or not, so that
    /// one sensor's draws do not depend on another's settings.
    pub fn measure(&mut self, now_ns: u64, truth: [f64; 3], errs: bool, random: &mut ChaCha8Rng) -> Option<[f64; 3]> {
        let mut draw = || -> [f64; 3] { std::array::from_fn(|_| if errs { normal(random) } else { 0.0 }) };
        let (noise, walk) = (draw(), draw());
        let steps = if self.bias.is_some() { self.bias_step } else { self.bias_deviation };
        let before = self.bias.unwrap_or([0.0; 3]);
        let bias: [f64; 3] = std::array::from_fn(|i| before[i] * self.bias_left + steps[i] * walk[i]);
        self.bias = Some(bias);
        if now_ns < self.due_ns {
            return None;
        }
        self.due_ns = (now_ns / self.period_ns + 1) * self.period_ns;
        Some(std::array::from_fn(|i| {
            let value = truth[i] + bias[i] + self.deviation[i] * noise[i];
            if self.quantum[i] > 0.0 { (value / self.quantum[i]).round() * self.quantum[i] } else { value }
        }))
    }
}

#[cfg(test)]
mod tests;
