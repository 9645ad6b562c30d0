//! Campaigns: many flights whose settings a file varies, their verdicts and their statistics.
//!
//! | module | holds |
//! |---|---|
//! | `form` | `campaign.toml` as it is written |
//! | [`file`](mod@file) | the campaign read from its file: the scenario and the values that vary |
//! | `named` | named tables of the file, in its order |
//! | [`schema`] | the JSON Schema of the file |
//! | [`own_controller`] | controllers that the command line adds |
//! | [`variation`] | lists, ranges and distributions of one setting |
//! | [`normal`] | the normal distribution |
//! | [`sampling`] | points in the unit cube: independent, Latin hypercube, Sobol |
//! | [`random_faults`] | faults drawn from the catalogue |
//! | [`plan`] | the table of flights: each a function of campaign and number |
//! | [`row`] | one flight and its verdict, as a row of the table |
//! | [`table`](mod@table) | columns, and Parquet |
//! | `columns` | columns of the outcome of a flight |
//! | [`shard`] | a part of the flights, as a file that is either complete or absent |
//! | [`folder`], [`layout`] | the folder of a campaign, its lock, and the program and campaign of its shards |
//! | [`local`] | flies shards on all cores of this machine |
//! | [`slurm`], `scheduler` | flies shards on a Slurm cluster, and runs the commands of its scheduler |
//! | [`limit`](mod@limit) | the value of a setting up to which a flight passes |
//! | [`observed`] | the searched setting, as measured in a flight in real time |
//! | [`tune`], [`search`] | gains tuned by one procedure, on draws that the campaign does not use |
//! | [`seeds`] | refuses seeds that change nothing |
//! | [`evidence`] | the draws of a campaign, and the copies among its flights |
//! | [`mean`], [`rate`], [`difference`] | 95 % intervals of a mean, of a share, of the difference of two controllers |
//! | [`median`] | 95 % interval of a median |
//! | [`compare`] | metrics in which controllers are compared; `page::differences` has the table |
//! | [`promise`] | what a campaign file promises of its flights; `page::promises` has the verdicts |
//! | [`page`] | `campaign.html` |
//!
//! The table of a campaign is the same bit for bit on one machine or on a cluster: no row depends on another row, a
//! clock or the number of cores.

#![allow(missing_docs)]

mod columns;
pub mod compare;
#[cfg(test)]
mod coverage;
pub mod difference;
pub mod evidence;
pub mod file;
pub mod folder;
mod form;
pub mod layout;
pub mod limit;
pub mod local;
pub mod mean;
pub mod median;
mod named;
pub mod normal;
pub mod observed;
pub mod own_controller;
pub mod page;
pub mod plan;
pub mod promise;
pub mod random_faults;
pub mod rate;
pub mod row;
pub mod sampling;
mod scheduler;
pub mod schema;
pub mod search;
pub mod seeds;
pub mod shard;
pub mod slurm;
pub mod table;
pub mod tune;
pub mod variation;

pub use file::Campaign;
pub use own_controller::OwnController;
pub use plan::{Plan, PlannedFlight};
pub use rate::Rate;
