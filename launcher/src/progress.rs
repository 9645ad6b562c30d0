//! The line shown while flying, on a terminal only. A thread draws it, so that a terminal that was stopped holds up no
//! flight.

use std::cell::Cell;
use std::io::{IsTerminal, stderr};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use runtime::console::plain;

/// How often the line changes.
const PERIOD: Duration = Duration::from_millis(100);
/// How long the end of a flight waits until the line is cleared.
const CLEARING: Duration = Duration::from_millis(200);

/// The line.
pub struct Progress {
    /// `None` where it is not shown.
    thread: Option<Thread>,
    due: Cell<Instant>,
}

struct Thread {
    lines: SyncSender<String>,
    /// Closed when the line is cleared.
    cleared: Receiver<()>,
}

impl Progress {
    /// Begins with an empty line.
    pub fn start() -> Self {
        let thread = if stderr().is_terminal() { Thread::start() } else { None };
        Self { thread, due: Cell::new(Instant::now()) }
    }

    /// Shows what `line` says, when it is time to.
    pub fn show(&self, line: impl FnOnce() -> String) {
        let Some(thread) = self.thread.as_ref().filter(|_| Instant::now() >= self.due.get()) else { return };
        let _ = thread.lines.try_send(plain(&line()).into_owned()); // full when the terminal is slow
        self.due.set(Instant::now() + PERIOD);
    }

    /// Clears the line.
    pub fn finish(self) {
        let Some(Thread { lines, cleared }) = self.thread else { return };
        drop(lines);
        let _ = cleared.recv_timeout(CLEARING); // too late: the terminal was stopped
    }
}

impl Thread {
    fn start() -> Option<Self> {
        let (lines, shown) = sync_channel(1);
        let (done, cleared) = sync_channel::<()>(0);
        let draw = move || {
            draw(&shown);
            drop(done);
        };
        thread::Builder::new().name("progress".into()).spawn(draw).ok().map(|_| Self { lines, cleared })
    }
}

fn draw(lines: &Receiver<String>) {
    let bar = ProgressBar::new_spinner();
    bar.set_style(ProgressStyle::with_template("{spinner} {msg}").expect("the template is a constant"));
    for line in lines {
        bar.set_message(line);
        bar.tick();
    }
    bar.finish_and_clear();
}
