//! `[realtime]`, `[deadline]` and `[supervision]`: scheduling of the nodes, their deadlines, and their restarts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Scheduling of all nodes, `[realtime]`; `[node.NAME]` overrides it for one node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Realtime {
    /// Scheduling class to ask for; without the privilege the stack runs as `other` and says so.
    pub policy: SchedulingPolicy,
    /// `SCHED_FIFO` priority of the plant; each node downstream has a priority one higher than the node before it. At
    /// most 95: the mixer then has 98, and the kernel needs the highest.
    pub priority: u32,
    /// CPUs that the nodes may run on. Empty = all of them in real time. In lockstep, where one node works at a time,
    /// empty = one CPU for all nodes, which the launcher chooses.
    pub affinity: Vec<usize>,
    /// `true` to lock the memory of the processes.
    pub lock_memory: bool,
    /// CPU time after which the kernel kills a `SCHED_FIFO` process that never slept \[ms\]; 0 = unlimited.
    pub rttime_ms: f64,
}

/// Scheduling that one process asks the kernel for.
#[derive(Debug, Clone, PartialEq)]
pub struct Scheduling {
    /// Scheduling class.
    pub policy: SchedulingPolicy,
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
pub enum SchedulingPolicy {
    /// `SCHED_FIFO`, priorities rising downstream.
    Fifo,
    /// `SCHED_OTHER`.
    Other,
}

/// Deadlines of the nodes' messages, counted from the plant's sample, `[deadline]`; `[node.NAME]` overrides them for
/// one node. Deadlines hold in real time only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Deadline {
    /// Deadline of the whole chain \[ms\]; absent = the period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end_to_end_ms: Option<f64>,
    /// Treatment of late messages.
    pub late: Late,
}

/// Treatment of a message that missed its deadline, `deadline.late`. Every policy counts the miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Late {
    /// Sends the message late.
    Send,
    /// Withholds the message: the nodes downstream keep the previous message.
    Skip,
    /// Sends the last timely message again in its place; the late message if there was no timely message.
    Hold,
    /// Sends the message late, and does less in the next cycle: attitude-mpc then projects instead of solving.
    Degrade,
    /// Ends the run.
    Stop,
}

/// Rules for failure and restart of processes, `[supervision]`, the same in every mode. In lockstep and in process no
/// clock runs: the end of a process is seen after 2 ms, and a process is ready `start_ms` after its start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Supervision {
    /// Time without an answer after which an active process counts as hung, if it missed three samples too; the plant
    /// counts as hung after 500 ms at the earliest \[ms\].
    pub hang_ms: f64,
    /// Delays before the first, second, ... restart within 5 s \[ms\]; at one failure more the node is given up.
    pub restart_ms: Vec<f64>,
    /// Longest time from the start of a process to when it is ready \[s\]; a process that takes longer counts as hung.
    pub start_limit_s: f64,
    /// Time from the start of a process to when it is ready, in lockstep and in process \[ms\].
    pub start_ms: f64,
    /// Wall-clock time without progress after which a run in lockstep ends \[s\]; 0 = never. Time in which a debugger
    /// holds one of its processes does not count.
    pub wall_limit_s: f64,
}

impl Default for Supervision {
    /// Returns the defaults; `start_ms` is a median measured by `trefoil measure faults`.
    fn default() -> Self {
        Self {
            hang_ms: 20.0,
            restart_ms: vec![0.0, 50.0, 100.0],
            start_limit_s: 1.0,
            start_ms: 25.0,
            wall_limit_s: 30.0,
        }
    }
}

/// Deadline of one node's messages, and treatment of late messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeDeadline {
    /// Latest publication after the sample \[ns\].
    pub deadline_ns: u64,
    /// Treatment of a later message.
    pub late: Late,
}
