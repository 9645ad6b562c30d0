//! Which ticks are traced.

use std::ops::Range;

use contract::Topic;
use contract::message::Stamp;

use super::acted::Acted;
use crate::report::Row;

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

    /// The window with the largest response or age in its middle.
    pub fn around_worst(rows: &[Row], acted: &[Acted], for_s: f64, sample_s: f64) -> Self {
        let responses = rows.iter().flat_map(responses);
        let ages = acted.iter().map(|acted| (acted.age_ns, acted.command.stamp.tick, "age at the actuator"));
        let Some((worst_ns, tick, what)) = responses.chain(ages).max_by_key(|(ns, ..)| *ns) else {
            return Self::new(0.0, for_s, sample_s);
        };
        let from_s = (tick as f64 * sample_s - for_s / 2.0).max(0.0);
        let why = format!(", around tick {tick} with the worst {what}, {:.3} ms", worst_ns as f64 / 1e6);
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

/// Response of every node to this tick's sample \[ns\], with the tick and the figure's name.
fn responses<'a>(row: &'a Row) -> impl Iterator<Item = (u64, u64, &'static str)> + 'a {
    let stamps = [
        row.state.map(|m| (&m.stamp, Topic::State, "response of the plant")),
        row.reference.map(|m| (&m.stamp, Topic::Reference, "response of guidance")),
        row.controls.map(|m| (&m.stamp, Topic::Controls, "response of attitude-mpc")),
        row.actuators.map(|m| (&m.stamp, Topic::Actuators, "response of the mixer")),
    ];
    let response = |(stamp, topic, what): (&Stamp, Topic, _)| {
        (stamp.publish_ns[topic as usize].saturating_sub(stamp.sample_ns), stamp.tick, what)
    };
    stamps.into_iter().flatten().map(response)
}
