//! `[realtime]`, `[deadline]` and `[supervision]`: scheduling of the nodes, their deadlines, and their restarts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Scheduling of all nodes, `[realtime]`; a node's own table, for instance `[realtime.mixer]`, overrides it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Realtime {
    /// Scheduling class to ask for; without the privilege the stack runs as `other` and says so.
    pub policy: Policy,
    /// `SCHED_FIFO` priority of the plant; each node downstream has a priority one higher than the node before it. 95
    /// is the highest, because the kernel needs those above.
    pub priority: u32,
    /// CPUs that the nodes may run on. Empty = all of them in real time. In lockstep, where one node works at a time,
    /// empty = one CPU for all nodes, which the launcher chooses.
    pub affinity: Vec<usize>,
    /// `true` to lock the memory of the processes.
    pub lock_memory: bool,
    /// CPU time after which the kernel kills a `SCHED_FIFO` process that never slept \[ms\]; 0 = unlimited.
    pub rttime_ms: f64,
    /// Overrides for the plant, `[realtime.plant]`.
    pub plant: NodeRealtime,
    /// Overrides for guidance, `[realtime.guidance]`.
    pub guidance: NodeRealtime,
    /// Overrides for attitude-mpc, `[realtime.attitude-mpc]`.
    #[serde(rename = "attitude-mpc")]
    pub attitude_mpc: NodeRealtime,
    /// Overrides for the mixer, `[realtime.mixer]`.
    pub mixer: NodeRealtime,
}

/// Scheduling of one node, `[realtime.<node>]`, in place of that of all nodes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NodeRealtime {
    /// Scheduling class of this node; absent = `realtime.policy`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub policy: Option<Policy>,
    /// `SCHED_FIFO` priority of this node; absent = that of its place in the ring, from `realtime.priority` on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub priority: Option<u32>,
    /// CPUs that this node may run on; absent = `realtime.affinity`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub affinity: Option<Vec<usize>>,
    /// `true` to lock the memory of this node's process; absent = `realtime.lock_memory`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lock_memory: Option<bool>,
    /// CPU time after which the kernel kills this node's process if it never slept \[ms\]; absent =
    /// `realtime.rttime_ms`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rttime_ms: Option<f64>,
}

/// Scheduling that one process asks the kernel for.
#[derive(Debug, Clone, PartialEq)]
pub struct Scheduling {
    /// Scheduling class.
    pub policy: Policy,
    /// `SCHED_FIFO` priority, 1 to 99.
    pub priority: u32,
    /// CPUs; empty = all.
    pub affinity: Vec<usize>,
    /// `true` to lock the memory.
    pub lock_memory: bool,
    /// Longest CPU time without sleeping \[ms\], 0 = unlimited.
    pub rttime_ms: f64,
}

/// Scheduling class, `realtime.policy`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Policy {
    /// `SCHED_FIFO`, priorities rising downstream.
    Fifo,
    /// `SCHED_OTHER`.
    Other,
}

/// Deadlines of the nodes' messages, counted from the plant's sample, `[deadline]`. In force in real time only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Deadline {
    /// Deadline of the whole chain \[ms\]; absent = the period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_to_end_ms: Option<f64>,
    /// Deadline of STATE \[ms\]; absent = 20 % of the whole chain's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant_ms: Option<f64>,
    /// Deadline of REFERENCE \[ms\]; absent = 40 % of the whole chain's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guidance_ms: Option<f64>,
    /// Deadline of CONTROLS \[ms\]; absent = 80 % of the whole chain's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_mpc_ms: Option<f64>,
    /// Deadline of ACTUATORS \[ms\]; absent = the whole chain's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mixer_ms: Option<f64>,
    /// Treatment of late messages.
    pub policy: Late,
    /// Treatment of a late STATE; absent = `policy`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant_policy: Option<Late>,
    /// Treatment of a late REFERENCE; absent = `policy`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guidance_policy: Option<Late>,
    /// Treatment of late CONTROLS; absent = `policy`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_mpc_policy: Option<Late>,
    /// Treatment of late ACTUATORS; absent = `policy`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mixer_policy: Option<Late>,
}

/// Treatment of a message that missed its deadline, `deadline.policy`. Every policy counts the miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Late {
    /// Sends the message late.
    Send,
    /// Withholds the message: the nodes downstream keep the previous one.
    Skip,
    /// Sends the last timely message again in its place; the late one if there was none.
    Hold,
    /// Sends the message late, and does less in the next cycle: attitude-mpc then projects instead of solving.
    Degrade,
    /// Ends the run.
    Stop,
}

/// Rules for failure and restart of processes, `[supervision]`, the same in every mode. In lockstep and in process no
/// clock runs, and `detect_ms` and `start_ms` stand for the times that it would show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Supervision {
    /// Samples in a row without an answer after which an active process counts as hung, if `hang_ms` has passed too.
    pub hang_ticks: u64,
    /// Time without an answer after which an active process counts as hung, if it missed `hang_ticks` samples too
    /// \[ms\].
    pub hang_ms: f64,
    /// Delays before the first, second, ... restart within the window \[ms\]; at one failure more the node is given up.
    pub restart_ms: Vec<f64>,
    /// Window in which failures are counted together \[s\].
    pub window_s: f64,
    /// Longest time from the start of a process to when it is ready \[s\]; after that it counts as hung.
    pub start_limit_s: f64,
    /// Time from the end of a process to its detection, in lockstep and in process \[ms\].
    pub detect_ms: f64,
    /// Time from the start of a process to when it is ready, in lockstep and in process \[ms\].
    pub start_ms: f64,
    /// Wall-clock time without progress after which a run in lockstep ends \[s\]; 0 = never. Time in which a debugger
    /// holds one of its processes does not count.
    pub wall_limit_s: f64,
}

impl Default for Supervision {
    /// Returns the defaults; `detect_ms` and `start_ms` are medians measured by `trefoil measure faults`.
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

/// Deadline of one node's messages, and treatment of late ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeDeadline {
    /// Latest publication after the sample \[ns\].
    pub deadline_ns: u64,
    /// Treatment of a later one.
    pub late: Late,
}

impl Realtime {
    /// Scheduling of the node at place `rank` in the ring, 0 (plant) to 3 (mixer).
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
    /// Deadline of the node at place `rank` in the ring, 0 (plant) to 3 (mixer), at a sample time \[s\].
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
    fn priorities_rise_downstream_and_a_node_s_own_table_overrides() {
        let mut realtime = Scenario::default().realtime;
        assert_eq!([0, 1, 2, 3].map(|rank| realtime.of(rank).priority), [70, 71, 72, 73]);
        realtime.mixer = NodeRealtime { priority: Some(40), affinity: Some(vec![1]), ..NodeRealtime::default() };
        realtime.affinity = vec![0];
        let [guidance, mixer] = [1, 3].map(|rank| realtime.of(rank));
        assert_eq!((guidance.priority, guidance.affinity), (71, vec![0]));
        assert_eq!((mixer.priority, mixer.affinity, mixer.policy), (40, vec![1], Policy::Fifo));
    }

    #[test]
    fn deadlines_default_to_shares_of_the_chain_and_the_chain_to_the_period() {
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
