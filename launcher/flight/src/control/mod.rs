//! Control of a stack that flies: a socket in the run's folder, on which its launcher answers.
//!
//! ```text
//! trefoil status, swap, inject, clear, stop -- a request, one line of JSON -->    trefoil fly
//!                                       <-- the response, one line of JSON --
//! ```
//!
//! The folder is open to the user who flies and to no other. The launcher answers in the loop in which it supervises,
//! one request at a look, and never waits for a client: a client that sends nothing is disconnected after a second.

pub mod server;
pub mod view;

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;

use anyhow::{Context, anyhow};
use runtime::domain::Domain;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use settings::{Fault, FaultTarget, Swap};

use crate::limits::ANSWER_LIMIT;

/// Name of the socket in the run's folder.
const SOCKET: &str = "control";

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ControlRequest {
    /// Asks for the state of the nodes, the faults in force and the last events.
    Status,
    /// Asks for the events of the flight.
    Events {
        /// First event of the answer, counted from 0.
        since: usize,
    },
    /// Replaces a process, beginning now. The answer has the number of the swap, and of the next event.
    Swap(Swap),
    /// Injects a fault, which begins `at_s` after the next sample but one.
    Inject { fault: Fault },
    /// Ends faults; a fault that has not begun never begins.
    Clear {
        /// Target whose faults end; `None` ends all.
        target: Option<FaultTarget>,
    },
    /// Ends the flight, as Ctrl-C does.
    Stop,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Response {
    /// Result of a request that was carried out.
    Ok(Value),
    /// Reason why a request was not carried out.
    Error(String),
}

/// Sends `request` to the launcher of `domain` and waits for the answer, at most `ANSWER_LIMIT`.
pub fn ask(domain: &Domain, request: &ControlRequest) -> anyhow::Result<Value> {
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
