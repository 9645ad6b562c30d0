//! Checks of what a flight through processes needs of the system, made before anything is created.

use std::path::Path;

use crate::limits::{FILES_NEEDED, MEMORY_NEEDED, STACK_NEEDED};
use anyhow::{bail, ensure};
use runtime::port::bytes_needed;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Fails if the limits on stack or memory are so low that the process would crash on its way; says how to raise them.
pub fn check_memory() -> anyhow::Result<()> {
    for (resource, needed, what, raise) in [
        (Resource::Stack, STACK_NEEDED, "stack", "ulimit -s"),
        (Resource::Data, MEMORY_NEEDED, "data", "ulimit -d"),
        (Resource::As, MEMORY_NEEDED, "address space", "ulimit -v"),
    ] {
        if let Some(most) = getrlimit(resource).current.filter(|most| *most < needed) {
            let [most_kb, needed_kb] = [most, needed].map(|bytes| bytes / 1024);
            bail!("a process may have {most_kb} kB of {what} here, and needs {needed_kb}; raise the limit (`{raise}`)");
        }
    }
    Ok(())
}

/// Fails if a flight at `rate_hz` cannot go well here, and says why. Raises the limit on open files if that is enough.
pub fn check(rate_hz: u32) -> anyhow::Result<()> {
    ensure!(
        Path::new("/proc/self").exists(),
        "/proc is not there, where a process finds its own program; mount it, as root: `mount -t proc proc /proc`"
    );
    let segment_bytes = bytes_needed(rate_hz) / 4; // the largest takes a sixth
    if let Some(most) = getrlimit(Resource::Fsize).current.filter(|most| *most < segment_bytes) {
        bail!(
            "a file may have {most} bytes here, and a flight shares files of up to {segment_bytes}; raise the limit (`ulimit -f`), \
or fly with --mode inprocess"
        );
    }
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    if current.is_some_and(|files| files < FILES_NEEDED) {
        if let Some(most) = maximum.filter(|most| *most < FILES_NEEDED) {
            bail!(
                "a process may have {most} files open here, and a flight needs {FILES_NEEDED}; raise the limit (`ulimit -Hn`), \
or fly with --mode inprocess"
            );
        }
        setrlimit(Resource::Nofile, Rlimit { current: Some(FILES_NEEDED), maximum })?;
    }
    Ok(())
}
