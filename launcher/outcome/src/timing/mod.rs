//! Timing of the nodes of a flight, from the stamps alone. Words are those of [`runtime::cycle_timing`]; figures are in
//! us.
//!
//! ```text
//! jitter / hop       start - release           how long after its release the process woke
//! execution          publish - start           wall time
//! cpu                CPU time of the thread    from the end of its previous cycle on: wake-up, step, sending, doorbell
//! input age          start - sample            how old the sample was when the process began
//! response           publish - sample          late when beyond the deadline
//! slip               a period without a cycle
//! withheld           a late response that was not sent, as the deadline's policy says
//! miss               a late response, sent or not, or a slip;  run: misses one after the other
//! age at actuator    the command takes effect - the sample behind it
//! stall              slots in a row without a message of a node, because its process slept, waited or was gone
//! late (of a tick)   the largest over its nodes of: response + period x slots of the stall just before it
//! worst tick         the latest tick: as late as the largest `response_per_slot` of all nodes
//! contradiction      a message whose stamp breaks the order of things:
//!                      sample <= publish of the plant <= .. of guidance <= .. of attitude-mpc <= .. of the mixer
//!                      <= arrival of the command at the plant, which is in the age that the plant tells
//! ```
//!
//! A stall makes one bad cycle and no others, because no other cycle ran: percentiles over the cycles hide how long the
//! stall was. So every stall is also recorded for each slot it covered, and both counts are reported: `response` over
//! the cycles and `response_per_slot` over the periods; the age over the commands applied and over the slots in which a
//! command was held. When the host takes the processors, several nodes sleep through the same slots: that is one stall,
//! as long as the longest of them, and its slots are never added up over the nodes. The terminal, run.json, the report
//! and the trace's window all use the worst tick as defined here.
//!
//! If a node's messages contradict the times of others, this node or one before it in the ring reads a different clock,
//! and figures computed across the two clocks mean nothing. A clock that is off by less than a hop goes unnoticed.
//!
//! | file | holds |
//! |---|---|
//! | `node` | one node's cycles: histograms and counts |
//! | `age` | the age at the actuator, per command and per slot |
//! | `worst` | the worst ticks of a flight, and the rules for their causes |

mod age;
mod node;
#[cfg(test)]
mod tests;
mod worst;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use contract::Topic;
use contract::message::{Stamp, Truth};
use contract::topic::NODES;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::IntervalLogWriterBuilder;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Mode, Scenario};

use crate::happenings::Happenings;
use crate::percentiles::{Percentiles, percentiles};
pub use age::Age;
use flight::log::Record;
use folder::dir::Dir;
pub use node::{CycleCounts, FIGURES, NodeRecord, NodeTiming};
use worst::WorstTicks;
pub use worst::{CycleRecord, EXECUTION, INPUT, WorstTick};

/// Folder of the histograms, inside the run's.
pub const HISTOGRAMS: &str = "histograms";

/// The `timing` table of run.json. Nodes stand in it by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimingRecord {
    /// Deadline of the whole chain \[ms\].
    pub deadline_ms: f64,
    /// Figures of each node, by its name.
    pub nodes: BTreeMap<String, NodeRecord>,
    /// Messages whose times contradict those of other messages, by node; they are in no figure.
    pub clock_contradictions: BTreeMap<String, u64>,
    /// Age of the sample behind a command when the command takes effect: one value for each command.
    pub age_at_actuator: Percentiles,
    /// Age of the sample behind the command in force: one value for each slot, so that a command that never came
    /// counts.
    pub age_at_actuator_per_slot: Percentiles,
    /// Worst ticks, the worst first; empty except in real time.
    pub worst_ticks: Vec<WorstTick>,
    /// Place and format of the histograms.
    pub histograms: String,
}

/// Histograms and counts of every node and of the whole ring, gathered message by message.
pub struct Timing {
    /// Deadline of the whole chain \[ns\].
    deadline_ns: u64,
    pub nodes: [NodeTiming; Topic::COUNT],
    pub age: Age,
    /// The newest command: tick, number, response \[ns\].
    command: (u64, u64, u64),
    /// Worst ticks; `None` except in real time, because no tick is late otherwise.
    worst: Option<WorstTicks>,
}

impl Timing {
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            deadline_ns: scenario.deadline_of(Topic::Actuators as usize).deadline_ns,
            nodes: Topic::ALL.map(|topic| NodeTiming::new(topic, scenario)),
            age: Age::new(scenario.sample_ns()),
            command: (0, 0, 0),
            worst: (scenario.run.mode == Mode::Realtime).then(|| WorstTicks::new(scenario)),
        }
    }

    /// Takes in a message that [`flight::log::Count`] counts, with the stamp `before` it of the same process.
    pub fn observe(&mut self, record: &Record, before: &Stamp) {
        let Some((topic, stamp)) = record.stamped() else { return };
        let own = topic as usize;
        let mut cycle = self.nodes[own].observe(stamp, before);
        match record {
            Record::State(state) => {
                self.age.observe(state);
                let (tick, sequence, response_ns) = self.command;
                let answers =
                    stamp.tick.checked_sub(1) == Some(tick) && sequence > 0 && state.applied_sequence == sequence;
                // The plant tells a measured age only in real time.
                if self.worst.is_some() && answers && state.applied_age_ns < response_ns {
                    self.nodes[Topic::Actuators as usize].contradictions += 1;
                }
            }
            Record::Reference(_) | Record::Truth(_) => {}
            Record::Controls(controls) => cycle.iter_mut().for_each(|cycle| cycle.solve_ns = controls.solve_ns),
            Record::Actuators(_) => {
                self.command = (stamp.tick, stamp.sequence, stamp.publish_ns[own].saturating_sub(stamp.sample_ns));
            }
        }
        if let (Some(worst), Some(cycle)) = (&mut self.worst, cycle) {
            worst.observe(record, cycle);
        }
    }

    /// Takes in a TRUTH, for the position errors of the worst ticks.
    pub fn truth(&mut self, truth: &Truth) {
        self.worst.iter_mut().for_each(|worst| worst.truth(truth));
    }

    /// The age at the actuator so far, over the commands applied.
    pub fn age(&self) -> Percentiles {
        percentiles(&self.age.per_command)
    }

    /// Number of deadlines missed so far by all nodes.
    pub fn misses(&self) -> u64 {
        self.nodes.iter().fold(0, |sum, node| sum.saturating_add(node.counts.misses))
    }

    /// Returns the `timing` table of run.json; `happened` explains the worst ticks.
    pub fn record(&self, happened: &Happenings) -> TimingRecord {
        let nodes = || NODES.iter().map(|name| (*name).to_owned()).zip(&self.nodes);
        TimingRecord {
            deadline_ms: self.deadline_ns as f64 / 1e6,
            nodes: nodes().map(|(name, node)| (name, node.record())).collect(),
            clock_contradictions: nodes().map(|(name, node)| (name, node.contradictions)).collect(),
            age_at_actuator: self.age(),
            age_at_actuator_per_slot: percentiles(&self.age.per_slot),
            worst_ticks: self.worst_ticks(happened),
            histograms: format!("{HISTOGRAMS}/*.hlog: HdrHistogram interval logs, nanoseconds, one file per figure"),
        }
    }

    /// Writes every histogram in full to `folder`/histograms.
    pub fn write_histograms(&self, folder: &Path) -> anyhow::Result<()> {
        let path = folder.join(HISTOGRAMS);
        let folder = Dir::open(folder).and_then(|folder| folder.make_folder(HISTOGRAMS));
        let folder = folder.with_context(|| format!("cannot write into {}", path.display()))?;
        let nodes = NODES.iter().zip(&self.nodes);
        let of_nodes =
            nodes.flat_map(|(node, timing)| timing.figures.iter().map(move |(f, h)| (format!("{node}-{f}"), h)));
        let ages = [("age_at_actuator", &self.age.per_command), ("age_at_actuator_per_slot", &self.age.per_slot)];
        let mut all = of_nodes.chain(ages.map(|(figure, histogram)| (figure.to_owned(), histogram)));
        all.try_for_each(|(name, histogram)| write_histogram(&folder, &name, histogram))
    }

    fn worst_ticks(&self, happened: &Happenings) -> Vec<WorstTick> {
        let usual = self.nodes.each_ref().map(NodeTiming::usual);
        self.worst.as_ref().map_or(vec![], |worst| worst.explained(&usual, happened))
    }
}

impl TimingRecord {
    /// Text for people: a line per node, the age and the worst tick, indented as the rest of the summary.
    pub fn describe(&self) -> String {
        use std::fmt::Write;
        let mut text = String::new();
        let mut line = |words: &str| {
            let _ = writeln!(text, "  {}", words.trim_end()); // writing to a String cannot fail
        };
        let groups = ["jitter or hop", "execution", "response [us]"].map(|name| format!("{name:^24}"));
        line(&format!("{:<14}{}", "", groups.concat()));
        let columns = format!("{:>7}{:>7}{:>8}  ", "p50", "p99", "max").repeat(3);
        line(&format!("{:<14}{columns}{:>6}{:>5}", "", "misses", "run"));
        for (name, node) in self.by_node() {
            let cells = [node.wake(), node.execution.as_ref(), node.response.as_ref()].map(|figure| {
                let p = figure.copied().unwrap_or_default();
                format!("{:>7.0}{:>7.0}{:>8.0}  ", p.p50_us, p.p99_us, p.max_us)
            });
            let CycleCounts { misses, longest_run_of_misses: run, .. } = node.counts;
            line(&format!("{name:<14}{}{misses:>6}{run:>5}", cells.concat()));
        }
        for (name, contradictions) in self.clock_contradictions.iter().filter(|(_, count)| **count > 0) {
            line(&format!(
                "{:<22}{contradictions} messages of {name} contradict the times of others: times across processes are \
                 not to be trusted",
                "clocks differ"
            ));
        }
        let Self { age_at_actuator: commands, age_at_actuator_per_slot: slots, .. } = self;
        line(&format!("{:<22}{}", "age at the actuator", age(commands, "commands applied")));
        line(&format!("{:<22}{}", "", age(slots, "slots held")));
        if let Some(worst) = self.worst_ticks.first() {
            let error = worst.position_error_m.map_or(String::new(), |m| format!("; position error {m:.3} m"));
            let (late_ms, tick, time_s) = (worst.late_us / 1e3, worst.tick, worst.time_s);
            line(&format!("{:<22}{late_ms:.2} ms, tick {tick} at {time_s:.2} s{error}", "worst tick"));
            line(&format!("{:<22}{}", "", worst.in_words));
        }
        text
    }

    /// Returns the nodes with their names, in the order of the ring.
    pub fn by_node(&self) -> impl Iterator<Item = (&'static str, &NodeRecord)> {
        NODES.iter().filter_map(|name| Some((*name, self.nodes.get(*name)?)))
    }
}

/// Writes a histogram in full as `folder`/`name`.hlog, the log format of `HdrHistogram`: one interval, V2 compressed.
fn write_histogram(folder: &Dir, name: &str, histogram: &Histogram<u64>) -> anyhow::Result<()> {
    let file = format!("{name}.hlog");
    let mut text = Vec::new();
    let mut serializer = V2DeflateSerializer::new();
    let mut builder = IntervalLogWriterBuilder::new();
    builder.add_comment(&format!("{name} of one flight, nanoseconds")).with_max_value_divisor(1e3);
    let log = builder.begin_log_with(&mut text, &mut serializer);
    let written = log.map(|mut log| log.write_histogram(histogram, Duration::ZERO, Duration::from_secs(1), None));
    let cannot = || format!("cannot write {}", folder.at(&file).display());
    written.with_context(cannot)?.map_err(|error| anyhow::anyhow!("{error:?}")).with_context(cannot)?;
    folder.write_whole(&file, &text)
}

fn age(p: &Percentiles, of_what: &str) -> String {
    let [p50, p99, max] = [p.p50_us, p.p99_us, p.max_us].map(|us| us / 1e3);
    format!("p50 {p50:.2} ms, p99 {p99:.2} ms, max {max:.2} ms over {} {of_what}", p.n)
}
