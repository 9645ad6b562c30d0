//! Processes beside a flight that only watch it: the page of `--web`, and `--mavlink`. No process of the flight waits
//! for them, and their failure becomes a reservation of the flight, but does not change its verdict.

use std::io;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

use anyhow::Context;

/// Niceness of a process beside a flight: the ring and the recorder go first.
const NICENESS: i32 = 10;
/// Longest wait after the flight until all processes beside it have ended, and then for each process that was killed.
const END_LIMIT: Duration = Duration::from_secs(5);
/// Time between two looks at a process that is to end.
const LOOK: Duration = Duration::from_millis(5);

/// Process beside a flight. Dropping the value kills the process.
pub struct Beside {
    /// Option of `fly` that asks for the process.
    option: &'static str,
    pub child: Child,
}

impl Beside {
    /// Starts `command` for the `option` of `fly`.
    pub fn start(option: &'static str, command: &mut Command) -> anyhow::Result<Self> {
        let child = command.spawn().with_context(|| format!("cannot start the process of {option}"))?;
        Ok(Self { option, child })
    }

    /// Ends `all`, because their flight is over; returns the failures, in words.
    pub fn finish(all: Vec<Self>) -> Vec<String> {
        let deadline = Instant::now() + END_LIMIT;
        all.into_iter().filter_map(|mut beside| beside.end(deadline)).collect()
    }

    /// Waits for the end of the process until `deadline`; describes its failure, if it failed.
    fn end(&mut self, deadline: Instant) -> Option<String> {
        drop(self.child.stdin.take()); // ends the page's process, which may not have seen the flight
        let option = self.option;
        match self.ended(deadline) {
            Ok(Some(status)) if status.success() => None,
            Ok(Some(status)) => Some(format!("the process of {option} failed ({status})")),
            Ok(None) => Some(format!("the process of {option} did not end and was killed")),
            Err(error) => Some(format!("the process of {option} was lost: {error}")),
        }
    }

    fn ended(&mut self, deadline: Instant) -> io::Result<Option<ExitStatus>> {
        loop {
            let ended = self.child.try_wait()?;
            if ended.is_some() || Instant::now() >= deadline {
                return Ok(ended);
            }
            std::thread::sleep(LOOK);
        }
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        let _ = self.child.kill(); // fails only if the process has ended
        let _ = self.ended(Instant::now() + END_LIMIT); // a process that the kernel keeps is left behind
    }
}

/// Lowers the priority of this thread and of the threads that it starts from now on. The call fails only if the system
/// forbids this, which harms no flight.
pub fn be_nice() {
    let _ = rustix::process::setpriority_process(None, NICENESS);
}
