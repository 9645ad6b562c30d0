//! What a process asks of the kernel: time, priority, locked memory, one shared page, children that die with it.
//!
//! This is the only module with `unsafe`: calls that rustix does not offer in safe form, each with its argument.
//! Everything here is optional for a flight: without privilege the stack runs as `SCHED_OTHER` and says so.

#![expect(
    unsafe_code,
    reason = "sched_setscheduler, mmap, sigaction, sigprocmask, getsockopt and pre_exec; the only unsafe of the stack"
)]

mod board;
mod bus_error;
mod child;
mod clock;
mod peer;
mod signals;

use std::num::NonZeroU64;

use rustix::mm::MlockAllFlags;
use rustix::process::{Resource, Rlimit};
use rustix::thread::CpuSet;

pub use board::{Bell, Board, phase};
pub use bus_error::tell_of_bus_errors;
pub use child::die_with_parent;
pub use clock::{now_ns, thread_cpu_ns, timed};
pub use peer::peer_of;
pub use signals::{keep_nohup, reset_signals};

use crate::scenario::{Policy, Scheduling};

/// Asks for what the scenario wants; takes what it gets. The launcher reads from `/proc` what that was.
///
/// With `SCHED_FIFO` the kernel gives exact timer wake-ups; without it the timer slack is lowered from 50 us to 1 ns.
pub fn enter(wanted: &Scheduling) {
    pin(&wanted.affinity);
    if wanted.rttime_ms > 0.0 {
        // Lowering one's own limit needs no privilege; it counts for SCHED_FIFO only. The signal is SIGXCPU.
        let limit = Some((wanted.rttime_ms * 1e3) as u64);
        let _ = rustix::process::setrlimit(Resource::Rttime, Rlimit { current: limit, maximum: limit });
    }
    let fifo = wanted.policy == Policy::Fifo && set_fifo(wanted.priority as i32);
    if !fifo {
        // Fails only on kernels without the call; the flight then has 50 us more jitter.
        let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
    }
    if wanted.lock_memory {
        // What is mapped now is brought in now. The segment of a process that joins later, tens of megabytes, page by page
        // as it is used: all of it at once would take 35 ms out of the loop that maps it.
        // Without the privilege the memory stays pageable; run.json says how much was locked.
        for flags in [MlockAllFlags::CURRENT, MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT] {
            let _ = rustix::mm::mlockall(flags);
        }
    }
    touch_stack();
}

/// Keeps this process on the given CPUs; where the kernel refuses (a CPU that is not there) it stays where it may be.
fn pin(affinity: &[usize]) {
    if !affinity.is_empty() {
        let mut cpus = CpuSet::new();
        affinity.iter().filter(|cpu| **cpu < CpuSet::MAX_CPU).for_each(|cpu| cpus.set(*cpu));
        let _ = rustix::thread::sched_setaffinity(None, &cpus);
    }
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
