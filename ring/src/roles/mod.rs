//! Roles: one state machine decides which process runs a node; drivers carry its inputs in and its actions out.
//!
//! | module | holds |
//! |---|---|
//! | [`role`] | the state machine: inputs, actions, policy |
//! | [`supervised`] | a role with the trial of its candidate |
//! | [`trial`], `answer` | comparison of a candidate with the process before it |
//! | [`process_faults`] | faults of processes, as inputs of their roles |
//! | [`simulated`] | driver without a clock: delays from `[supervision]` |

mod answer;
pub mod process_faults;
pub mod role;
pub mod simulated;
pub mod supervised;
pub mod trial;

use contract::topic::Topic;

/// Action to carry out for the node that publishes on a topic.
pub type Order = (Topic, role::Action);
