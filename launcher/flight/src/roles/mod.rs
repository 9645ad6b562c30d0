//! Roles: one state machine decides which process runs a node; three drivers carry its inputs in and its actions out.
//!
//! | module | holds |
//! |---|---|
//! | [`role`] | the state machine: inputs, actions, policy |
//! | [`supervised`] | a role with the trial of its candidate |
//! | [`trial`], `answer` | comparison of a candidate with the process before it |
//! | [`process_faults`] | faults of processes, as inputs of their roles |
//! | [`driver`] | trait of the drivers of processes |
//! | [`realtime`] | driver in real time: inputs from the control page and the clock |
//! | [`simulated`] | driver without a clock: delays from `[supervision]`; in process uses it directly |
//! | [`lockstep`] | driver of processes in lockstep: `simulated`, run between two ticks |
//! | [`connections`] | finds processes that work and are cut off: nothing of them arrives, or they receive nothing |

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
