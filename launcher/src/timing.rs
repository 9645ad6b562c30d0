//! Punctuality of a flight, from the stamps alone. Definitions are those of [`contract::cycle`].
//!
//! ```text
//! jitter / hop = start - release     execution = publish - start     response = publish - sample
//! age at the actuator = the command takes effect - the sample it descends from
//! ```

use contract::Scenario;
use contract::message::Stamp;
use contract::topic::{NODES, Topic};
use hdrhistogram::Histogram;
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::log::Record;

/// Percentiles of one figure.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Percentiles {
    /// Number of values.
    pub n: u64,
    /// Median \[us\].
    pub p50_us: f64,
    /// \[us\]
    pub p90_us: f64,
    /// \[us\]
    pub p99_us: f64,
    /// \[us\]
    pub p999_us: f64,
    /// Largest \[us\].
    pub max_us: f64,
}

/// Histograms of every node, gathered message by message.
pub struct Timing {
    nodes: [NodeTiming; Topic::COUNT],
    age: Histogram<u64>,
    last_applied: u64,
    period_ms: f64,
}

struct NodeTiming {
    wake: Histogram<u64>,
    execution: Histogram<u64>,
    response: Histogram<u64>,
    misses: u64,
    slips: u64,
}

impl Timing {
    /// Nothing seen yet.
    pub fn new(scenario: &Scenario) -> Self {
        let node =
            || NodeTiming { wake: histogram(), execution: histogram(), response: histogram(), misses: 0, slips: 0 };
        Self {
            nodes: std::array::from_fn(|_| node()),
            age: histogram(),
            last_applied: 0,
            period_ms: scenario.sample_s() * 1e3,
        }
    }

    /// Takes one message in.
    pub fn observe(&mut self, record: &Record) {
        self.nodes[record.topic() as usize].observe(record.stamp(), record.topic());
        if let Record::State(state) = record
            && state.applied_sequence != self.last_applied
        {
            self.last_applied = state.applied_sequence;
            self.age.saturating_record(state.applied_age_ns);
        }
    }

    /// The age at the actuator so far.
    pub fn age(&self) -> Percentiles {
        percentiles(&self.age)
    }

    /// Deadlines missed so far, all nodes.
    pub fn misses(&self) -> u64 {
        self.nodes.iter().map(|n| n.misses).sum()
    }

    /// The `timing` table of run.json.
    pub fn to_json(&self) -> Value {
        let mut nodes = Map::new();
        for (name, node) in NODES.iter().zip(&self.nodes) {
            // The plant is released by the clock, the others by a message: the same difference, two names.
            let (jitter, hop) = if *name == "plant" { (Some(&node.wake), None) } else { (None, Some(&node.wake)) };
            nodes.insert(
                (*name).into(),
                json!({
                    "jitter": jitter.map(percentiles), "hop": hop.map(percentiles),
                    "execution": percentiles(&node.execution), "response": percentiles(&node.response),
                    "misses": node.misses, "slips": node.slips,
                }),
            );
        }
        json!({ "deadline_ms": self.period_ms, "nodes": nodes, "age_at_actuator": self.age() })
    }
}

impl NodeTiming {
    fn observe(&mut self, stamp: &Stamp, topic: Topic) {
        let publish_ns = stamp.publish_ns[topic as usize];
        self.wake.saturating_record(stamp.start_ns.saturating_sub(stamp.release_ns));
        self.execution.saturating_record(publish_ns.saturating_sub(stamp.start_ns));
        self.response.saturating_record(publish_ns.saturating_sub(stamp.sample_ns));
        self.misses = self.misses.max(stamp.misses);
        self.slips = self.slips.max(stamp.slips);
    }
}

/// One nanosecond to a minute, three significant digits.
pub(crate) fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, 60_000_000_000, 3).expect("the bounds are constants that hdrhistogram accepts")
}

/// What a histogram of nanoseconds amounts to.
pub(crate) fn percentiles(histogram: &Histogram<u64>) -> Percentiles {
    let at = |quantile| histogram.value_at_quantile(quantile) as f64 / 1e3;
    Percentiles {
        n: histogram.len(),
        p50_us: at(0.5),
        p90_us: at(0.9),
        p99_us: at(0.99),
        p999_us: at(0.999),
        max_us: histogram.max() as f64 / 1e3,
    }
}
