//! Who runs a node: one state machine, and three drivers that carry its inputs in and its actions out.
//!
//! | module | holds |
//! |---|---|
//! | [`role`] | the state machine: inputs, actions, policy |
//! | [`supervised`] | a role with the trial of its candidate |
//! | [`trial`], `answer` | whether a candidate does as well as the process before it |
//! | [`process_faults`] | faults of processes as inputs |
//! | [`driver`] | what the drivers of processes have in common |
//! | [`realtime`] | driver: the control page and the clock |
//! | [`simulated`] | driver: the delays that `[supervision]` names; in process uses it as it is |
//! | [`lockstep`] | driver: the same for processes, between two ticks |
//! | [`connections`] | processes that work, and whose messages do not arrive or that receive nothing |

mod answer;
pub mod connections;
pub mod driver;
pub mod lockstep;
pub mod process_faults;
pub mod realtime;
pub mod role;
pub mod simulated;
pub mod supervised;
pub mod trial;
