//! Control of a stack that flies: a socket in the run's folder, on which its launcher answers.
//!
//! ```text
//! launcher status, swap, inject, clear, stop -- a request, one line of JSON -->    launcher fly
//!                                       <-- the response, one line of JSON --
//! ```
//!
//! The folder lets in nobody but the user who flies. The launcher answers in the loop in which it supervises, one
//! request at a look, and never waits for a guest: one that says nothing is shown out after a second.

mod request;
mod server;

pub use request::{Request, Response, ask};
pub use server::Server;
