//! The scenario: every setting of a run, merged from profile, file and command line.
//!
//! Precedence: profile < file < `--set key=value`. [`load`](load()) merges and checks the settings. The merged result
//! is written beside the run, so that a run can be repeated from its folder alone. Degrees appear in files only; cores
//! convert when they are built.
//!
//! | module | holds |
//! |---|---|
//! | `run` | the whole scenario, `[run]`, `[bounds]` |
//! | `timing` | `[realtime]`, `[deadline]` |
//! | `mission` | `[mission]`, `[initial]` |
//! | `part` | `[mission.limits]`, `[[mission.part]]` |
//! | [`plan`] | the curves of these parts |
//! | `vehicle` | `[plant]`; `[airframe]` is [`airframe::Parameters`] |
//! | `sensors` | `[plant.sensors]` |
//! | `control` | `[guidance]`, `[attitude]`, `[mixer]` |
//! | `fault` | `[[fault]]` |
//! | `swap` | `[[swap]]` |
//! | `program` | `[node.NAME]` |
//! | `profile` | every default |
//! | `load`, `shape`, `check`, `report` | merging, the form of a file, ranges, error messages with their place |
//! | [`moved`] | names of earlier versions |
//! | `given` | settings without the defaults, as a base for the flights of a campaign |
//! | `schema` | the JSON Schema of a scenario file, with the ranges |
//! | `words` | words of enums and keys, and the known word nearest to an unknown one |
//! | [`file`](mod@file) | reading files that come from outside |

mod check;
mod control;
mod fault;
pub mod file;
mod given;
mod load;
mod mission;
pub mod moved;
mod part;
pub mod plan;
mod profile;
mod program;
mod report;
mod run;
mod schema;
mod sensors;
mod shape;
mod swap;
#[cfg(test)]
mod tests;
mod timing;
mod vehicle;
mod words;

pub use check::mission_warnings;
pub use control::*;
pub use fault::*;
pub use given::Given;
pub use load::{
    candidate, candidate_from, check_fault, check_sizes, check_swaps, from_merged, load, load_from, load_text, to_toml,
    to_toml_that_follows, weights_that_fit,
};
pub use mission::*;
pub use part::*;
pub use program::{NodeSettings, Nodes, ProgramKind, any_table, find_programs};
pub use report::{ScenarioError, Source};
pub use run::*;
pub use schema::{as_in_toml, schema, schema_of};
pub use sensors::*;
pub use swap::*;
pub use timing::*;
pub use vehicle::*;
pub use words::{nearest, suggest, word};
