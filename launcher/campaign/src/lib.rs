//! Campaigns: many flights that differ in what a file varies, their verdicts, and what they amount to.
//!
//! | module | holds |
//! |---|---|
//! | [`file`](mod@file) | `campaign.toml`: what is flown, what varies |
//! | [`variation`] | lists, ranges and distributions of one setting |
//! | [`normal`] | the normal distribution |
//! | [`sampling`] | points in the unit cube: independent, Latin hypercube, Sobol |
//! | [`random_faults`] | faults drawn from the catalogue |
//! | [`plan`] | the table of flights: each a function of campaign and number |
//! | [`row`] | one flight and its verdict, as a row of the table |
//! | [`table`](mod@table) | columns, and Parquet |
//! | [`shard`] | a part of the flights: a file, whole or not there |
//! | [`folder`], [`layout`] | the folder of a campaign, who may write to it, and of what its shards are |
//! | [`local`] | all cores of this machine |
//! | [`slurm`], `scheduler` | a cluster, and the commands of its scheduler |
//! | [`tune`], [`search`] | gains by one procedure, on draws of their own |
//! | [`seeds`] | refuses seeds that change nothing |
//! | [`evidence`] | the draws of a campaign, and the copies among its flights |
//! | [`mean`], [`rate`], [`difference`] | intervals over draws, of shares and of the difference of two controllers |
//! | [`page`] | `campaign.html` |
//!
//! A campaign's table is the same bit for bit whatever flew it: no row depends on another, on a clock, on the number of
//! cores or on the engine.

#![allow(missing_docs)]

#[cfg(test)]
mod coverage;
pub mod difference;
pub mod evidence;
pub mod file;
pub mod folder;
mod hex;
pub mod layout;
pub mod local;
pub mod mean;
pub mod normal;
pub mod page;
pub mod plan;
pub mod random_faults;
pub mod rate;
pub mod row;
pub mod sampling;
mod scheduler;
pub mod search;
pub mod seeds;
pub mod shard;
pub mod slurm;
pub mod table;
pub mod tune;
pub mod variation;

pub use file::Campaign;
pub use plan::{Flight, Plan};
pub use rate::Rate;
