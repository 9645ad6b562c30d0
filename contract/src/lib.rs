//! Definitions that two processes must agree on, and nothing else.
//!
//! | module | holds |
//! |---|---|
//! | [`message`] | the four messages and TRUTH: fixed layout, plain numbers; [`messages!`] is the table of their fields |
//! | [`topic`] | the four topics, their publishers and their receivers |
//! | [`stamp`] | provenance and timing of a message: its plant sample, its inputs, its times |
//! | [`guard`], [`integrity`] | which messages are accepted |
//! | [`snapshot`] | memory of a node as plain words, for the process that continues its work |
//! | [`rest`] | when a vehicle has landed |
//! | [`delay`] | outputs under way, and when they act |
//! | [`scenario`] | the run's settings: profiles, file, overrides, checks |
//! | [`fault_schedule`] | which faults are active on a tick |
//! | [`exit`] | the exit codes of all processes |

pub mod delay;
pub mod exit;
pub mod fault_schedule;
pub mod guard;
pub mod integrity;
pub mod message;
pub mod rest;
pub mod scenario;
pub mod snapshot;
pub mod topic;

pub use message::stamp;
pub use scenario::Scenario;
pub use topic::Topic;
