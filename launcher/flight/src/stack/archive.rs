//! The log of a flight: what each of its recorders has written, and at the end one file of it.
//!
//! ```text
//! recorder 1 -> flight.mcap          \
//! recorder 2 -> flight.2.mcap         > joined at the end: flight.mcap
//! ```
//!
//! Who takes over records already when the one before closes its file, so that nothing is missing in between; one that
//! died leaves a file without its last moments. No node notices either.

use std::collections::BTreeMap;
use std::io::Read;
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};

use contract::Scenario;

use super::supervise::RECORDER;
use crate::event::{self, Event};
use crate::log::{self, Count, Record};
use crate::recorder::LogOutcome;
use crate::roles::role::{Policy, Role};

/// No last word is longer \[bytes\]: what a pipe holds.
const LONGEST_WORD: u64 = 65_536;

/// The log of a flight, and who writes it.
pub struct Archive {
    /// Who writes it.
    pub role: Role,
    /// Which of the swaps have begun.
    pub begun: Vec<bool>,
    path: PathBuf,
    /// What each recorder that had the role has said at its end.
    words: BTreeMap<u32, LogOutcome>,
    /// What the launcher has seen of the messages.
    count: Count,
    /// Messages sent, as far as that tells.
    sent: u64,
}

impl Archive {
    /// For a log at `path`.
    pub fn new(path: &Path, scenario: &Scenario) -> Self {
        Self {
            role: Role::new(RECORDER, Policy::recorder(&scenario.supervision)),
            begun: vec![],
            path: path.into(),
            words: BTreeMap::new(),
            count: Count::default(),
            sent: 0,
        }
    }

    /// The file that the recorder `epoch` is to write.
    pub fn part(&self, epoch: u32) -> PathBuf {
        log::part(&self.path, epoch)
    }

    /// Takes one message in that was sent.
    pub fn observe(&mut self, record: &Record) {
        let more = self.count.gap(record).map_or(0, |gap| gap.saturating_add(1));
        self.sent = self.sent.saturating_add(more);
    }

    /// Keeps what the recorder `epoch`, which has ended, has said on `stdout`.
    pub fn keep(&mut self, epoch: u32, stdout: impl Read + AsFd) {
        self.words.extend(last_word(stdout).map(|word| (epoch, word)));
    }

    /// All have ended, the recorder `active` active: makes one log of what they have written, and says how it went.
    /// `untold` of the `events` did not reach a recorder; the processes have sent so many messages.
    pub fn close(mut self, active: u32, scenario: &Scenario, events: &[Event], untold: usize, sent: u64) -> LogOutcome {
        let why = if self.role.given_up() {
            "nobody was left to record the flight"
        } else {
            "the recorder ended before it could close the log"
        };
        let lost = || LogOutcome { error: Some(why.into()), ..LogOutcome::default() };
        let last = self.words.remove(&active).unwrap_or_else(lost);
        if self.role.newest() == 1 {
            // What never reached it leaves no gap that it could have counted.
            let missing = (sent + events.len() as u64).saturating_sub(last.records);
            return LogOutcome { dropped: missing.max(last.dropped + untold as u64), ..last };
        }
        let files: Vec<PathBuf> = (1..=self.role.newest()).map(|epoch| self.part(epoch)).collect();
        let failed = last.error.or_else(|| self.words.into_values().find_map(|word| word.error));
        match log::join(&files, scenario, events, self.sent) {
            Ok(outcome) => LogOutcome { error: failed, ..outcome },
            Err(error) => LogOutcome { error: Some(format!("{error:#}")), ..LogOutcome::default() },
        }
    }
}

/// What a recorder that has ended said of its file. Others may still hold the pipe: nobody waits for them.
fn last_word(stdout: impl Read + AsFd) -> Option<LogOutcome> {
    event::never_wait(&stdout).ok()?;
    let mut text = vec![];
    let _ = stdout.take(LONGEST_WORD).read_to_end(&mut text); // an error where the end of the pipe is not to be seen
    serde_json::from_slice(&text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::What;
    use crate::log::LogWriter;
    use crate::roles::role::{Input, Now};
    use rustix::pipe::{PipeFlags, pipe_with};
    use std::fs::File;

    /// The end of a pipe into which one has said its last word; the other end too, which somebody else still has.
    fn said(outcome: &LogOutcome) -> (File, File) {
        let (hears, speaks) = pipe_with(PipeFlags::CLOEXEC).unwrap();
        rustix::io::write(&speaks, &serde_json::to_vec(outcome).unwrap()).unwrap();
        (hears.into(), speaks.into())
    }

    fn archive(path: &Path, newest: u32) -> Archive {
        let mut archive = Archive::new(path, &Scenario::default());
        for epoch in 1..=newest {
            LogWriter::create(&archive.part(epoch), "", 10_000_000).unwrap().finish().unwrap();
            let (hears, _speaks) = said(&LogOutcome { records: 7, ..LogOutcome::default() });
            archive.keep(epoch, hears);
        }
        for swap in 1..newest as usize {
            archive.role.on(Now { ns: 0, tick: 0 }, Input::SwapRequested(swap));
        }
        archive
    }

    #[test]
    fn nobody_waits_for_the_end_of_a_last_word() {
        let outcome = LogOutcome { records: 7, dropped: 1, ..LogOutcome::default() };
        let (hears, _speaks) = said(&outcome);
        assert_eq!(last_word(hears), Some(outcome));
    }

    #[test]
    fn events_that_nobody_was_told_of_are_missing_unless_the_log_is_joined() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.mcap");
        let events = [Event::new(1, "mixer", 1, What::Died)];
        for (newest, records, dropped) in [(1, 7, 1), (2, 1, 0)] {
            let outcome = archive(&path, newest).close(newest, &Scenario::default(), &events, 1, 0);
            assert_eq!(outcome, LogOutcome { records, dropped, ..LogOutcome::default() });
        }
    }

    #[test]
    fn a_log_whose_last_recorder_did_not_close_it_is_lost_in_part() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.mcap");
        for newest in [1, 2] {
            let mut archive = archive(&path, newest);
            archive.words.remove(&newest);
            let error = archive.close(newest, &Scenario::default(), &[], 0, 0).error;
            assert_eq!(error.as_deref(), Some("the recorder ended before it could close the log"));
        }
        let mut archive = archive(&path, 2);
        let never = Policy { restart_ns: vec![], ..Policy::recorder(&Scenario::default().supervision) };
        archive.role = Role::new(RECORDER, never);
        archive.role.on(Now { ns: 0, tick: 0 }, Input::Exited(1));
        let error = archive.close(0, &Scenario::default(), &[], 0, 0).error;
        assert_eq!(error.as_deref(), Some("nobody was left to record the flight"));
    }
}
