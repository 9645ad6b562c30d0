//! Exit codes of the processes, which their launcher reads, and of the launcher, which the user reads.

/// Flight complete and inside the scenario's bounds.
pub const FLOWN: u8 = 0;
/// Flight complete, but outside the scenario's bounds.
pub const OUT_OF_BOUNDS: u8 = 1;
/// Usage or scenario error.
pub const USAGE: u8 = 2;
/// Loss of a process, of the log or of messages, or results that cannot be written or printed.
pub const PROCESS_LOST: u8 = 3;
/// Missed deadline of a node with the policy `stop`.
pub const BUDGET_BROKEN: u8 = 4;
/// Interruption by the user.
pub const INTERRUPTED: u8 = 130;
