//! `[realtime]` and `[deadline]`: what each node asks of the kernel, and when its work is due.

use serde::{Deserialize, Serialize};

/// `[realtime]`: what every node asks for; a table of its own, `[realtime.mixer]` say, overrides it for one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Realtime {
    /// Scheduling class asked for; without the privilege the stack runs as `other` and says so.
    pub policy: Policy,
    /// `SCHED_FIFO` priority of the plant; every node downstream has one more than the one before it.
    pub priority: u32,
    /// CPUs it may run on. Empty = all against the clock; in lockstep, whose ring is sequential, one for all nodes, which
    /// the launcher chooses.
    pub affinity: Vec<usize>,
    /// Lock the process's memory.
    pub lock_memory: bool,
    /// CPU time a `SCHED_FIFO` process may use without sleeping \[ms\], 0 = unlimited: a runaway loop then dies.
    pub rttime_ms: f64,
    /// `[realtime.plant]`
    pub plant: NodeRealtime,
    /// `[realtime.guidance]`
    pub guidance: NodeRealtime,
    /// `[realtime.attitude-mpc]`
    #[serde(rename = "attitude-mpc")]
    pub attitude_mpc: NodeRealtime,
    /// `[realtime.mixer]`
    pub mixer: NodeRealtime,
}

/// `[realtime.<node>]`: what one node asks for in place of what all do.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "as in `Realtime`, but the priority is this node's own")]
pub struct NodeRealtime {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub policy: Option<Policy>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub priority: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub affinity: Option<Vec<usize>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lock_memory: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rttime_ms: Option<f64>,
}

/// What one process asks of the kernel.
#[derive(Debug, Clone, PartialEq)]
pub struct Scheduling {
    /// Scheduling class.
    pub policy: Policy,
    /// `SCHED_FIFO` priority, 1 to 99.
    pub priority: u32,
    /// CPUs; empty = all.
    pub affinity: Vec<usize>,
    /// Lock the memory.
    pub lock_memory: bool,
    /// CPU time without sleeping \[ms\], 0 = unlimited.
    pub rttime_ms: f64,
}

/// `realtime.policy`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Policy {
    /// `SCHED_FIFO`, priorities rising downstream.
    Fifo,
    /// `SCHED_OTHER`.
    Other,
}

/// `[deadline]`: when each node's message is due, counted from the plant's sample. In force in real time only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Deadline {
    /// Of the whole chain \[ms\]; absent = the period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_to_end_ms: Option<f64>,
    /// \[ms\]; absent = 20 % of the whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant_ms: Option<f64>,
    /// \[ms\]; absent = 40 % of the whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guidance_ms: Option<f64>,
    /// \[ms\]; absent = 80 % of the whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_mpc_ms: Option<f64>,
    /// \[ms\]; absent = the whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mixer_ms: Option<f64>,
    /// What becomes of a late message.
    pub policy: Late,
    /// The same for one node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant_policy: Option<Late>,
    /// The same for one node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guidance_policy: Option<Late>,
    /// The same for one node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_mpc_policy: Option<Late>,
    /// The same for one node.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mixer_policy: Option<Late>,
}

/// `deadline.policy`: what becomes of a message that missed its deadline. All of them count the miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Late {
    /// It is sent, late.
    Send,
    /// It is not sent: those downstream keep what they have.
    Skip,
    /// The last timely message is sent again in its place.
    Hold,
    /// It is sent, and the next cycle does less: attitude-mpc then projects instead of solving.
    Degrade,
    /// The run ends.
    Stop,
}

/// `[supervision]`: when a process counts as failed, and when another is started. The same in every mode; what a clock shows
/// takes as long as `detect_ms` and `start_ms` say where there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Supervision {
    /// An active process that has answered to none of so many samples hangs,
    pub hang_ticks: u64,
    /// if it has not answered for this time either \[ms\].
    pub hang_ms: f64,
    /// Waits before the first, second, ... new start within the window \[ms\]; one failure more, and the node is given up.
    pub restart_ms: Vec<f64>,
    /// In which failures are counted together \[s\].
    pub window_s: f64,
    /// A process that is not ready by then hangs \[s\].
    pub start_limit_s: f64,
    /// Without a clock: from the end of a process to when it is seen \[ms\].
    pub detect_ms: f64,
    /// Without a clock: from the start of a process to when it is ready \[ms\].
    pub start_ms: f64,
    /// In lockstep: a ring that has not moved for this time on the wall clock ends the run \[s\]; 0 = never. While a
    /// debugger has one of its processes the time does not pass.
    pub wall_limit_s: f64,
}

impl Default for Supervision {
    /// The delays are the medians that `launcher measure faults` saw.
    fn default() -> Self {
        Self {
            hang_ticks: 3,
            hang_ms: 20.0,
            restart_ms: vec![0.0, 50.0, 100.0],
            window_s: 5.0,
            start_limit_s: 1.0,
            detect_ms: 2.0,
            start_ms: 25.0,
            wall_limit_s: 30.0,
        }
    }
}

/// When one node's message is due, and what becomes of a late one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeDeadline {
    /// Latest publication after the sample \[ns\].
    pub deadline_ns: u64,
    /// What becomes of a later one.
    pub late: Late,
}

impl Realtime {
    /// What the node of this `rank` in the ring asks for, 0 (plant) to 3 (mixer).
    pub fn of(&self, rank: usize) -> Scheduling {
        let own = [&self.plant, &self.guidance, &self.attitude_mpc, &self.mixer][rank].clone();
        Scheduling {
            policy: own.policy.unwrap_or(self.policy),
            priority: own.priority.unwrap_or(self.priority + rank as u32),
            affinity: own.affinity.unwrap_or_else(|| self.affinity.clone()),
            lock_memory: own.lock_memory.unwrap_or(self.lock_memory),
            rttime_ms: own.rttime_ms.unwrap_or(self.rttime_ms),
        }
    }
}

impl Deadline {
    /// That of the node of this `rank` in the ring, 0 (plant) to 3 (mixer), at a sample time \[s\].
    pub fn of(&self, rank: usize, sample_s: f64) -> NodeDeadline {
        let whole_ms = self.end_to_end_ms.unwrap_or(sample_s * 1e3);
        let own_ms = [self.plant_ms, self.guidance_ms, self.attitude_mpc_ms, self.mixer_ms][rank];
        let due_ms = own_ms.unwrap_or(whole_ms * [0.2, 0.4, 0.8, 1.0][rank]);
        let late = [self.plant_policy, self.guidance_policy, self.attitude_mpc_policy, self.mixer_policy][rank];
        NodeDeadline { deadline_ns: (due_ms * 1e6).round() as u64, late: late.unwrap_or(self.policy) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    #[test]
    fn priorities_rise_downstream_and_a_node_has_its_own_say() {
        let mut realtime = Scenario::default().realtime;
        assert_eq!([0, 1, 2, 3].map(|rank| realtime.of(rank).priority), [70, 71, 72, 73]);
        realtime.mixer = NodeRealtime { priority: Some(40), affinity: Some(vec![1]), ..NodeRealtime::default() };
        realtime.affinity = vec![0];
        let [guidance, mixer] = [1, 3].map(|rank| realtime.of(rank));
        assert_eq!((guidance.priority, guidance.affinity), (71, vec![0]));
        assert_eq!((mixer.priority, mixer.affinity, mixer.policy), (40, vec![1], Policy::Fifo));
    }

    #[test]
    fn budgets_are_shares_of_the_whole_which_is_the_period() {
        let mut scenario = Scenario::default();
        let due = |scenario: &Scenario| [0, 1, 2, 3].map(|rank| scenario.deadline_of(rank).deadline_ns);
        assert_eq!(due(&scenario), [2_000_000, 4_000_000, 8_000_000, 10_000_000]);
        scenario.run.rate_hz = 1000;
        assert_eq!(due(&scenario), [200_000, 400_000, 800_000, 1_000_000]);
        scenario.deadline.end_to_end_ms = Some(5.0);
        scenario.deadline.guidance_ms = Some(1.5);
        assert_eq!(due(&scenario), [1_000_000, 1_500_000, 4_000_000, 5_000_000]);
        scenario.deadline.attitude_mpc_policy = Some(Late::Degrade);
        assert_eq!([1, 2].map(|rank| scenario.deadline_of(rank).late), [Late::Send, Late::Degrade]);
    }
}
