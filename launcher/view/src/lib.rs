//! Looks: what a flight came to, from its messages and events.
//!
//! | module | holds |
//! |---|---|
//! | [`summary`], [`metrics`], [`timing`] | what a flight amounts to: metrics, state hash, cycle timing |
//! | [`ticks`] | the join of the four messages of a tick, used by everything below and by `measure` |
//! | [`solves`], [`faults`] | what the solver did, and what came of the scenario's faults |
//! | [`bounds`] | what a flight must stay inside of |
//! | [`comparison`] | several flights side by side |
//! | [`settings`] | what differs between the settings of flights |
//! | [`explain`] | what each late, lost or missing message cost |
//! | [`table`] | tables as aligned text and as HTML |
//! | [`thinning`] | long series made as short as a picture can show |
//! | [`draw`] | HTML and pictures, for every page |
//! | [`percentiles`] | percentiles and medians, for everything that measures |
//! | [`happenings`] | what is known to have happened in a flight, for its timing, trace and report |
//! | [`run_record`] | `run.json` |
//! | [`recorded`] | a run as it left its folder, and what of its log is missing |
//! | [`report`] | `report.html` |
//! | [`trace`] | `trace`: ticks of a run for a trace viewer |
//! | [`verdict`] | whether a replay is the same flight: the sentence and the exit code |

#![allow(missing_docs)]

pub mod bounds;
pub mod comparison;
pub mod draw;
pub mod explain;
pub mod faults;
pub mod following;
pub mod happenings;
pub mod metrics;
pub mod percentiles;
pub mod recorded;
pub mod report;
pub mod run_record;
pub mod settings;
pub mod solves;
pub mod summary;
pub mod table;
pub mod thinning;
pub mod ticks;
pub mod timing;
pub mod trace;
pub mod verdict;
