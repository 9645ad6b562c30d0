//! Kinds of flights, and the faults, kills and swaps given to the long ones.
//!
//! | number, of 20 | kind |
//! |---|---|
//! | 8 | undisturbed, at 100 Hz |
//! | 1 | with sixty good candidates ([`candidates`]) |
//! | 1 | with thirty wrong candidates |
//! | 5 | disturbed in flight by commands: two processes killed, one swapped, three faults given |
//! | 3 | under `stress-ng --cpu 4` at `SCHED_OTHER` |
//! | 2 | undisturbed, at 500 Hz |
//!
//! Short flights are of the kind `Killed`.

use contract::topic::Topic;
use serde::Serialize;
use settings::{Fault, FaultKind, FaultTarget, Scenario, SchedulingPolicy, Swap};

use super::candidates;
use crate::timing::timed_flights::realtime;

/// Conditions of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conditions {
    #[default]
    Killed,
    Alone,
    Disturbed,
    Loaded,
    Fast,
    Good,
    Wrong,
}
use Conditions::{Alone, Disturbed, Fast, Good, Killed, Loaded, Wrong};

/// Kinds of twenty long flights, mixed so that a short series already has several kinds.
const KINDS: [Conditions; 20] = [
    Disturbed, Fast, Good, Loaded, Wrong, Alone, Disturbed, Alone, Alone, Loaded, Disturbed, Alone, Alone, Fast, Alone,
    Disturbed, Loaded, Alone, Disturbed, Alone,
];

impl Conditions {
    /// All kinds, in the order of the printed table.
    pub const ALL: [Self; 7] = [Killed, Alone, Disturbed, Loaded, Fast, Good, Wrong];

    /// Returns the kind of long flight `number`, counted from 0.
    pub fn of(number: u64) -> Self {
        KINDS[number as usize % KINDS.len()]
    }

    pub fn words(self) -> &'static str {
        match self {
            Killed => "100 Hz, any process killed",
            Alone => "100 Hz",
            Disturbed => "100 Hz, kills, a swap, live faults",
            Loaded => "100 Hz, SCHED_OTHER, stress-ng",
            Fast => "500 Hz",
            Good => "100 Hz, good candidates",
            Wrong => "100 Hz, wrong candidates",
        }
    }

    /// Returns whether the flight has [`candidates`].
    pub fn has_candidates(self) -> bool {
        matches!(self, Good | Wrong)
    }

    pub fn rate_hz(self) -> u32 {
        if self == Fast { 500 } else { 100 }
    }

    /// Returns the scenario to fly; with candidates, the swaps determine its duration instead of `duration_s`.
    pub fn scenario(self, duration_s: f64) -> anyhow::Result<Scenario> {
        let survey = realtime(
            self.rate_hz(),
            if self == Loaded { SchedulingPolicy::Other } else { SchedulingPolicy::Fifo },
            duration_s,
        );
        match self {
            Good => Ok(candidates::good(survey)),
            Wrong => candidates::wrong(),
            _ => Ok(survey),
        }
    }
}

/// Command given to a flight.
#[derive(Debug, Clone, PartialEq)]
pub enum FlightOrder {
    /// SIGKILL to the newest process of a node.
    Kill(&'static str),
    Swap(Box<Swap>),
    Inject(Box<Fault>),
}

/// Returns the orders for disturbed flight `number` of `duration_s`, with their times as shares of the flight. The
/// nodes differ from flight to flight.
pub fn orders(number: u64, duration_s: f64) -> [(f64, FlightOrder); 6] {
    const NODES: [Topic; 3] = [Topic::Controls, Topic::Reference, Topic::Actuators];
    let node = |i: usize| NODES[(number as usize + i) % NODES.len()];
    let short_s = 0.05 * duration_s;
    let swap = Swap { standby_s: short_s, watch_s: short_s, ..Swap::new(node(1), 0.0) };
    let inject = |target, kind| FlightOrder::Inject(Box::new(Fault::new(target, kind, 0.0, Some(short_s))));
    [
        (0.1, FlightOrder::Kill(node(0).publisher())),
        (0.2, inject(FaultTarget::Rates, FaultKind::Noise)),
        (0.3, FlightOrder::Swap(Box::new(swap))),
        (0.6, inject(FaultTarget::Controls, FaultKind::Drop)),
        (0.7, FlightOrder::Kill(node(2).publisher())),
        (0.8, inject(FaultTarget::Rotor1, FaultKind::Slow)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_flights_have_the_kinds_of_the_table() {
        let count = |kind| (0..20).filter(|number| Conditions::of(*number) == kind).count();
        assert_eq!([Alone, Disturbed, Loaded, Fast, Good, Wrong].map(count), [8, 5, 3, 2, 1, 1]);
    }
}
