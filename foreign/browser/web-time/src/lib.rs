//! A clock that stands still. Where the target is WebAssembly, Clarabel measures its solves by the crate `web-time`.
//! This crate replaces it, so that the module of the page imports nothing, not even a clock.

pub use std::time::Duration;

/// Instant of the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Instant;

impl Instant {
    /// Returns the only instant that there is.
    pub fn now() -> Self {
        Self
    }

    /// Returns zero.
    pub fn elapsed(&self) -> Duration {
        Duration::ZERO
    }
}
