//! Compares the reaction of the supervision to a process fault in lockstep and in real time.
//!
//! ```text
//! fault begins -> noticed -> another process is active
//!                 died, hung  took over
//! ```
//!
//! All times are whole ticks since the first tick of the fault, from the events of the flight. A tick is without an
//! active process if it has no delivered message of the node's topic. In lockstep the delays of the supervision are
//! settings; in real time they depend on this machine.

use std::collections::BTreeSet;
use std::sync::atomic::AtomicU32;

use contract::topic::Topic;
use flight::event::{Event, What, name};
use serde::Serialize;
use settings::{Fault, FaultKind, FaultTarget, Mode, Scenario};

use crate::flights::through_processes;

/// Begin and duration of every fault, and duration of the flight \[s\].
const AT_S: f64 = 1.0;
const FOR_S: f64 = 1.0;
const DURATION_S: f64 = 3.5;
const NODES: [(FaultTarget, Topic); 3] = [
    (FaultTarget::Guidance, Topic::Reference),
    (FaultTarget::AttitudeMpc, Topic::Controls),
    (FaultTarget::Mixer, Topic::Actuators),
];
const KINDS: [FaultKind; 4] = [FaultKind::Kill, FaultKind::Stop, FaultKind::Hog, FaultKind::Exit];

/// Reaction to one fault in both modes.
#[derive(Debug, Clone, Serialize)]
pub struct FaultHandling {
    /// Target and kind of the fault.
    pub fault: String,
    pub lockstep: Handling,
    pub realtime: Handling,
}

/// Reaction to a fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Handling {
    pub noticed_ms: Option<f64>,
    pub next_active_ms: Option<f64>,
    /// Number of ticks without an active process, from the beginning of the fault to the end of the flight.
    pub ticks_without_active: usize,
    pub restarts: usize,
}

/// Flies every process fault in both modes.
pub fn compare(base: &Scenario, interrupts: &AtomicU32) -> anyhow::Result<Vec<FaultHandling>> {
    let cases = KINDS.into_iter().flat_map(|kind| NODES.map(|node| (kind, node)));
    cases
        .map(|(kind, (target, topic))| {
            let mut scenario = base.clone();
            scenario.run.duration_s = DURATION_S;
            scenario.fault = vec![Fault::new(target, kind, AT_S, Some(FOR_S))];
            let mut fly = |mode| {
                scenario.run.mode = mode;
                fly(&scenario, topic, interrupts)
            };
            Ok(FaultHandling {
                fault: format!("{} {}", name(target), name(kind)),
                lockstep: fly(Mode::Lockstep)?,
                realtime: fly(Mode::Realtime)?,
            })
        })
        .collect()
}

fn fly(scenario: &Scenario, topic: Topic, interrupts: &AtomicU32) -> anyhow::Result<Handling> {
    let mut answered = BTreeSet::new();
    let (_, flown) = through_processes(scenario, interrupts, |record| {
        let delivered = record.stamped().filter(|(of, stamp)| *of == topic && stamp.is_delivered());
        answered.extend(delivered.map(|(_, stamp)| stamp.tick));
    })?;
    let tick = |time_s: f64| (time_s / scenario.sample_s()).round() as u64;
    let begins = tick(AT_S);
    let (noticed, next_active, restarts) = of_events(&flown.how.events, topic.publisher(), begins);
    let after_ms = |tick: u64| (tick - begins) as f64 * scenario.sample_s() * 1e3;
    Ok(Handling {
        noticed_ms: noticed.map(after_ms),
        next_active_ms: next_active.map(after_ms),
        // The last tick is not counted, because nodes may already be leaving.
        ticks_without_active: (begins..tick(DURATION_S) - 1).filter(|tick| !answered.contains(tick)).count(),
        restarts,
    })
}

/// Returns the tick on which the failure of `node` from tick `begins` on was noticed, the tick on which the next
/// process became active, and the number of processes started.
fn of_events(events: &[Event], node: &str, begins: u64) -> (Option<u64>, Option<u64>, usize) {
    let after = || events.iter().filter(|event| event.node == node && event.tick >= begins);
    let first = |of: fn(What) -> bool| after().find(|event| of(event.what)).map(|event| event.tick);
    let noticed = first(|what| matches!(what, What::Died | What::Hung));
    let next_active = first(|what| what == What::TookOver);
    (noticed, next_active, after().filter(|event| event.what == What::Started).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_before_the_fault_and_of_other_nodes_do_not_count() {
        let event = |tick, node, what| Event::new(tick, node, 1, what);
        let events = [
            event(0, "mixer", What::TookOver),
            event(100, "guidance", What::Died),
            event(101, "mixer", What::Died),
            event(103, "mixer", What::Started),
            event(106, "mixer", What::TookOver),
            event(150, "mixer", What::Started),
        ];
        assert_eq!(of_events(&events, "mixer", 100), (Some(101), Some(106), 2));
        assert_eq!(of_events(&events, "attitude-mpc", 100), (None, None, 0));
    }
}
