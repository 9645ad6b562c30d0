//! SIGBUS: somebody has cut a file short that this process has mapped, and it has touched what is missing.
//!
//! What was there is gone, so the process says why and dies of the signal: a crash like any other to the supervisor. With
//! the launcher its children die too, and the next launcher wipes what is left.

/// What a dying process says.
const WORDS: &[u8] =
    b"error: a file of the run in shared memory was cut short while this process used it, which ends it (SIGBUS)\n";

/// Has this process say so when it happens.
pub fn tell_of_bus_errors() {
    // SAFETY: `sigaction` is plain data, for which zero is valid (no flags, an empty mask); the handler makes one system
    // call that is allowed in handlers, and touches nothing else. With SA_RESETHAND it runs once: the access that failed
    // is tried again, and the default ends the process.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = say as *const () as usize;
        action.sa_flags = libc::SA_RESETHAND;
        // Fails only for a signal number that does not exist.
        libc::sigaction(libc::SIGBUS, &raw const action, std::ptr::null_mut());
    }
}

extern "C" fn say(_signal: libc::c_int) {
    // SAFETY: the bytes are a constant, which lives as long as the program.
    unsafe { libc::write(2, WORDS.as_ptr().cast(), WORDS.len()) };
}
