//! The text of a scenario file: reading it, and messages about it.

pub mod file;
pub mod report;
