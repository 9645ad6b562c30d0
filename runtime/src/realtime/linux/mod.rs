//! Services of the kernel: priority, locked memory, one shared page, shared pipes, children that die with their parent,
//! copies that end.
//!
//! This is the only module of the stack itself with `unsafe`: calls that rustix does not offer in safe form, each with
//! the reason why it is sound. A flight needs neither priority nor locked memory: without the privilege the stack runs
//! as `SCHED_OTHER` and says so.

#![expect(unsafe_code, reason = "sched_setscheduler, mmap, sigaction, sigprocmask, getsockopt and pre_exec")]

mod child;
mod copies;
mod crash;
mod mapping;
mod peer;
mod signals;
mod word_pipe;

use std::fs::File;
use std::num::NonZeroU64;

use rustix::io::Errno;
use rustix::mm::{MapFlags, MlockAllFlags, ProtFlags, mlockall, mmap_anonymous, munlockall, munmap};
use rustix::process::{Resource, Rlimit, getrlimit};
use rustix::thread::CpuSet;

pub use child::die_with_parent;
pub use copies::{ThisProcess, tell_of_copies};
pub use crash::{die_of_crashes, end_at_once, name_in_crashes, tell_of_crashes};
pub use mapping::{ControlPage, Mapping, Shared};
pub use peer::peer_of;
pub use signals::{keep_nohup, reset_signals};
pub use word_pipe::{Pipes, SharedPipes, WordPipe};

use crate::limits::{FILES_OF_A_CONNECTION, LATER_BYTES};
use settings::{Scheduling, SchedulingPolicy};

/// Asks for the scheduling that the scenario wants, and takes what it gets; the launcher reads the result from `/proc`.
///
/// With `SCHED_FIFO` the kernel gives exact timer wake-ups; without it the timer slack is lowered from 50 us to 1 ns.
pub fn enter(wanted: &Scheduling) {
    pin(&wanted.affinity);
    if wanted.rttime_ms > 0.0 {
        // Lowering one's own limit needs no privilege. Under SCHED_FIFO the kernel kills a process beyond the limit.
        let limit = Some((wanted.rttime_ms * 1e3) as u64);
        let _ = rustix::process::setrlimit(Resource::Rttime, Rlimit { current: limit, maximum: limit });
    }
    let fifo = wanted.policy == SchedulingPolicy::Fifo && set_fifo(wanted.priority as i32);
    if !fifo {
        // Fails only on kernels without the call; the flight then has up to 50 us more jitter.
        let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
    }
    if wanted.lock_memory {
        lock_memory();
    }
    touch_stack();
}

/// Locks the memory of this process, later mappings included, or none of it.
///
/// Present mappings are loaded now, later ones page by page when they are used: loading the whole segment of a process
/// that joins later, tens of megabytes, would take 35 ms out of the loop that maps it. A limit (`RLIMIT_MEMLOCK`) may
/// have no effect at once, but make a later mapping fail, and with it the connection to a publisher. So the memory
/// stays pageable unless there is room for [`LATER_BYTES`] more. run.json says how much was locked.
fn lock_memory() {
    let later = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
    let locked = mlockall(MlockAllFlags::CURRENT).and_then(|()| mlockall(later)).is_ok() && can_map(LATER_BYTES);
    if !locked {
        let _ = munlockall(); // fails only on a kernel without the call
    }
}

/// Returns whether this process may map `bytes` more; none of it is used.
fn can_map(bytes: usize) -> bool {
    // SAFETY: the address is the kernel's choice, so no existing mapping is replaced, and nothing is ever read or
    // written through it; it is unmapped before any other code knows it.
    unsafe {
        let map = mmap_anonymous(std::ptr::null_mut(), bytes, ProtFlags::empty(), MapFlags::PRIVATE);
        map.is_ok_and(|address| munmap(address, bytes).is_ok())
    }
}

/// Describes a shortage of files or memory that keeps this process from mapping files of the run; `None` without one.
pub fn shortage() -> Option<String> {
    let limit = |resource| getrlimit(resource).current.map_or("unlimited".to_owned(), |limit| limit.to_string());
    // A connection needs several files; a failed connection has closed its files again, so several are tried here.
    let files: Vec<_> = (0..FILES_OF_A_CONNECTION).map(|_| File::open("/")).collect();
    let cannot_open = |file: &std::io::Result<File>| {
        file.as_ref().is_err_and(|error| error.raw_os_error() == Some(Errno::MFILE.raw_os_error()))
    };
    if files.iter().any(cannot_open) {
        Some(format!("no more files can be opened (limit {}; raise it: ulimit -n)", limit(Resource::Nofile)))
    } else if !can_map(LATER_BYTES / 8) {
        Some(format!("no more memory can be mapped (limit {} bytes; raise it: ulimit -v)", limit(Resource::As)))
    } else {
        None
    }
}

/// Restricts this process to the given CPUs, if any; no effect if the kernel refuses, as for a CPU that does not exist.
pub fn pin(affinity: &[usize]) {
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

/// Touches the stack that the loop will use, so that no page fault falls into a cycle.
#[inline(never)]
#[expect(clippy::large_stack_arrays, reason = "it is the stack itself that is to be touched")]
fn touch_stack() {
    let stack = [0_u8; 256 * 1024];
    std::hint::black_box(&stack);
}
