//! The recorders of a flight: one at a time, and what each of them has written.
//!
//! ```text
//! recorder 1 -> flight.mcap          \
//! recorder 2 -> flight.2.mcap         > joined at the end: flight.mcap
//! ```
//!
//! Who takes over records already when the one before closes its file, so that nothing is missing in between; one that
//! died leaves a file without its last moments. No node notices either.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use contract::Scenario;
use contract::office::Staff;
use contract::realtime::Board;
use contract::scenario::{Swap, SwapNode};

use super::children::Process;
use crate::event::Event;
use crate::log;
use crate::recorder::LogOutcome;

/// Name of the process.
pub const RECORDER: &str = "recorder";
/// Deaths within `WINDOW` after which nobody records any more.
const MOST_DEATHS: usize = 4;
const WINDOW: Duration = Duration::from_secs(5);

/// The log of a flight, and who writes it.
pub struct Archive {
    path: PathBuf,
    /// What each recorder has said at its end.
    parts: Vec<Option<LogOutcome>>,
    deaths: Vec<Instant>,
    given_up: bool,
    /// How many of the scenario's swaps have begun.
    pub swaps: usize,
}

impl Archive {
    /// For a log at `path`; nobody records yet.
    pub fn new(path: &Path) -> Self {
        Self { path: path.into(), parts: vec![], deaths: vec![], given_up: false, swaps: 0 }
    }

    /// The next recorder: its epoch, and the file that it is to write.
    pub fn next(&mut self) -> (u32, PathBuf) {
        self.parts.push(None);
        let epoch = self.parts.len() as u32;
        (epoch, self.part(epoch))
    }

    /// The newest one's epoch.
    pub fn newest(&self) -> u32 {
        self.parts.len() as u32
    }

    /// The program of the next: that of the newest swap.
    pub fn program<'a>(&self, scenario: &'a Scenario) -> Option<&'a str> {
        let mut swaps = scenario.swap.iter().filter(|swap| swap.node == SwapNode::Recorder);
        self.swaps.checked_sub(1).and_then(|i| swaps.nth(i)).and_then(|swap| swap.exec.as_deref())
    }

    /// Lets the newest one have the office as soon as it records; the others close their files.
    pub fn welcome(&self, board: &Board) -> bool {
        let office = board.archive();
        let welcome = office.ready.get() == self.newest() && office.holder() != self.newest();
        if welcome {
            office.appoint(0, |_| Staff { holder: self.newest(), shadow: 0 });
        }
        welcome
    }

    /// One has ended; true when another is to be started.
    pub fn ended(&mut self, process: &mut Process, well: bool) -> bool {
        self.parts[process.epoch as usize - 1] = last_word(process);
        if well || process.epoch < self.newest() {
            return false;
        }
        self.deaths.retain(|death| death.elapsed() < WINDOW);
        self.deaths.push(Instant::now());
        self.given_up = self.deaths.len() >= MOST_DEATHS;
        !self.given_up
    }

    /// Whether nobody records any more.
    pub fn given_up(&self) -> bool {
        self.given_up
    }

    /// All have ended: makes one log of what they have written, and says how it went.
    pub fn close(self, scenario: &Scenario, events: &[Event]) -> LogOutcome {
        let lost = || LogOutcome {
            error: Some("the recorder ended before it could close the log".into()),
            ..LogOutcome::default()
        };
        if let [only] = self.parts.as_slice() {
            return only.clone().unwrap_or_else(lost);
        }
        let files: Vec<PathBuf> = (1..=self.newest()).map(|epoch| self.part(epoch)).collect();
        let failed = self.parts.iter().flatten().find_map(|part| part.error.clone());
        match log::join(&files, scenario, events) {
            Ok(mut outcome) => {
                outcome.error = failed.or_else(|| self.given_up.then(|| "nobody was left to record the flight".into()));
                outcome
            }
            Err(error) => LogOutcome { error: Some(format!("{error:#}")), ..lost() },
        }
    }

    fn part(&self, epoch: u32) -> PathBuf {
        if epoch == 1 { self.path.clone() } else { self.path.with_extension(format!("{epoch}.mcap")) }
    }
}

/// What a recorder that has ended said of its file.
pub fn last_word(process: &mut Process) -> Option<LogOutcome> {
    let mut text = String::new();
    process.child.stdout.take()?.read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

/// Whether `swap` is of the recorder, and due at `tick`.
pub fn is_due(swap: &Swap, tick: u64, scenario: &Scenario) -> bool {
    swap.node == SwapNode::Recorder && tick >= swap.ticks(scenario.sample_s()).from
}
