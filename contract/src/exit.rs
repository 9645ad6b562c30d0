//! Exit codes, of the processes for the launcher that started them, and of the launcher for the user.

/// Flown.
pub const FLOWN: u8 = 0;
/// Flown, but outside the scenario's bounds.
pub const OUT_OF_BOUNDS: u8 = 1;
/// Usage or scenario error.
pub const USAGE: u8 = 2;
/// A process or the log was lost, messages were missed, or the results cannot be written or printed.
pub const PROCESS_LOST: u8 = 3;
/// A node whose deadline has the policy `stop` missed it.
pub const BUDGET_BROKEN: u8 = 4;
/// Interrupted.
pub const INTERRUPTED: u8 = 130;
