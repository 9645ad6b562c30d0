//! Outcome of a log: the numbers of records written and lost.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Result of a recorder, printed when it ends.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LogOutcome {
    /// Messages and events written.
    pub records: u64,
    /// Messages and events that were lost before they could be written.
    pub dropped: u64,
    /// Reason why the log ends early, if it does.
    pub error: Option<String>,
}
