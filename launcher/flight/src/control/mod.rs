//! Control of a stack that flies: a socket in the run's folder, on which its launcher answers.
//!
//! ```text
//! launcher status, swap, inject, clear, stop -- a request, one line of JSON -->    launcher fly
//!                                       <-- the response, one line of JSON --
//! ```
//!
//! Only the user who flies can enter the folder. The launcher answers in the loop in which it supervises, one
//! request at a look, and never waits for a client: one that sends nothing is sent away after a second.

pub mod server;

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;

use anyhow::{Context, anyhow};
use contract::scenario::{Fault, FaultTarget, Swap};
use runtime::domain::Domain;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::limits::ANSWER_LIMIT;

/// The socket's name in the run's folder.
const SOCKET: &str = "control";

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    /// How the nodes are, what is broken, what happened last.
    Status,
    /// What has happened to the processes.
    Events {
        /// From this event on, counted from 0.
        since: usize,
    },
    /// Replace a process, beginning now. The answer has the number of the swap, and of the next event.
    Swap(Swap),
    /// This fault is to happen; it begins `at_s` after the next sample.
    Inject { fault: Fault },
    /// Faults are to end, and those that have not begun are not to.
    Clear {
        /// Those of what; of everything, when absent.
        target: Option<FaultTarget>,
    },
    /// The flight is to end, as by Ctrl-C.
    Stop,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Response {
    /// It is done, and this is what came of it.
    Ok(Value),
    /// It is not done, and why.
    Error(String),
}

/// Asks the launcher of `domain` and waits for what it says.
pub fn ask(domain: &Domain, request: &Request) -> anyhow::Result<Value> {
    let silent =
        || format!("the launcher of '{}' does not answer: its stack is starting or ending", domain.namespace());
    let mut stream = UnixStream::connect(domain.file(SOCKET)).with_context(silent)?;
    stream.set_read_timeout(Some(ANSWER_LIMIT))?;
    stream.write_all((serde_json::to_string(request)? + "\n").as_bytes()).with_context(silent)?;
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line).with_context(silent)?;
    match serde_json::from_str(&line).with_context(silent)? {
        Response::Ok(value) => Ok(value),
        Response::Error(why) => Err(anyhow!(why)),
    }
}
