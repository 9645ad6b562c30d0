//! Limits of the roles and the events, except those that `[supervision]` sets.

use runtime::limits::OBSERVER_S;

/// Time without a sample after which the plant counts as hung, if `supervision.hang_ms` is not longer \[ns\].
pub const PLANT_HANG_NS: u64 = 500_000_000;
/// Smallest start limit of a recorder: a disk may be slow \[ns\].
pub const RECORDER_START_NS: u64 = 3_000_000_000;
/// Time without progress after which a recorder counts as hung \[ns\]: its queues then begin to lose messages.
pub const RECORDER_HANG_NS: u64 = OBSERVER_S as u64 * 1_000_000_000;
/// Longest reason of an event \[characters\]. Longer ones are cut, so that the line of the event fits into the pipe.
pub const REASON_CHARS: usize = 500;
