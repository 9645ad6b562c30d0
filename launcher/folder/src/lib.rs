//! The folder of a run and its files, and the scenarios that are part of the program.
//!
//! | module | holds |
//! |---|---|
//! | [`run`] | the folder of a run, created before the flight and locked while it flies |
//! | [`dir`], [`files`] | safe access to the files of runs and campaigns |
//! | [`shipped`] | scenarios and campaigns that are part of the program |

#![allow(missing_docs)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod dir;
pub mod files;
pub mod run;
pub mod shipped;
