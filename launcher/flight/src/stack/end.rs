//! Ends of a flight through processes, and failures to start such a flight.

use std::process::ExitStatus;

use contract::exit;
use contract::guard::Refusal;
use serde_json::{Value, json};

/// Reason why a stack did not come up, or could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A process ended or hung before all had joined.
    #[error("the stack did not come up: {0}")]
    Lost(String),
    /// A process that the measurement needs ended or hung in flight.
    #[error("a flight to measure was lost: {0}")]
    LostInFlight(String),
    #[error("interrupted while the stack was starting")]
    Interrupted,
}

impl StartError {
    /// Exit code of a launcher that could not start its stack.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Lost(_) | Self::LostInFlight(_) => exit::PROCESS_LOST,
            Self::Interrupted => exit::INTERRUPTED,
        }
    }
}

pub enum ChildExit {
    Well,
    /// The process broke its timing budget.
    Late,
    Badly(ExitStatus),
}

impl ChildExit {
    pub fn of(status: ExitStatus) -> Self {
        match status.code() {
            Some(0) => Self::Well,
            Some(code) if code == i32::from(exit::BUDGET_BROKEN) => Self::Late,
            _ => Self::Badly(status),
        }
    }

    /// Names the process and how it ended, for people.
    pub fn tell(&self, name: &str) -> String {
        match self {
            Self::Well => format!("{name} (ended its process with exit code 0)"),
            Self::Late => name.into(),
            Self::Badly(how) => format!("{name} ({how})"),
        }
    }

    /// Rank by which exits are reported, the highest first.
    pub fn gravity(&self) -> u8 {
        match self {
            Self::Well => 0,
            Self::Late => 1,
            Self::Badly(_) => 2,
        }
    }
}

/// Converts counts of refused messages to a JSON object, by cause.
pub fn refused(counts: &[u32; Refusal::ALL.len()]) -> Value {
    Refusal::ALL.iter().zip(counts).map(|(refusal, count)| (refusal.name().to_owned(), json!(count))).collect()
}
