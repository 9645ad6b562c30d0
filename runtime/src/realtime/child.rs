//! A child that does not outlive its parent, whatever program it is.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::Command;

use rustix::io::Errno;
use rustix::process::{Signal, getpid, getppid, set_parent_process_death_signal};

/// Has the kernel kill what `command` starts as soon as the thread that started it is no more.
///
/// It holds for that process, whatever it becomes by `exec`, but for a program that has capabilities or a user of its own.
/// A process that it starts in turn is not killed.
pub fn die_with_parent(command: &mut Command) {
    let parent = getpid();
    let bind = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // A parent that died before that sends no signal any more: then the parent is another.
        if getppid() == Some(parent) { Ok(()) } else { Err(io::Error::from(Errno::SRCH)) }
    };
    // SAFETY: between fork and exec only that may be called which is allowed in signal handlers, for another thread may
    // have held any lock. `bind` makes two system calls and takes no lock; it captures a number and allocates nothing,
    // for an error by its number is a number too.
    unsafe { command.pre_exec(bind) };
}
