//! The scenario: every setting of a run, merged from profile, file and command line.
//!
//! Precedence: profile < file < `--set key=value`. [`load`](load::load) merges and checks; the merged result is
//! written beside the run, so that a run can be repeated from its folder alone. Degrees appear in files only; cores
//! convert when they are built.

mod check;
mod load;
mod profile;
mod sections;

pub use load::{ScenarioError, from_merged, load, to_toml};
pub use sections::*;
