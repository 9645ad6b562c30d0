//! Crashes: this process has touched memory that is not there, or gives itself up. Without memory it does that too.
//!
//! The files of a run are shared: one that is cut short while it is mapped (SIGBUS), or whose contents another
//! process has changed (SIGSEGV, SIGABRT), can end a process that uses it. The process says why and ends with the exit code of a process
//! that was lost: to the supervisor a crash like any other. With the launcher its children die too.

use contract::exit;

/// The signals, and what a process says that gets one.
const CRASHES: [(libc::c_int, &[u8]); 3] = [
    (
        libc::SIGBUS,
        b"error: a file of the run in shared memory was cut short while this process used it, which ends it (SIGBUS)\n",
    ),
    (libc::SIGSEGV, b"error: memory of this process or of the run was damaged, or its stack is too small (`ulimit -s`), which ends it (SIGSEGV)\n"),
    (libc::SIGABRT, b"error: this process was out of memory (`ulimit -d`, `ulimit -v`), or found its own state or that of the run damaged, \
which ends it (SIGABRT)\n"),
];

/// Has this process say so when it happens.
pub fn tell_of_crashes() {
    for (signal, _) in CRASHES {
        // SAFETY: `sigaction` is plain data, for which zero is valid (no flags, an empty mask); the handler makes a few
        // system calls that are allowed in handlers, and touches nothing else. With SA_RESETHAND it runs once. With
        // SA_ONSTACK it has the stack that the standard library sets aside, for when the thread's own is used up.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = say as *const () as usize;
            action.sa_flags = libc::SA_RESETHAND | libc::SA_ONSTACK;
            // Fails only for a signal number that does not exist.
            libc::sigaction(signal, &raw const action, std::ptr::null_mut());
        }
    }
}

extern "C" fn say(signal: libc::c_int) {
    for (of, words) in CRASHES {
        if of == signal {
            let mut stderr = libc::pollfd { fd: 2, events: libc::POLLOUT, revents: 0 };
            // SAFETY: `stderr` and the bytes, which are a constant, live across the calls; both calls are allowed in handlers.
            // Stderr that takes nothing at this moment is not waited for.
            unsafe {
                if libc::poll(&raw mut stderr, 1, 0) == 1 {
                    libc::write(2, words.as_ptr().cast(), words.len());
                }
            }
        }
    }
    // SAFETY: ends the process at once, without running anything of it.
    unsafe { libc::_exit(i32::from(exit::PROCESS_LOST)) };
}
