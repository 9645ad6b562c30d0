//! The recorders of a flight: one at a time, and what each of them has written.
//!
//! ```text
//! recorder 1 -> flight.mcap          \
//! recorder 2 -> flight.2.mcap         > joined at the end: flight.mcap
//! ```
//!
//! Who takes over records already when the one before closes its file, so that nothing is missing in between; one that
//! died leaves a file without its last moments, a second at most, and what was sent until the next one records is in no
//! file. A newcomer that dies while the one before still records is not replaced. No node notices any of it.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use contract::Scenario;
use contract::office::Staff;
use contract::realtime::Board;
use contract::scenario::{Swap, SwapNode};

use super::children::Process;
use crate::event::{Event, What};
use crate::log::{self, Count, Record};
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
    /// Who records.
    holder: Option<Writer>,
    /// Who has been started and does not record yet.
    started: Option<Writer>,
    /// The swap that the newest in office came with: whoever comes after it is like it.
    origin: Option<usize>,
    /// The swaps that have begun.
    begun: Vec<usize>,
    deaths: Vec<Instant>,
    given_up: bool,
    /// What the launcher has seen.
    count: Count,
    /// Messages sent, as far as that tells.
    sent: u64,
}

/// A recorder.
#[derive(Clone, Copy)]
struct Writer {
    epoch: u32,
    /// The swap that it comes with.
    swap: Option<usize>,
}

impl Archive {
    /// For a log at `path`; nobody records yet.
    pub fn new(path: &Path) -> Self {
        Self {
            path: path.into(),
            parts: vec![],
            holder: None,
            started: None,
            origin: None,
            begun: vec![],
            deaths: vec![],
            given_up: false,
            count: Count::default(),
            sent: 0,
        }
    }

    /// The next recorder, that of `swap` or one like the last: its epoch, and the file that it is to write.
    pub fn begin(&mut self, swap: Option<usize>) -> (u32, PathBuf) {
        self.begun.extend(swap);
        self.parts.push(None);
        let epoch = self.newest();
        self.started = Some(Writer { epoch, swap: swap.or(self.origin) });
        (epoch, self.part(epoch))
    }

    /// The newest one's epoch.
    pub fn newest(&self) -> u32 {
        self.parts.len() as u32
    }

    /// The program of who has been started.
    pub fn program<'a>(&self, scenario: &'a Scenario) -> Option<&'a str> {
        scenario.swap.get(self.started?.swap?)?.exec.as_deref()
    }

    /// Lets who has been started have the office as soon as it records; the one before closes its file.
    pub fn welcome(&mut self, board: &Board) -> Option<u32> {
        let office = board.archive();
        let Writer { epoch, swap } = self.started.take_if(|started| office.ready.get() == started.epoch)?;
        self.holder = Some(Writer { epoch, swap });
        self.origin = swap;
        office.appoint(0, |_| Staff { holder: epoch, shadow: 0 });
        Some(epoch)
    }

    /// The swap that is to begin at `tick`.
    pub fn due(&self, tick: u64, scenario: &Scenario) -> Option<usize> {
        let is_due = |(i, swap): &(usize, &Swap)| {
            let begins = swap.node == SwapNode::Recorder && tick >= swap.ticks(scenario.sample_s()).from;
            begins && !self.begun.contains(i)
        };
        let due = scenario.swap.iter().enumerate().find(is_due).map(|(i, _)| i);
        due.filter(|_| self.is_settled() && !self.given_up)
    }

    /// Whether a newcomer may come, for the sample after `tick`; why not.
    pub fn may_swap(&self, tick: u64, scenario: &Scenario) -> Result<(), String> {
        if self.given_up {
            return Err("nobody records any more: the recorder died too often".into());
        }
        if self.holder.is_none() || !self.is_settled() || self.due(tick + 1, scenario).is_some() {
            return Err("the recorder has a newcomer already; wait until it has taken over".into());
        }
        Ok(())
    }

    /// Whether nobody is awaited.
    pub fn is_settled(&self) -> bool {
        self.started.is_none()
    }

    /// One has ended in flight; what that comes to, in order.
    pub fn ended(&mut self, epoch: u32, well: bool) -> Vec<What> {
        let is = |writer: &mut Writer| writer.epoch == epoch;
        let (newcomer, holder) = (self.started.take_if(is), self.holder.take_if(is));
        let Some(_) = newcomer.or(holder) else {
            return if well { vec![] } else { vec![What::Died] }; // while it closed its file: another records
        };
        let mut what = vec![What::Died];
        if self.holder.is_some() {
            what.push(What::Rejected);
        } else if self.is_settled() {
            self.deaths.retain(|death| death.elapsed() < WINDOW);
            self.deaths.push(Instant::now());
            self.given_up = self.deaths.len() >= MOST_DEATHS;
            what.extend(self.given_up.then_some(What::GivenUp));
        }
        what
    }

    /// Whether another is to be started in the place of who died.
    pub fn is_vacant(&self) -> bool {
        self.holder.is_none() && self.is_settled() && !self.given_up
    }

    /// Whether nobody records any more.
    pub fn given_up(&self) -> bool {
        self.given_up
    }

    /// Takes one message in that was sent.
    pub fn observe(&mut self, record: &Record) {
        let more = self.count.gap(record).map_or(0, |gap| gap.saturating_add(1));
        self.sent = self.sent.saturating_add(more);
    }

    /// Hears what a recorder that has ended said of its file.
    pub fn take_word(&mut self, process: &mut Process) {
        self.parts[process.epoch as usize - 1] = last_word(process);
    }

    /// All have ended: makes one log of what they have written, and says how it went. The last of them has not been told
    /// of so many of the `events` as are `untold`.
    pub fn close(self, scenario: &Scenario, events: &[Event], untold: usize) -> LogOutcome {
        let word = |writer: Writer| self.parts[writer.epoch as usize - 1].as_ref();
        let unclosed = self.holder.or(self.started).is_some_and(|writer| word(writer).is_none());
        let failed = self.parts.iter().flatten().find_map(|part| part.error.clone());
        let failed = failed.or_else(|| self.given_up.then(|| "nobody was left to record the flight".into()));
        let failed = failed.or_else(|| unclosed.then(|| "the recorder ended before it could close the log".into()));
        if let [only] = self.parts.as_slice() {
            let mut outcome = only.clone().unwrap_or_default();
            outcome.dropped += untold as u64;
            return LogOutcome { error: failed, ..outcome };
        }
        let files: Vec<PathBuf> = (1..=self.newest()).map(|epoch| self.part(epoch)).collect();
        match log::join(&files, scenario, events, self.sent) {
            Ok(outcome) => LogOutcome { error: failed, ..outcome },
            Err(error) => LogOutcome { error: Some(format!("{error:#}")), ..LogOutcome::default() },
        }
    }

    fn part(&self, epoch: u32) -> PathBuf {
        if epoch == 1 { self.path.clone() } else { self.path.with_extension(format!("{epoch}.mcap")) }
    }
}

/// What a recorder that has ended said of its file.
fn last_word(process: &mut Process) -> Option<LogOutcome> {
    let mut text = String::new();
    process.child.stdout.take()?.read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}
