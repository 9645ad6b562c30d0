//! `[[fault]]`: faults to inject. Each depends on the tick and the run's seed alone, so that a faulty run repeats.
//!
//! The check refuses a kind that the target does not have, and a size that the kind does not use ([`Fault::keys`]). The
//! default of every size stands beside the code that injects the fault.

mod catalogue;

pub use catalogue::{FaultKind, FaultTarget, Wrong};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::words::given_keys;

/// Latest beginning and longest duration of a fault \[s\]: a day, the longest flight.
pub const MAX_FAULT_S: f64 = 86_400.0;
/// Largest [`Fault::ms`] \[ms\].
pub const MAX_FAULT_MS: f64 = 60_000.0;

/// One `[[fault]]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Beginning of the fault \[s\], 0 to 86400.
    #[schemars(range(min = 0.0, max = MAX_FAULT_S))]
    pub at_s: f64,
    /// Duration \[s\], 0 to 86400; absent = until the end of the flight.
    #[schemars(range(min = 0.0, max = MAX_FAULT_S))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
    /// Part of the stack that has the fault.
    pub target: FaultTarget,
    /// Kind of the fault; each target has only some of them.
    pub kind: FaultKind,
    /// Process whose clock is off (offset).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process: Option<FaultTarget>,
    /// Number of the IMU that has a fault of rates or acceleration, 1 or 2; absent = every IMU.
    #[schemars(range(min = 1, max = 2))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imu: Option<u64>,
    /// Time \[ms\]: delay (slow process, delay, delayed), age (stale), time constant (slow sensor or actuator),
    /// duration of the rise (step), or lead of the clock (offset; negative = the clock is behind).
    #[schemars(range(min = -MAX_FAULT_MS, max = MAX_FAULT_MS))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ms: Option<f64>,
    /// Size: standard deviation (noise), bias or factor (wrong), share of the range (saturated), kilograms (mass). It
    /// has the unit of the quantity that it changes; angles are in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Wind, NED \[m/s\] (step, gust).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vector: Option<[f64; 3]>,
    /// Share of the messages or ticks affected, 0 to 1 (drop, duplicate, reorder, corrupt, garbage, intermittent).
    #[schemars(range(min = 0, max = 1))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// Number of messages lost in a row (burst), bits flipped (corrupt), or messages of which one passes (rate); 1 or
    /// more.
    #[schemars(range(min = 1))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// Error of a sensor or topic that is wrong; absent = bias for a sensor, sign for a topic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub how: Option<Wrong>,
}

impl Fault {
    /// Makes a fault of the default size.
    pub fn new(target: FaultTarget, kind: FaultKind, at_s: f64, for_s: Option<f64>) -> Self {
        Self {
            at_s,
            for_s,
            target,
            kind,
            process: None,
            imu: None,
            ms: None,
            value: None,
            vector: None,
            probability: None,
            count: None,
            how: None,
        }
    }

    /// Keys of the sizes that this kind of fault uses.
    pub fn keys(&self) -> &'static [&'static str] {
        use FaultKind as K;
        match self.kind {
            K::Slow | K::Delay | K::Stale | K::Delayed | K::Offset => &["ms"],
            K::Drop | K::Duplicate | K::Reorder | K::Garbage | K::Intermittent => &["probability"],
            K::Burst | K::Rate => &["count"],
            K::Corrupt => &["count", "probability"],
            K::Wrong if self.target.is_an_actuator() => &["value"],
            K::Stuck if self.target == FaultTarget::Tilt => &["value"],
            K::Wrong if self.wrong() == Wrong::Sign => &["how"],
            K::Wrong => &["how", "value"],
            K::Noise | K::Saturated | K::Mass => &["value"],
            K::Step => &["vector", "ms"],
            K::Gust => &["vector"],
            _ => &[],
        }
    }

    /// Error of a sensor or topic that is wrong: the given error, or the default of the target.
    pub fn wrong(&self) -> Wrong {
        self.how.unwrap_or(if self.target.topic().is_some() { Wrong::Sign } else { Wrong::Bias })
    }

    /// Keys of the sizes that were given.
    pub fn given(&self) -> Vec<String> {
        given_keys(self, &["at_s", "for_s", "target", "kind", "process", "imu"])
    }

    /// Ticks on which the fault is active: those at or after its beginning and before its end.
    pub fn ticks(&self, sample_s: f64) -> std::ops::Range<u64> {
        // A time that differs from a tick by rounding only is that tick.
        let tick_of = |time_s: f64| (time_s / sample_s - 1e-6).ceil() as u64;
        tick_of(self.at_s)..self.for_s.map_or(u64::MAX, |for_s| tick_of(self.at_s + for_s))
    }

    /// Returns whether the fault happens at one instant, as the death of a process does.
    pub fn is_momentary(&self) -> bool {
        matches!(self.kind, FaultKind::Kill | FaultKind::Exit)
    }

    /// Returns whether the fault is active on `tick`, at a sample time \[s\].
    pub fn is_active(&self, tick: u64, sample_s: f64) -> bool {
        self.ticks(sample_s).contains(&tick)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_targets_is_complete_and_in_order() {
        for (i, (target, name)) in FaultTarget::ALL.into_iter().enumerate() {
            assert_eq!((target as usize, target.name()), (i, name));
            assert_eq!(toml::Value::try_from(target), Ok(name.into()));
        }
        assert_eq!(FaultTarget::ALL.len(), FaultTarget::Host as usize + 1, "the last one");
    }

    #[test]
    fn a_fault_is_active_from_its_first_tick_to_before_its_end() {
        let fault = |at_s, for_s| Fault::new(FaultTarget::Mpc, FaultKind::Nan, at_s, for_s);
        let active = |fault: &Fault| (0..1000).filter(|tick| fault.is_active(*tick, 0.01)).collect::<Vec<_>>();
        assert_eq!(active(&fault(0.29, Some(0.03))), [29, 30, 31]);
        assert_eq!(active(&fault(0.291, Some(0.01))), [30]);
        assert_eq!(active(&fault(9.98, None)), [998, 999]);
        assert!(active(&fault(1.0, Some(0.0))).is_empty());
    }
}
