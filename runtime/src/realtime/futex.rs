//! Futexes: a process sleeps on a word of shared memory, and another one wakes it.

use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU32, Ordering};

use rustix::io::Errno;
use rustix::thread::futex;

use super::clock::to_timespec;

/// Sleeps while `word` is `seen`, until `deadline_ns` (`CLOCK_MONOTONIC`) at the latest.
pub fn sleep_while(word: &AtomicU32, seen: u32, deadline_ns: u64) {
    let deadline = to_timespec(deadline_ns);
    while word.load(Ordering::Acquire) == seen {
        match futex::wait_bitset(word, futex::Flags::empty(), seen, Some(&deadline), NonZeroU32::MAX) {
            Ok(()) | Err(Errno::AGAIN | Errno::INTR) => {}
            Err(_) => return, // the deadline has passed
        }
    }
}

/// Wakes every process that sleeps on `word`.
pub fn wake(word: &AtomicU32) {
    // Fails only for a bad address, which a mapped page does not have.
    let _ = futex::wake(word, futex::Flags::empty(), i32::MAX as u32);
}
