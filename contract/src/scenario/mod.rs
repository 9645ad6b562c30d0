//! The scenario: every setting of a run, merged from profile, file and command line.
//!
//! Precedence: profile < file < `--set key=value`. [`load`](load()) merges and checks; the merged result is
//! written beside the run, so that a run can be repeated from its folder alone. Degrees appear in files only; cores
//! convert when they are built.

mod check;
mod load;
mod profile;
mod report;
mod sections;
mod shape;
#[cfg(test)]
mod tests;

pub use load::{from_merged, load, to_toml};
pub use report::ScenarioError;
pub use sections::*;
