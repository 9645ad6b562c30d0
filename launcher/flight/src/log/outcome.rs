//! The part of a flight that its log has.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Result of a recorder, printed at its end.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LogOutcome {
    /// Messages and events written.
    pub records: u64,
    /// Messages and events that were lost before they could be written.
    pub dropped: u64,
    /// Reason why the log ends early, if it does.
    pub error: Option<String>,
}
