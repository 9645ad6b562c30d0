//! Stand-in for the operating system where there is none, as in WebAssembly: one thread, and no clock.
//!
//! A flight in process needs no more: nothing waits there, and all its times are zero.

use std::io;
use std::ops::Deref;
use std::sync::atomic::AtomicU32;

use super::control_page::Page;

/// Returns 0: there is no clock.
pub fn now_ns() -> u64 {
    0
}

/// Returns 0: there is no clock.
pub fn thread_cpu_ns() -> u64 {
    0
}

/// Returns at once: no other thread could change the word.
pub fn sleep_while(_word: &AtomicU32, _seen: u32, _deadline_ns: u64) {}

/// Wakes no thread: there is no other.
pub fn wake(_word: &AtomicU32) {}

/// Returns `None`: no limit of the system keeps a port from working.
pub fn shortage() -> Option<String> {
    None
}

/// Process in which a value of this type was made: there is only one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ThisProcess;

impl ThisProcess {
    /// Returns the process.
    pub fn now() -> Self {
        Self
    }

    /// Returns at once: there is no copy.
    pub fn leave_if_copied(self) {}
}

/// Control page of a run in process.
pub struct ControlPage(Box<Page>);

impl ControlPage {
    /// Makes the page.
    pub fn private() -> io::Result<Self> {
        Ok(Self(Box::default()))
    }
}

impl Deref for ControlPage {
    type Target = Page;

    fn deref(&self) -> &Page {
        &self.0
    }
}
