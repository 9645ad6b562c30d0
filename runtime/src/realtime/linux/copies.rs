//! Copies of this process. Code of users may call `fork` or `daemon` and return in both processes: the copy then goes
//! on in our code, with our ports and pipes, as a second writer. A process that finds itself to be a copy ends.
//!
//! Each process keeps its number on a page that the kernel hands to a copy as zeros, whichever call has made the copy.
//! So the check costs a load from memory and no system call.

use std::ptr::null_mut;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap_anonymous};
use rustix::process::getpid;

use super::crash::end_at_once;

/// Length of the page \[byte\]; the kernel rounds it up to a whole page.
const PAGE_BYTES: usize = size_of::<AtomicU64>();
/// Message that a copy prints before it ends.
const WORDS: &str = "this is a copy that a library or program has made of its process (fork, daemon); only the process \
itself may go on, and the copy ends\n";

/// Function that a copy calls before it ends.
static TOLD: OnceLock<Box<dyn Fn() + Send + Sync>> = OnceLock::new();

/// Process in which a value of this type was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ThisProcess(u64);

impl ThisProcess {
    /// Returns the process that calls.
    pub fn now() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        let Some(word) = word() else { return Self(getpid().as_raw_nonzero().get() as u64) };
        match word.load(Ordering::Relaxed) {
            0 => {
                // A copy goes on counting where its process was, so that no number of the process is used again.
                let own = NEXT.fetch_add(1, Ordering::Relaxed);
                let set = word.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed);
                Self(set.map_or_else(|other| other, |_| own)) // another thread may have been faster
            }
            own => Self(own),
        }
    }

    /// Returns whether the process that calls is this process, and no copy of it.
    pub fn is_this(self) -> bool {
        self == Self::now()
    }

    /// Ends the process that calls if it is a copy: at once, and without any destructor, which would remove files and
    /// ports of the process.
    pub fn leave_if_copied(self) {
        if !self.is_this() {
            TOLD.get().inspect(|tell| tell());
            end_at_once(WORDS);
        }
    }
}

/// Lets a copy of this process call `tell` before it ends; the first call counts.
pub fn tell_of_copies(tell: impl Fn() + Send + Sync + 'static) {
    let _ = TOLD.set(Box::new(tell));
}

/// Returns the word on the page; `None` on kernels before 4.14, which have no such page.
fn word() -> Option<&'static AtomicU64> {
    static WORD: OnceLock<Option<&'static AtomicU64>> = OnceLock::new();
    *WORD.get_or_init(|| {
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: the address is the kernel's choice, so no existing mapping is replaced, and the mapping is never
        // removed. It is aligned to a page and holds the word, for which the zeros of a new page are valid, and those
        // that a copy finds there too. The advice changes nothing for this process.
        unsafe {
            let address = mmap_anonymous(null_mut(), PAGE_BYTES, protection, MapFlags::PRIVATE).ok()?;
            madvise(address, PAGE_BYTES, Advice::LinuxWipeOnFork).ok()?;
            address.cast::<AtomicU64>().as_ref()
        }
    })
}

#[cfg(test)]
mod tests {
    use rustix::process::{Pid, WaitOptions, waitpid};

    use super::*;

    #[test]
    fn a_copy_knows_that_it_is_one_and_the_process_goes_on() {
        let process = ThisProcess::now();
        // SAFETY: the copy makes only calls that are allowed after a fork of a program with threads, and ends.
        let copy = unsafe { libc::fork() };
        if copy == 0 {
            let ended_well = !process.is_this() && ThisProcess::now().is_this();
            // SAFETY: ends the copy without any destructor.
            unsafe { libc::_exit(i32::from(!ended_well)) };
        }
        let (_, status) = waitpid(Pid::from_raw(copy), WaitOptions::empty()).unwrap().unwrap();
        assert_eq!(status.exit_status(), Some(0), "the copy is another process, always the same one");
        assert!(process.is_this());
    }
}
