//! Stack, memory, open files and shared memory: without them a flight cannot begin.

use runtime::domain::check_room;
use runtime::port::bytes_needed;
use rustix::fs::statvfs;

use crate::finding::{Finding, Severity};
use crate::sources::{Machine, ResourceLimit};

/// Smallest limit on open files. The launcher and the recorder have about fifty files open, and four more for every
/// replaced process whose files in shared memory are not removed yet.
pub const FILES_NEEDED: u64 = 128;
/// Smallest stack of the main thread \[bytes\]: a node touches a quarter of it before its loop.
const STACK_NEEDED: u64 = 1 << 20;
/// Smallest limit on the memory of a process \[bytes\]; a flight in one process needs half of this.
const MEMORY_NEEDED: u64 = 64 << 20;
const MEGABYTE: u64 = 1 << 20;

/// Checks the limits on stack and memory, which every process of the launcher needs. The finding names the first limit
/// that is too low.
pub fn memory(machine: &Machine) -> Finding {
    let mut found = vec![];
    for (name, needed, what, raise) in [
        ("Max stack size", STACK_NEEDED, "stack", "ulimit -s"),
        ("Max data size", MEMORY_NEEDED, "data", "ulimit -d"),
        ("Max address space", MEMORY_NEEDED, "address space", "ulimit -v"),
    ] {
        let Some(limit) = machine.limit(name) else { return unreadable() };
        if let Some(most) = limit.soft.filter(|most| *most < needed) {
            let [most_kb, needed_kb] = [most, needed].map(|bytes| bytes / 1024);
            let found = format!("a process may have {most_kb} kB of {what} here");
            return Finding::new(Severity::Bad, found, format!("it needs {needed_kb}"))
                .remedy(format!("raise the limit (`{raise}`)"));
        }
        let most = limit.soft.map_or("unlimited".to_owned(), |most| format!("{} MB", most / MEGABYTE));
        found.push(format!("{what} {most}"));
    }
    Finding::new(Severity::Ok, found.join(", "), "")
}

/// Checks the limit on open files. The launcher raises the limit in force, at most to the hard limit.
pub fn open_files(machine: &Machine) -> Finding {
    let Some(ResourceLimit { soft, hard }) = machine.limit("Max open files") else {
        return unreadable();
    };
    if let Some(most) = hard.filter(|most| *most < FILES_NEEDED) {
        let found = format!("a process may have {most} files open here");
        return Finding::new(Severity::Bad, found, format!("a flight needs {FILES_NEEDED}"))
            .remedy("raise the limit (`ulimit -Hn`), or fly with --mode inprocess");
    }
    let most = soft.map_or("unlimited".to_owned(), |most| most.max(FILES_NEEDED).to_string());
    Finding::new(Severity::Ok, format!("{most} per process, {FILES_NEEDED} needed"), "")
}

/// Checks the limit on the size of a file, which applies to files in shared memory too, for a flight at `rate_hz`.
pub fn file_size(machine: &Machine, rate_hz: u32) -> Finding {
    let segment_bytes = bytes_needed(rate_hz) / 4; // the largest segment takes a sixth of them
    let Some(limit) = machine.limit("Max file size") else {
        return unreadable();
    };
    match limit.soft.filter(|most| *most < segment_bytes) {
        Some(most) => {
            let means = format!("a flight shares files of up to {segment_bytes}");
            Finding::new(Severity::Bad, format!("a file may have {most} bytes here"), means)
                .remedy("raise the limit (`ulimit -f`), or fly with --mode inprocess")
        }
        None => Finding::new(Severity::Ok, "large enough", ""),
    }
}

/// Checks that shared memory has room for a flight at `rate_hz`.
pub fn shared_memory(machine: &Machine, rate_hz: u32) -> Finding {
    let folder = machine.path("dev/shm");
    let Ok(stat) = statvfs(&folder) else {
        return Finding::new(Severity::Bad, "/dev/shm cannot be read", "a flight through processes needs it")
            .remedy("sudo mount -t tmpfs -o size=256M,mode=1777 none /dev/shm");
    };
    let [size_mb, free_mb] = [stat.f_blocks, stat.f_bavail].map(|blocks| blocks * stat.f_frsize / MEGABYTE);
    let needed = bytes_needed(rate_hz);
    match check_room(&folder, needed) {
        Ok(()) => {
            let needed_mb = needed.div_ceil(MEGABYTE);
            Finding::new(Severity::Ok, format!("{free_mb} of {size_mb} MB free, {needed_mb} MB needed"), "")
        }
        Err(error) => Finding::new(Severity::Bad, format!("{free_mb} of {size_mb} MB free"), error.to_string()),
    }
}

fn unreadable() -> Finding {
    Finding::new(Severity::Unknown, "/proc/self/limits cannot be read", "").remedy("sudo mount -t proc proc /proc")
}
