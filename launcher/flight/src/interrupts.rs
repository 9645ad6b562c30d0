//! Ctrl-C and its like.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::Context;
use contract::exit;
use runtime::realtime::keep_nohup;

/// Counts Ctrl-C, SIGTERM and SIGHUP: the first stops the flight cleanly, the second kills the processes, the third
/// ends the launcher on the spot (the next flight then wipes what it left in shared memory).
pub fn catch_interrupts() -> anyhow::Result<Arc<AtomicU32>> {
    let count = Arc::new(AtomicU32::new(0));
    let handler = count.clone();
    let interrupt = move || {
        if handler.fetch_add(1, Ordering::Relaxed) >= 2 {
            std::process::exit(i32::from(exit::INTERRUPTED));
        }
    };
    keep_nohup(|| ctrlc::set_handler(interrupt)).context("cannot catch Ctrl-C")?;
    Ok(count)
}
