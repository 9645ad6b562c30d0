//! Checks, before anything is created, that the system provides what a flight through processes needs.

use anyhow::{bail, ensure};
use machine::resources::{FILES_NEEDED, file_size, memory, open_files};
use machine::{Finding, Machine, Severity};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Fails if the limits on stack or memory are so low that the process would crash later; the error says how to raise
/// them.
pub fn check_memory() -> anyhow::Result<()> {
    refuse(&memory(&Machine::this()))
}

/// Fails if this system cannot support a flight at `rate_hz`, and says why. Raises the limit on open files if that is
/// enough.
pub fn check(rate_hz: u32) -> anyhow::Result<()> {
    let machine = Machine::this();
    ensure!(
        machine.path("proc/self").exists(),
        "/proc is not there, where a process finds its own program; mount it, as root: `mount -t proc proc /proc`"
    );
    refuse(&file_size(&machine, rate_hz))?;
    refuse(&open_files(&machine))?;
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    if current.is_some_and(|files| files < FILES_NEEDED) {
        setrlimit(Resource::Nofile, Rlimit { current: Some(FILES_NEEDED), maximum })?;
    }
    Ok(())
}

/// Returns the finding as an error if it is bad.
fn refuse(finding: &Finding) -> anyhow::Result<()> {
    if finding.level == Severity::Bad {
        bail!(finding.line());
    }
    Ok(())
}
