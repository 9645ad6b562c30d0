//! What two processes must agree on, and nothing else.
//!
//! | module | holds |
//! |---|---|
//! | [`message`] | the four messages: fixed layout, stamped, plain numbers |
//! | [`topic`] | the four topics and who speaks on each |
//! | [`stamp`] | which plant sample a message descends from, through whom, and when |
//! | [`guard`], [`integrity`] | which messages are taken for true |
//! | [`snapshot`] | what a node remembers, as plain numbers, for the one that continues its work |
//! | [`scenario`] | the run's settings: profiles, file, overrides, checks |
//! | [`roll`] | which faults are at work on a tick |
//! | [`mod@file`] | reading files that come from outside |

pub mod fault_schedule;
pub mod file;
pub mod guard;
pub mod integrity;
pub mod message;
pub mod scenario;
pub mod snapshot;
pub mod stamp;
pub mod topic;

pub use scenario::Scenario;
pub use topic::Topic;
