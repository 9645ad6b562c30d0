//! Clocks of the kernel. Times that cross processes are `CLOCK_MONOTONIC`, which all processes of a machine share.

use rustix::thread::ClockId;
use rustix::time::{Timespec, clock_gettime};

/// Reads `CLOCK_MONOTONIC` \[ns\].
pub fn now_ns() -> u64 {
    to_ns(clock_gettime(ClockId::Monotonic))
}

/// Reads the CPU time that this thread has used \[ns\].
pub fn thread_cpu_ns() -> u64 {
    to_ns(clock_gettime(ClockId::ThreadCPUTime))
}

fn to_ns(t: Timespec) -> u64 {
    t.tv_sec as u64 * 1_000_000_000 + t.tv_nsec as u64
}

pub(super) fn to_timespec(ns: u64) -> Timespec {
    Timespec { tv_sec: (ns / 1_000_000_000) as i64, tv_nsec: (ns % 1_000_000_000) as i64 }
}
