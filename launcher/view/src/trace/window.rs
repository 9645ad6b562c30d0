//! Which ticks are traced.

use std::ops::Range;

use serde_json::Value;

/// A stretch of simulated time.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Its first instant \[s\].
    pub from_s: f64,
    /// How long it lasts \[s\].
    pub for_s: f64,
    /// Sample time of the flight \[s\].
    pub sample_s: f64,
    /// Why this one, for people.
    pub why: String,
}

impl Window {
    /// The window that begins at `from_s`.
    pub fn new(from_s: f64, for_s: f64, sample_s: f64) -> Self {
        Self { from_s, for_s, sample_s, why: String::new() }
    }

    /// The window with the worst tick of the flight in its middle, the one that its summary `run` names first; the
    /// beginning where no tick was late.
    pub fn around_worst(run: &Value, for_s: f64, sample_s: f64) -> Self {
        let worst = &run["timing"]["worst_ticks"][0];
        let (Some(tick), Some(late_us)) = (worst["tick"].as_u64(), worst["late_us"].as_f64()) else {
            return Self::new(0.0, for_s, sample_s);
        };
        let from_s = (tick as f64 * sample_s - for_s / 2.0).max(0.0);
        let what = worst["in_words"].as_str().unwrap_or_default();
        let why = format!(", around the worst tick, {tick}: {:.2} ms late; {what}", late_us / 1e3);
        Self { from_s, for_s, sample_s, why }
    }

    /// Its ticks, of a flight of so many.
    pub fn ticks(&self, flown: usize) -> Range<usize> {
        // The conversion stops at the ends of the integers, and takes NaN for 0.
        let tick = |t_s: f64| ((t_s / self.sample_s - 1e-6).ceil() as usize).min(flown);
        let first = tick(self.from_s);
        first..tick(self.from_s + self.for_s).max(first)
    }

    /// For people.
    pub fn describe(&self) -> String {
        format!("{:.2} to {:.2} s{}", self.from_s, self.from_s + self.for_s, self.why)
    }
}
