//! The ring without an operating system: the four nodes in one thread, the roles that decide which process runs a node,
//! and the messages and events that an observer gets. The ring runs on every target of Rust, also in a browser.
//!
//! | module | holds |
//! |---|---|
//! | [`stepped`] | the ring in one thread, flown part by part of a tick |
//! | [`workers`] | stand-ins for the processes of one node |
//! | [`nodes`] | the stack's own cores |
//! | [`roles`] | the state machine that decides which process runs a node, and its driver without a clock |
//! | [`observers`], [`record`], [`count`] | every message, and gaps between them |
//! | [`memory`] | snapshots of the nodes |
//! | [`event`] | events of the processes |
//! | [`ended`] | ends of a flight |
//! | [`samples`] | STATE and TRUTH of a tick, joined |
//! | [`states`] | measures of the samples: their hash, the position error |
//! | `limits` | every limit |
//!
//! Flights are bit-identical to lockstep, because the same cores get the same messages in the same order through the
//! same inputs and outputs, under the same roles. Nothing here reads a clock: the only times in stamps are the
//! simulated instant of the sample and the delays by faults.

#![allow(missing_docs)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod count;
pub mod ended;
pub mod event;
mod limits;
pub mod memory;
pub mod nodes;
pub mod observers;
pub mod record;
pub mod roles;
pub mod samples;
pub mod states;
pub mod stepped;
pub mod workers;
