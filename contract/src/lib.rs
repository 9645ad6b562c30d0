//! Definitions that two processes must agree on, and nothing else.
//!
//! | module | holds |
//! |---|---|
//! | [`message`] | the four messages and TRUTH: fixed layout, plain numbers; [`messages!`] is the table of their fields |
//! | [`actuation`] | speeds of the rotors and angle of the servo |
//! | [`topic`] | the four topics, their publishers and their receivers |
//! | [`stamp`] | provenance and timing of a message: its plant sample, its inputs, its times |
//! | [`guard`], [`integrity`] | the checks of received messages, and their checksum |
//! | [`snapshot`] | memory of a node as plain words, for the process that continues its work |
//! | [`rest`] | the definition of a landed vehicle |
//! | [`delay`] | outputs under way, and the delay after which they act |
//! | [`exit`] | the exit codes of all processes |

pub mod actuation;
pub mod delay;
pub mod exit;
pub mod guard;
pub mod integrity;
pub mod message;
pub mod rest;
pub mod snapshot;
pub mod topic;

pub use message::stamp;
pub use topic::Topic;
