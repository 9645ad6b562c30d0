//! Binding of a child, whatever its program, to its parent: the child does not outlive it.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::Command;

use rustix::io::Errno;
use rustix::process::{Signal, getpid, getppid, set_parent_process_death_signal};

/// Makes the kernel kill the process that `command` starts as soon as the thread that started it has ended.
///
/// The binding survives any `exec`, except of a program with capabilities or a user of its own. Processes that the
/// child starts in turn are not killed.
pub fn die_with_parent(command: &mut Command) {
    let parent = getpid();
    let bind = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // If the parent died before this call, no signal comes any more, and the parent is another process.
        if getppid() == Some(parent) { Ok(()) } else { Err(io::Error::from(Errno::SRCH)) }
    };
    // SAFETY: between fork and exec only functions that are allowed in signal handlers may be called, because another
    // thread may have held any lock. `bind` makes two system calls and takes no lock. It captures a number and
    // allocates nothing: an error made from an error number is a number too.
    unsafe { command.pre_exec(bind) };
}
