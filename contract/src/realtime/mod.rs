//! What a process asks of the kernel: time, priority, locked memory, one shared page.
//!
//! This is the only module with `unsafe`: two calls that rustix does not offer in safe form, each with its argument.
//! Everything here is optional for a flight: without privilege the stack runs as `SCHED_OTHER` and says so.

#![expect(unsafe_code, reason = "sched_setscheduler and mmap; the only unsafe of the stack")]

mod board;
mod clock;

use std::num::NonZeroU64;

use rustix::mm::MlockAllFlags;

pub use board::{Bell, Board, phase};
pub use clock::{now_ns, thread_cpu_ns, timed};

use crate::scenario::{Policy, Realtime};

/// Asks for what the scenario wants; takes what it gets. The launcher reads from `/proc` what that was.
///
/// With `SCHED_FIFO` the kernel gives exact timer wake-ups; without it the timer slack is lowered from 50 us to 1 ns.
pub fn enter(wanted: &Realtime, priority: i32) {
    let fifo = wanted.policy == Policy::Fifo && set_fifo(priority);
    if !fifo {
        // Fails only on kernels without the call; the flight then has 50 us more jitter.
        let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
    }
    let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE;
    if wanted.lock_memory {
        // Without the privilege the memory stays pageable; run.json says how much was locked.
        let _ = rustix::mm::mlockall(flags);
    }
    touch_stack();
}

fn set_fifo(priority: i32) -> bool {
    let param = libc::sched_param { sched_priority: priority };
    // SAFETY: `param` lives across the call, which only reads it; pid 0 is the calling thread. The call changes how
    // this thread is scheduled and touches no memory of ours.
    unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const param) == 0 }
}

/// Faults in the stack that the loop will use, so that no page fault falls into a cycle.
#[inline(never)]
#[expect(clippy::large_stack_arrays, reason = "it is the stack itself that is to be touched")]
fn touch_stack() {
    let stack = [0_u8; 256 * 1024];
    std::hint::black_box(&stack);
}
