//! The progress line, shown on a terminal only. A thread draws it, so that a stopped terminal does not hold up a
//! flight.

use std::cell::Cell;
use std::io::{IsTerminal, stderr};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use runtime::console::plain;

/// Shortest time between two changes of the line.
const PERIOD: Duration = Duration::from_millis(100);
/// Longest wait at the end of a flight until the line is cleared.
const CLEARING: Duration = Duration::from_millis(200);

/// Progress line of a command.
pub struct ProgressLine {
    /// `None` if the line is not shown.
    thread: Option<Thread>,
    due: Cell<Instant>,
}

struct Thread {
    lines: SyncSender<String>,
    /// Closed when the line is cleared.
    cleared: Receiver<()>,
}

impl ProgressLine {
    /// Begins with an empty line; shows none if stderr is no terminal.
    pub fn start() -> Self {
        let thread = if stderr().is_terminal() { Thread::start() } else { None };
        Self { thread, due: Cell::new(Instant::now()) }
    }

    /// Shows the text of `line`, unless the line has changed less than `PERIOD` ago.
    pub fn show(&self, line: impl FnOnce() -> String) {
        let Some(thread) = self.thread.as_ref().filter(|_| Instant::now() >= self.due.get()) else { return };
        let _ = thread.lines.try_send(plain(&line()).into_owned()); // fails if the terminal is slow
        self.due.set(Instant::now() + PERIOD);
    }

    /// Clears the line.
    pub fn finish(self) {
        let Some(Thread { lines, cleared }) = self.thread else { return };
        drop(lines);
        let _ = cleared.recv_timeout(CLEARING); // times out if the terminal is stopped
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
