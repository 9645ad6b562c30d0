//! Facts of a flight that stand in no message.

use ring::ended::{Ended, Refused};
use ring::stepped;
use runtime::error::PortFailure;

use crate::event::Event;
use crate::log::LogOutcome;

/// Port failures of each node and of the launcher, by cause.
pub type PortFailures = Vec<(&'static str, [u32; PortFailure::ALL.len()])>;

/// Facts of a flight that stand in no message.
#[derive(Debug)]
pub struct Circumstances {
    pub ended: Ended,
    /// Outcome of the recorder, if there was one.
    pub log: Option<LogOutcome>,
    pub events: Vec<Event>,
    /// Number of refused messages, by listener and cause.
    pub refused: Refused,
    /// Failures of ports, by node.
    pub port_failures: PortFailures,
    /// Failures of processes that only watched the flight, in words: they become reservations and never change the
    /// verdict.
    pub observers: Vec<String>,
}

impl From<stepped::SteppedResult> for Circumstances {
    /// Circumstances of a flight without a log.
    fn from(stepped::SteppedResult { ended, events, refused, .. }: stepped::SteppedResult) -> Self {
        Self { ended, log: None, events, refused, port_failures: vec![], observers: vec![] }
    }
}
