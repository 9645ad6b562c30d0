//! CycleTiming of a flight, from the stamps alone. Words are those of [`runtime::cycle_timing`]; all figures are in `us`.
//!
//! ```text
//! jitter / hop       start - release                what the process slept too long
//! execution          publish - start                wall time
//! cpu                CPU time of the thread         since it was done with the cycle before: sending, doorbell, wake-up
//! input age          start - sample                 how old the sample was when the process began
//! response           publish - sample               late when beyond the deadline
//! slip               a period without a cycle
//! withheld           a late response that was not sent, as the deadline's policy says
//! miss               a late response, sent or not, or a slip;  run: misses one after the other
//! age at actuator    the command takes effect - the sample behind it
//! stall              slots in a row without a message of a node, because its process slept, waited or was gone
//! late (of a tick)   the largest over its nodes of: response + period x slots of the stall just before it
//! worst tick         the one that is latest: as late as the largest `response_per_slot` of all nodes
//! ```
//!
//! A stall makes one bad cycle and no others, because none ran: percentiles over the cycles hide how long it was. So
//! every stall is also recorded for each slot it covered, and both counts are told: `response` over the cycles and
//! `response_per_slot` over the periods, the age over the commands applied and over the slots in which one was held. When
//! the host takes the processors, several nodes sleep through the same slots: that is one stall, as long as the longest of
//! them, and its slots are never added up over the nodes. The terminal, run.json, the report and the window of the trace
//! all mean this worst tick.
//!
//! | file | holds |
//! |---|---|
//! | `node` | one node's histograms and counts |
//! | `age` | the age at the actuator, per command and per slot |
//! | `clocks` | whether all processes read the same time |
//! | `ticks` | the worst ticks of a flight |
//! | `cause` | the rules that say what made a tick late |
//! | `figures` | histograms, percentiles, and their files |
//! | `table` | what the terminal shows |

mod age;
mod cause;
mod clocks;
mod figures;
mod node;
mod table;
#[cfg(test)]
mod tests;
mod ticks;

use std::path::Path;

use contract::message::Stamp;
use contract::scenario::Mode;
use contract::topic::NODES;
use contract::{Scenario, Topic};
use hdrhistogram::Histogram;
use serde_json::{Map, Value, json};

use crate::happenings::Happenings;
pub use age::{Age, Holding};
pub use cause::Part;
use clocks::Clocks;
pub use figures::{Percentiles, histogram, percentiles};
use flight::log::Record;
pub use node::NodeTiming;
use ticks::Ticks;

/// Folder of the histograms, inside the run's.
pub const HISTOGRAMS: &str = "histograms";

/// Histograms and counts of every node and of the whole ring, gathered message by message.
pub struct Timing {
    /// Of the whole chain \[ns\].
    deadline_ns: u64,
    nodes: [NodeTiming; Topic::COUNT],
    age: Age,
    clocks: Clocks,
    /// Only against the clock is a tick late.
    ticks: Option<Ticks>,
}

impl Timing {
    /// Nothing seen yet.
    pub fn new(scenario: &Scenario) -> Self {
        let period_ns = scenario.sample_ns();
        Self {
            deadline_ns: scenario.deadline_of(Topic::Actuators as usize).deadline_ns,
            nodes: Topic::ALL.map(|topic| NodeTiming::new(topic, scenario)),
            age: Age::new(period_ns),
            clocks: Clocks::new(scenario.run.mode),
            ticks: (scenario.run.mode == Mode::Realtime).then(|| Ticks::new(period_ns)),
        }
    }

    /// Takes one message in that counts, with the stamp `before` it of the same process ([`flight::log::Count`]);
    /// `position_error_m` is that of the newest sample.
    pub fn observe(&mut self, record: &Record, before: &Stamp, position_error_m: f64) {
        self.clocks.observe(record);
        let cycle = self.nodes[record.topic() as usize].observe(record.stamp(), before);
        if let Record::State(state) = record {
            self.age.observe(state);
        }
        if let (Some(ticks), Some(cycle)) = (&mut self.ticks, cycle) {
            ticks.observe(record, cycle, position_error_m);
        }
    }

    /// The age at the actuator so far, over the commands applied.
    pub fn age(&self) -> Percentiles {
        percentiles(&self.age.per_command)
    }

    /// Deadlines missed so far, all nodes.
    pub fn misses(&self) -> u64 {
        self.nodes.iter().fold(0, |sum, node| sum.saturating_add(node.misses))
    }

    /// The `timing` table of run.json of a flight in which this `happened`.
    pub fn to_json(&self, happened: &Happenings) -> Value {
        let nodes: Map<_, _> =
            NODES.iter().zip(&self.nodes).map(|(name, node)| ((*name).into(), node.to_json())).collect();
        let contradictions: Map<_, _> =
            NODES.iter().zip(self.clocks.contradictions).map(|(name, n)| ((*name).into(), n.into())).collect();
        json!({
            "deadline_ms": self.deadline_ns as f64 / 1e6,
            "nodes": nodes,
            "clock_contradictions": contradictions,
            "age_at_actuator": self.age(),
            "age_at_actuator_per_slot": percentiles(&self.age.per_slot),
            "worst_ticks": self.worst_ticks(happened).iter().map(|(tick, culprit)| tick.to_json(culprit)).collect::<Vec<_>>(),
            "histograms": format!("{HISTOGRAMS}/*.hlog: HdrHistogram interval logs, nanoseconds, one file per figure"),
        })
    }

    /// Table, age and worst tick for people.
    pub fn describe(&self, happened: &Happenings) -> String {
        table::describe(self, happened)
    }

    /// Writes every histogram in full to `folder`/histograms.
    pub fn write_histograms(&self, folder: &Path) -> anyhow::Result<()> {
        let folder = folder.join(HISTOGRAMS);
        for (node, timing) in NODES.iter().zip(&self.nodes) {
            for (figure, histogram) in timing.figures() {
                figures::write(&folder, &format!("{node}-{figure}"), histogram)?;
            }
        }
        let ages: [(&str, &Histogram<u64>); 2] =
            [("age_at_actuator", &self.age.per_command), ("age_at_actuator_per_slot", &self.age.per_slot)];
        ages.iter().try_for_each(|(figure, histogram)| figures::write(&folder, figure, histogram))
    }

    /// The ten worst ticks, the worst first, each with what made it late.
    fn worst_ticks(&self, happened: &Happenings) -> Vec<(ticks::Tick, cause::Culprit)> {
        let usual = self.nodes.each_ref().map(NodeTiming::usual);
        let worst = self.ticks.as_ref().map(Ticks::worst).unwrap_or_default();
        worst.into_iter().filter_map(|tick| Some((tick, cause::culprit(&tick, &usual, happened)?))).collect()
    }
}
