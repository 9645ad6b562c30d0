//! `[[swap]]`: replacement of a node's process in flight.
//!
//! ```text
//! at_s          the candidate starts on standby: it has the active process's inputs, its messages are not delivered
//!  + standby_s  the candidate becomes active, if it kept within its bounds; the old process goes on as the standby
//!  + watch_s    the old process ends; if the candidate left its bounds before, the old process became active again
//! ```

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::json;

use contract::topic::{Edge, GRAPH, NODES, Topic};

/// One `[[swap]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Swap {
    /// Start of the candidate \[s\], 0 to 86400.
    pub at_s: f64,
    /// The node whose process is replaced.
    #[schemars(schema_with = "names")]
    #[serde(serialize_with = "name_of", deserialize_with = "swap_node")]
    pub node: Topic,
    /// Program of the candidate, started as `PROGRAM --namespace NAME --epoch N --settings FILE`; absent = the
    /// launcher's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exec: Option<String>,
    /// Settings of the candidate, each as after `--set`, on top of the run's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
    /// Time that the candidate is on standby \[s\], 0 to 86400.
    #[serde(default = "Swap::usual_standby_s")]
    pub standby_s: f64,
    /// Time that the old process stays on standby after the hand-over \[s\], 0 to 86400.
    #[serde(default = "Swap::usual_watch_s")]
    pub watch_s: f64,
    /// Bounds that the candidate must keep.
    #[serde(default)]
    pub bounds: SwapBounds,
    /// `true` if the flight counts as flown even when the candidate did not stay active.
    #[serde(default)]
    pub may_fail: bool,
}

/// Bounds that a candidate must keep, on standby and active, `swap.bounds`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SwapBounds {
    /// Largest difference between the answers of candidate and old process to the same sample, as a share of the usual
    /// range, above 0.
    pub difference: f64,
    /// Least cosine similarity of the candidate's answers with those of the old process: 1 = equal up to a factor, 0 =
    /// orthogonal, -1 = opposite.
    pub similarity: f64,
    /// Ticks in a row on which the candidate's answer may be missing, late, implausible, too different, or opposite; 1
    /// or more.
    pub ticks: u64,
    /// Largest tilt of the vehicle while the candidate is active \[deg\], above 0.
    pub tilt_deg: f64,
    /// Largest distance from the trajectory while the candidate is active \[m\], above 0.
    pub error_m: f64,
}

impl Default for SwapBounds {
    fn default() -> Self {
        Self { difference: 0.25, similarity: -0.5, ticks: 3, tilt_deg: 40.0, error_m: 2.0 }
    }
}

/// Ticks at which the stages of a swap begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SwapTicks {
    /// First tick of the candidate, on standby.
    pub from: u64,
    /// First tick of the candidate as the active process.
    pub hand_over: u64,
    /// First tick without the old process.
    pub until: u64,
}

impl Swap {
    /// Makes a swap of `node` with the defaults.
    pub fn new(node: Topic, at_s: f64) -> Self {
        let (standby_s, watch_s) = (Self::usual_standby_s(), Self::usual_watch_s());
        let bounds = SwapBounds::default();
        Self { at_s, node, exec: None, set: vec![], standby_s, watch_s, bounds, may_fail: false }
    }

    /// Ticks of the swap at a sample time \[s\]. The candidate is on standby for at least one tick.
    pub fn ticks(&self, sample_s: f64) -> SwapTicks {
        let ticks = |time_s: f64| (time_s / sample_s - 1e-6).ceil() as u64;
        let from = ticks(self.at_s);
        let hand_over = from + ticks(self.standby_s).max(1);
        SwapTicks { from, hand_over, until: hand_over + ticks(self.watch_s) }
    }

    fn usual_standby_s() -> f64 {
        1.0
    }

    fn usual_watch_s() -> f64 {
        3.0
    }
}

/// Names of the nodes that can be swapped.
const NAMES: &[&str] = NODES.split_at(1).1;

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the form that serde calls")]
fn name_of<S: Serializer>(node: &Topic, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(node.publisher())
}

/// Reads the name of a node. Accepts the plant, which the check then refuses with the reason, but never suggests it.
pub fn swap_node<'de, D: Deserializer<'de>>(from: D) -> Result<Topic, D::Error> {
    let word = String::deserialize(from)?;
    Topic::of_node(&word).ok_or_else(|| D::Error::unknown_variant(&word, NAMES))
}

fn names(_: &mut SchemaGenerator) -> Schema {
    let node = |edge: &Edge| json!({"const": edge.publisher, "description": edge.description, "type": "string"});
    json_schema!({ "oneOf": GRAPH[1..].iter().map(node).collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_candidate_is_on_standby_for_one_tick_at_least() {
        let swap = Swap { standby_s: 0.5, watch_s: 2.0, ..Swap::new(Topic::Actuators, 0.29) };
        assert_eq!(swap.ticks(0.01), SwapTicks { from: 29, hand_over: 79, until: 279 });
        let hasty = Swap { standby_s: 0.0, watch_s: 0.0, ..swap };
        assert_eq!(hasty.ticks(0.01), SwapTicks { from: 29, hand_over: 30, until: 30 });
    }
}
