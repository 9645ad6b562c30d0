//! Result of a flight: metrics, verdict, timing and costs; and a recorded flight read back.
//!
//! | module | holds |
//! |---|---|
//! | [`summary`], [`in_air`], [`metrics`], [`timing`], [`following`] | what is gathered of a flight, message by message |
//! | [`ticks`] | the messages of a tick, joined |
//! | [`cold_starts`] | processes restarted without the memory of the one before |
//! | [`solves`], [`faults`] | counts and times of the solver, and the effect of each fault |
//! | [`bounds`], [`judge`] | limits that a flight must keep, and its verdict |
//! | [`happenings`] | faults, absences and events as spans and marks on the time axis |
//! | [`run_record`], [`recorded`] | `run.json`, and a run read back from its folder |
//! | [`terminal`] | what `fly` prints at its end |
//! | [`target`] | a promised figure, and whether it was met |
//! | [`percentiles`] | percentiles and medians, for everything that measures |

#![allow(missing_docs)]

pub mod bounds;
pub mod cold_starts;
pub mod faults;
pub mod following;
pub mod happenings;
pub mod in_air;
pub mod judge;
pub mod metrics;
pub mod percentiles;
pub mod recorded;
pub mod run_record;
pub mod solves;
pub mod summary;
pub mod target;
pub mod terminal;
pub mod ticks;
pub mod timing;
