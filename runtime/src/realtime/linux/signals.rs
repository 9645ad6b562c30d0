//! Signal settings that a process inherits: a parent may have blocked or ignored any signal.

/// Resets the signals that a flight depends on, whatever the parent set; call it before any thread is started.
///
/// No signal stays blocked. SIGCHLD gets its default, without which no child can be waited for. SIGXFSZ is ignored, so
/// that a file that reaches the limit of `ulimit -f` causes a write error with its reason.
pub fn reset_signals() {
    // SAFETY: `none` is plain data that lives across both calls, which only change the mask of this thread. Neither
    // disposition is a handler, so that no code of ours runs in a signal.
    unsafe {
        let mut none: libc::sigset_t = std::mem::zeroed();
        // None of these calls can fail with constant arguments.
        libc::sigemptyset(&raw mut none);
        libc::sigprocmask(libc::SIG_SETMASK, &raw const none, std::ptr::null_mut());
        libc::signal(libc::SIGCHLD, libc::SIG_DFL);
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

/// Calls `install` to set handlers, but keeps SIGHUP ignored if it was, which is what `nohup` asks for.
pub fn keep_nohup<T>(install: impl FnOnce() -> T) -> T {
    // SAFETY: `before` is plain data, for which zero is valid, and lives across the call, which only writes to it.
    let ignored = unsafe {
        let mut before: libc::sigaction = std::mem::zeroed();
        libc::sigaction(libc::SIGHUP, std::ptr::null(), &raw mut before) == 0 && before.sa_sigaction == libc::SIG_IGN
    };
    let installed = install();
    if ignored {
        // SAFETY: the disposition is no handler, so that no code of ours runs in the signal.
        unsafe { libc::signal(libc::SIGHUP, libc::SIG_IGN) };
    }
    installed
}
