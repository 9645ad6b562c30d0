//! `[[swap]]`: another process for a node, in flight.
//!
//! ```text
//! at_s          the candidate starts on standby: it has the inputs of the active process, and its messages are not delivered
//!  + standby_s  the candidate becomes active, if it kept within its bounds; the old process goes on as the standby
//!  + watch_s    the old process ends; if the candidate left its bounds before, the old process became active again
//! ```
//!
//! A recorder has no trial: the old one ends as soon as the candidate records. `set`, `standby_s`, `watch_s` and `bounds`
//! are refused for it.

use serde::{Deserialize, Deserializer, Serialize};

use crate::Topic;
use crate::scenario::words::named;

/// One `[[swap]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Swap {
    /// When the candidate begins \[s\].
    pub at_s: f64,
    /// The node whose process is replaced.
    pub node: SwapNode,
    /// Its program; absent = the launcher's own. It is started as `PROGRAM --namespace NAME --epoch N --settings FILE`,
    /// a recorder with `--log FILE` instead of settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exec: Option<String>,
    /// Its settings, each as after `--set`, on top of the run's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
    /// How long the candidate is on standby \[s\]; `shadow_s` is the old spelling.
    #[serde(default = "Swap::usual_standby_s", alias = "shadow_s")]
    pub standby_s: f64,
    /// How long the old process stays on standby after that \[s\].
    #[serde(default = "Swap::usual_watch_s")]
    pub watch_s: f64,
    /// What the candidate may not do.
    #[serde(default)]
    pub bounds: SwapBounds,
    /// Whether the flight counts as flown where the candidate did not stay.
    #[serde(default)]
    pub may_fail: bool,
}

/// `swap.bounds`: what a candidate may not do, on standby and active.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SwapBounds {
    /// Largest difference between its answer and the old one's to the same sample, as a share of the largest answer
    /// that is common.
    pub difference: f64,
    /// Least cosine similarity of its answers with the old one's: 1 the same up to a factor, 0 nothing in common, -1 the
    /// opposite; `accord` is the old spelling.
    #[serde(alias = "accord")]
    pub similarity: f64,
    /// Ticks in a row on which its answer may be missing, late, implausible, too different, or opposite.
    pub ticks: u64,
    /// Largest tilt of the vehicle while it is active \[deg\].
    pub tilt_deg: f64,
    /// Farthest from the trajectory while it is active \[m\].
    pub error_m: f64,
}

impl Default for SwapBounds {
    fn default() -> Self {
        Self { difference: 0.25, similarity: -0.5, ticks: 3, tilt_deg: 40.0, error_m: 2.0 }
    }
}

/// `swap.node`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SwapNode {
    /// Refused: it is the vehicle.
    Plant,
    /// The position controller.
    Guidance,
    /// The attitude controller.
    AttitudeMpc,
    /// The control allocation.
    Mixer,
    /// The process that writes the log.
    Recorder,
}

/// The ticks of a swap of one node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SwapTicks {
    /// The candidate's first, on standby.
    pub from: u64,
    /// The candidate's first as the active process.
    pub hand_over: u64,
    /// The first without the old process.
    pub until: u64,
}

impl Swap {
    /// A swap of `node` with the defaults.
    pub fn new(node: SwapNode, at_s: f64) -> Self {
        let (standby_s, watch_s) = (Self::usual_standby_s(), Self::usual_watch_s());
        let bounds = SwapBounds::default();
        Self { at_s, node, exec: None, set: vec![], standby_s, watch_s, bounds, may_fail: false }
    }

    /// Its ticks at a sample time \[s\], when it is of a node in the ring. At least one of them is spent on standby.
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

impl SwapNode {
    /// The topic it publishes; `None` for the recorder.
    pub fn topic(self) -> Option<Topic> {
        match self {
            Self::Plant => Some(Topic::State),
            Self::Guidance => Some(Topic::Reference),
            Self::AttitudeMpc => Some(Topic::Controls),
            Self::Mixer => Some(Topic::Actuators),
            Self::Recorder => None,
        }
    }

    /// As the file spells it.
    pub fn name(self) -> &'static str {
        self.topic().map_or("recorder", Topic::publisher)
    }
}

impl<'de> Deserialize<'de> for SwapNode {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        use SwapNode as N;
        let all = [N::Plant, N::Guidance, N::AttitudeMpc, N::Mixer, N::Recorder].map(|node| (node, node.name()));
        // The plant is known, to be refused with the reason, and not offered.
        named(&String::deserialize(from)?, &all, &["guidance", "attitude-mpc", "mixer", "recorder"])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_candidate_is_on_standby_for_one_tick_at_least() {
        let swap = Swap { standby_s: 0.5, watch_s: 2.0, ..Swap::new(SwapNode::Mixer, 0.29) };
        assert_eq!(swap.ticks(0.01), SwapTicks { from: 29, hand_over: 79, until: 279 });
        let hasty = Swap { standby_s: 0.0, watch_s: 0.0, ..swap };
        assert_eq!(hasty.ticks(0.01), SwapTicks { from: 29, hand_over: 30, until: 30 });
    }

    #[test]
    fn the_old_spellings_are_read() {
        let text = "at_s = 1\nnode = \"mixer\"\nshadow_s = 0.5\nbounds = { accord = 0.1 }";
        let swap: Swap = toml::from_str(text).unwrap();
        assert_eq!((swap.standby_s, swap.bounds.similarity), (0.5, 0.1));
    }
}
