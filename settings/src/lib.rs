//! The scenario: every setting of a run, merged from profile, file and command line.
//!
//! Precedence: profile < file < `--set key=value`. [`load`](load()) merges and checks the settings. The merged result
//! is written beside the run, so that a run can be repeated from its folder alone. Degrees appear in files only; cores
//! convert when they are built.
//!
//! | module | holds |
//! |---|---|
//! | `table` | the tables of a scenario, one file each, and `profile`: every default |
//! | [`plan`] | the curves of the parts of a mission |
//! | [`fault_schedule`] | which faults are active on a tick |
//! | `load`, `check` | merging; ranges, settings that must fit each other or have no effect |
//! | `shape` | the form of a scenario file |
//! | `text` | error messages with their place, reading [files](mod@file) that come from outside |
//! | [`moved`] | names of earlier versions |
//! | `given` | settings without the defaults, as a base for the flights of a campaign |
//! | `schema` | the JSON Schema of a scenario file, with the ranges |
//! | `words` | words of enums and keys, and the known word nearest to an unknown word |

mod check;
pub mod fault_schedule;
mod given;
mod load;
pub mod moved;
pub mod plan;
mod schema;
mod shape;
mod table;
#[cfg(test)]
mod tests;
mod text;
mod words;

pub use check::parts::warnings as mission_warnings;
pub use given::Given;
pub use load::{
    candidate, candidate_from, check_fault, check_sizes, check_swaps, from_merged, load, load_from, load_text, to_toml,
    to_toml_that_follows, weights_that_fit,
};
pub use schema::{as_in_toml, schema, schema_of};
pub use table::control::*;
pub use table::fault::*;
pub use table::mission::*;
pub use table::part::*;
pub use table::program::{NodeSettings, Nodes, ProgramKind, any_table, find_programs};
pub use table::run::*;
pub use table::sensors::*;
pub use table::swap::*;
pub use table::timing::*;
pub use table::vehicle::*;
pub use text::file;
pub use text::report::{ScenarioError, SettingsText};
pub use words::{nearest, suggest, word};
