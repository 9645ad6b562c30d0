//! Handling of Ctrl-C, SIGTERM and SIGHUP.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;

use anyhow::Context;
use contract::exit;
use runtime::console;
use runtime::realtime::keep_nohup;

/// Last line of the program, set by [`end_at_once`]: the next signal prints it and ends the program on the spot.
static LAST_WORDS: Mutex<Option<String>> = Mutex::new(None);

/// Counts Ctrl-C, SIGTERM and SIGHUP: the first stops the flight cleanly, the second kills the processes, the third
/// ends the launcher on the spot (the next flight then removes its files from shared memory). Returns the count.
pub fn catch_interrupts() -> anyhow::Result<Arc<AtomicU32>> {
    thread::Builder::new().spawn(|| ()).with_context(no_thread)?; // tried first, as the error below gives no reason
    let count = Arc::new(AtomicU32::new(0));
    let handler = count.clone();
    let interrupt = move || {
        let words = LAST_WORDS.lock().ok().and_then(|mut words| words.take());
        if let Some(words) = &words {
            console::eprint_line(words);
            console::finish(exit::INTERRUPTED); // the process ends here, so `main` does not do it
        }
        if words.is_some() || handler.fetch_add(1, Ordering::Relaxed) >= 2 {
            std::process::exit(i32::from(exit::INTERRUPTED));
        }
    };
    keep_nohup(|| ctrlc::set_handler(interrupt)).context("cannot catch Ctrl-C")?;
    Ok(count)
}

/// Makes the next signal print `words` and end the program on the spot. Call it when nothing is left that must end
/// cleanly: files are written completely or not at all.
pub fn end_at_once(words: String) {
    if let Ok(mut last) = LAST_WORDS.lock() {
        *last = Some(words);
    }
}

/// Describes what may keep a thread from being started, and what to do.
fn no_thread() -> String {
    let stack = match std::env::var_os("RUST_MIN_STACK") {
        Some(bytes) => {
            format!("unset RUST_MIN_STACK, which asks for a stack of {} bytes, or ", bytes.to_string_lossy())
        }
        None => String::new(),
    };
    format!("cannot start a thread: {stack}allow more processes (`ulimit -u`) or memory (`ulimit -v`, `ulimit -d`)")
}
