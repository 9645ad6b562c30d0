//! The cycles of one node: a histogram per figure, and the misses.

use std::collections::BTreeMap;

use contract::Topic;
use contract::message::Stamp;
use hdrhistogram::Histogram;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Late, NodeDeadline, Scenario};

use crate::percentiles::{Percentiles, histogram, percentiles};

/// Largest number of slots recorded for a stall: a damaged stamp must not decide how long that takes.
pub const LONGEST_STALL_SLOTS: u64 = 100_000;

/// One cycle of a node, told by its message. Times are `CLOCK_MONOTONIC` nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TimedCycle {
    pub release_ns: u64,
    pub start_ns: u64,
    pub publish_ns: u64,
    /// Instant at which the node sent its message before this one; 0 if that is not known.
    pub free_ns: u64,
    /// Periods without a cycle just before this one.
    pub slips: u64,
    /// Cycles just before this one whose messages came too late and were not sent, by the deadline's policy.
    pub withheld: u64,
    /// Periods just before this one without a message of the node: slips and withheld cycles, or, if this process
    /// replaces another, all periods since the other's last message. At most [`LONGEST_STALL_SLOTS`].
    pub silent: u64,
    /// CPU time of this cycle; `None` until the node's next message, which carries it, is seen.
    pub cpu_ns: Option<u64>,
    /// CPU time of the cycle before this one, if that is known.
    pub cpu_before_ns: Option<u64>,
    /// Time inside the constrained solver; 0 except for attitude-mpc.
    pub solve_ns: u64,
}

impl TimedCycle {
    /// Release jitter or hop \[ns\]; an early start counts as on time.
    pub fn wake_ns(&self) -> u64 {
        self.start_ns.saturating_sub(self.release_ns)
    }

    pub fn execution_ns(&self) -> u64 {
        self.publish_ns.saturating_sub(self.start_ns)
    }

    /// Longest wait of a slot for this message: the response to the sample, and a period for every
    /// silent slot before it \[ns\].
    pub fn wait_ns(&self, sample_ns: u64, period_ns: u64) -> u64 {
        let silent_ns = self.silent.saturating_mul(period_ns);
        self.publish_ns.saturating_sub(sample_ns).saturating_add(silent_ns)
    }
}

/// Name of the wake-up of a node: the clock releases the plant, a message the others.
pub fn wake_name(topic: Topic) -> &'static str {
    if topic == Topic::State { "jitter" } else { "hop" }
}

/// Counts of late and missing messages and cycles of a node, in the names of run.json.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CycleCounts {
    /// Responses beyond the deadline, those not sent included.
    pub late: u64,
    /// Messages that were late and not sent.
    pub withheld: u64,
    /// Periods without a cycle.
    pub slips: u64,
    /// Messages after their deadline, and slips.
    pub misses: u64,
    /// Most misses in a row.
    pub longest_run_of_misses: u64,
    /// Length of the present run of misses.
    #[serde(skip)]
    run: u64,
}

impl CycleCounts {
    /// Adds a cycle. Slips and withheld messages come before it, so a cycle in time ends the run that they belong to.
    fn add(&mut self, cycle: &TimedCycle, misses: u64, late: bool) {
        // A damaged stamp may hold any count.
        let add = |sum: &mut u64, count| *sum = sum.saturating_add(count);
        add(&mut self.late, cycle.withheld.saturating_add(u64::from(late)));
        add(&mut self.withheld, cycle.withheld);
        add(&mut self.slips, cycle.slips);
        add(&mut self.misses, misses);
        add(&mut self.run, misses);
        self.longest_run_of_misses = self.longest_run_of_misses.max(self.run);
        if !late {
            self.run = 0;
        }
    }
}

/// Names of a node's figures in run.json, in the order in which the report shows them.
pub const FIGURES: [&str; 7] = ["jitter", "hop", "execution", "cpu", "input_age", "response", "response_per_slot"];

/// One node's part of the `timing` table of run.json. A figure that the node does not have is `None`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NodeRecord {
    #[serde(flatten)]
    pub counts: CycleCounts,
    /// Deadline of its message after the sample \[ms\].
    pub deadline_ms: f64,
    /// Treatment of a late message.
    pub policy: Late,
    /// Plant: time from the release by the clock to the start of the cycle.
    pub jitter: Option<Percentiles>,
    /// Other nodes: time from the send of the input to the start of the cycle.
    pub hop: Option<Percentiles>,
    /// Time from the start of the cycle to the send.
    pub execution: Option<Percentiles>,
    /// CPU time of a cycle.
    pub cpu: Option<Percentiles>,
    /// Age of the input at the start of the cycle, counted from its sample.
    pub input_age: Option<Percentiles>,
    /// Time from the sample to the send.
    pub response: Option<Percentiles>,
    /// Time from the sample to the send, for every slot, also those without a message.
    pub response_per_slot: Option<Percentiles>,
}

impl NodeRecord {
    /// Returns the figures by [`FIGURES`].
    pub fn figures(&self) -> [Option<&Percentiles>; FIGURES.len()] {
        let Self { jitter, hop, execution, cpu, input_age, response, response_per_slot, .. } = self;
        [jitter, hop, execution, cpu, input_age, response, response_per_slot].map(Option::as_ref)
    }

    /// Returns the figure of the wake-up: the jitter of the plant, the hop of any other node.
    pub fn wake(&self) -> Option<&Percentiles> {
        self.jitter.as_ref().or(self.hop.as_ref())
    }
}

pub struct NodeTiming {
    pub topic: Topic,
    period_ns: u64,
    pub deadline: NodeDeadline,
    /// Histograms \[ns\] by their names in run.json. The plant has no input: it makes the sample.
    pub figures: BTreeMap<&'static str, Histogram<u64>>,
    pub counts: CycleCounts,
    /// Messages that contradict the times of other messages: see [`super`].
    pub contradictions: u64,
    /// Epoch and tick of the newest message.
    newest: Option<(u64, u64)>,
}

impl NodeTiming {
    pub fn new(topic: Topic, scenario: &Scenario) -> Self {
        let input = (topic != Topic::State).then_some("input_age");
        let figures = [wake_name(topic), "execution", "cpu", "response", "response_per_slot"].into_iter().chain(input);
        Self {
            topic,
            period_ns: scenario.sample_ns(),
            deadline: scenario.deadline_of(topic as usize),
            figures: figures.map(|name| (name, histogram())).collect(),
            counts: CycleCounts::default(),
            contradictions: 0,
            newest: None,
        }
    }

    /// Takes the stamp of one message in, and the stamp `before` it of the same process, which may have been on standby
    /// then; messages come in the order of sending. Returns `None` for a message whose times cannot be true: it enters
    /// its sender's counts, but no figure.
    pub fn observe(&mut self, stamp: &Stamp, before: &Stamp) -> Option<TimedCycle> {
        let own = self.topic as usize;
        let publish_ns = stamp.publish_ns[own];
        let late = publish_ns.saturating_sub(stamp.sample_ns) > self.deadline.deadline_ns;
        let slips = stamp.slips.saturating_sub(before.slips);
        let misses = stamp.misses.saturating_sub(before.misses);
        let withheld = misses.saturating_sub(slips).saturating_sub(u64::from(late));
        let vacant = match self.newest.replace((stamp.epoch, stamp.tick)) {
            Some((epoch, tick)) if epoch != stamp.epoch => stamp.tick.saturating_sub(tick).saturating_sub(1),
            _ => 0,
        };
        let follows = before.sequence > 0 && stamp.sequence.checked_sub(before.sequence) == Some(1) && withheld == 0;
        let cycle = TimedCycle {
            release_ns: stamp.release_ns,
            start_ns: stamp.start_ns,
            publish_ns,
            free_ns: if follows { before.publish_ns[own] } else { 0 },
            slips,
            withheld,
            silent: slips.saturating_add(withheld).max(vacant).min(LONGEST_STALL_SLOTS),
            cpu_ns: None,
            // The CPU time of a first cycle includes the start-up, and a cycle on standby is none of the flight.
            cpu_before_ns: (follows && before.sequence > 1 && !before.is_standby()).then_some(stamp.cpu_ns),
            solve_ns: 0,
        };
        self.counts.add(&cycle, misses, late);
        // A message is sent after its sample, and after what it was made from.
        let possible =
            publish_ns >= stamp.sample_ns && stamp.publish_ns[..own].iter().all(|input| publish_ns >= *input);
        if !possible {
            self.contradictions += 1;
            return None;
        }
        self.add(&cycle, stamp.sample_ns);
        Some(cycle)
    }

    /// Medians of wake-up and execution \[ns\].
    pub fn usual(&self) -> [u64; 2] {
        [wake_name(self.topic), "execution"].map(|figure| self.figures[figure].value_at_quantile(0.5))
    }

    /// Returns the node's part of the `timing` table of run.json.
    pub fn record(&self) -> NodeRecord {
        let [jitter, hop, execution, cpu, input_age, response, response_per_slot] =
            FIGURES.map(|figure| self.figures.get(figure).map(percentiles));
        let (deadline_ms, policy) = (self.deadline.deadline_ns as f64 / 1e6, self.deadline.late);
        let counts = self.counts;
        NodeRecord { counts, deadline_ms, policy, jitter, hop, execution, cpu, input_age, response, response_per_slot }
    }

    fn add(&mut self, cycle: &TimedCycle, sample_ns: u64) {
        let response_ns = cycle.publish_ns.saturating_sub(sample_ns);
        let mut add = |figure: &str, ns| {
            if let Some(histogram) = self.figures.get_mut(figure) {
                histogram.saturating_record(ns);
            }
        };
        add(wake_name(self.topic), cycle.wake_ns());
        add("execution", cycle.execution_ns());
        add("input_age", cycle.start_ns.saturating_sub(sample_ns));
        add("response", response_ns);
        if let Some(cpu_ns) = cycle.cpu_before_ns {
            add("cpu", cpu_ns);
        }
        // The slot before waited one period longer, the one before that two, ...
        for slots in 0..=cycle.silent {
            add("response_per_slot", response_ns.saturating_add(slots * self.period_ns));
        }
    }
}
