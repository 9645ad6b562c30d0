//! Looks: what a flight came to, from its messages and events.
//!
//! | module | holds |
//! |---|---|
//! | [`summary`], [`timing`] | what a flight amounts to: metrics, state hash, cycle timing |
//! | [`solves`], [`faults`] | what the solver did, and what came of the scenario's faults |
//! | [`bounds`] | what a flight must stay inside of |
//! | [`happenings`] | what is known to have happened in a flight, for its timing, trace and report |
//! | [`run_record`] | `run.json` |
//! | [`report`] | `report.html` |
//! | [`trace`] | `trace`: ticks of a run for a trace viewer |

pub mod bounds;
pub mod faults;
pub mod happenings;
pub mod report;
pub mod run_record;
pub mod solves;
pub mod summary;
pub mod timing;
pub mod trace;
