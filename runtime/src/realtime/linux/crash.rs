//! Crashes of this process: access to missing memory, or an abort, for instance because memory has run out.
//!
//! The files of a run are shared. A file that is cut short while it is mapped (SIGBUS), or whose contents another
//! process has changed (SIGSEGV, SIGABRT), can crash a process that uses it. The process prints the reason and ends
//! with the exit code of a lost process; its role handles a crash like any other end. If the launcher crashes, its
//! children die too.

use std::sync::OnceLock;

use contract::exit;
use rustix::process::{Resource, Rlimit};

/// Signals of a crash, each with the message to print.
const CRASHES: [(libc::c_int, &str); 3] = [
    (
        libc::SIGBUS,
        "this process ends (SIGBUS): a file of the run in shared memory, or a library, was cut short while in use\n",
    ),
    (
        libc::SIGSEGV,
        "this process ends (SIGSEGV): its memory or that of the run was damaged, a library in it has a defect, or its \
stack is too small (`ulimit -s`)\n",
    ),
    (
        libc::SIGABRT,
        "this process ends (SIGABRT): it was out of memory (`ulimit -d`, `ulimit -v`), a library in it aborted, or its state \
or that of the run was found damaged\n",
    ),
];

/// Beginning of the message of a crash: `error: `, and the node of this process, if it runs one.
static BEGINNING: OnceLock<String> = OnceLock::new();

/// Lets a crash name `node` as the node of this process.
pub fn name_in_crashes(node: &str) {
    let _ = BEGINNING.set(format!("error: {node}: ")); // a process has one node
}

/// Installs handlers that print the reason when this process crashes.
pub fn tell_of_crashes() {
    for (signal, _) in CRASHES {
        // SAFETY: `sigaction` is plain data, for which zero is valid (no flags, an empty mask). The handler makes a few
        // system calls that are allowed in handlers, and touches nothing else. SA_RESETHAND runs it once. SA_ONSTACK
        // runs it on the stack that the standard library sets aside, in case the thread's own is used up.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = say as *const () as usize;
            action.sa_flags = libc::SA_RESETHAND | libc::SA_ONSTACK;
            // Fails only for a signal number that does not exist.
            libc::sigaction(signal, &raw const action, std::ptr::null_mut());
        }
    }
}

/// Undoes [`tell_of_crashes`]: a crash ends this process by its signal, which the parent sees, and dumps no core.
pub fn die_of_crashes() {
    for (signal, _) in CRASHES {
        // SAFETY: sets the default action of a signal, which no other thread changes. Fails only for a signal
        // that does not exist.
        unsafe { libc::signal(signal, libc::SIG_DFL) };
    }
    // Lowering one's own limit needs no privilege.
    let _ = rustix::process::setrlimit(Resource::Core, Rlimit { current: Some(0), maximum: Some(0) });
}

extern "C" fn say(signal: libc::c_int) {
    let words = CRASHES.iter().find(|(of, _)| *of == signal).map_or("", |(_, words)| words);
    end_at_once(words)
}

/// Prints `words` and ends this process at once as a lost one, without running any more of its code: no destructor, no
/// exit handler. Allowed in a handler of a signal.
pub fn end_at_once(words: &str) -> ! {
    let mut stderr = libc::pollfd { fd: 2, events: libc::POLLOUT, revents: 0 };
    let parts = [BEGINNING.get().map_or("error: ", String::as_str), words];
    let parts = parts.map(|part| libc::iovec { iov_base: part.as_ptr().cast_mut().cast(), iov_len: part.len() });
    // SAFETY: `stderr`, `parts` and the text that they point to live across the calls, and are only read; the calls are
    // allowed in handlers. A stderr that is not writable at this moment is skipped, not waited for. The last call ends
    // the process without running any more of its code.
    unsafe {
        if libc::poll(&raw mut stderr, 1, 0) == 1 {
            libc::writev(2, parts.as_ptr(), parts.len() as libc::c_int);
        }
        libc::_exit(i32::from(exit::PROCESS_LOST))
    }
}
