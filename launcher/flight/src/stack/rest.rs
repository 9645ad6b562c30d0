//! What a dead recorder leaves to be written: the launcher sees every message too, keeps the newest of them, and writes them to
//! a part of its own until another recorder has taken over. So the death of a recorder costs the log nothing.

use std::collections::VecDeque;
use std::path::Path;

use contract::scenario::to_toml;
use contract::{Scenario, Topic};
use runtime::console::eprint_line;
use runtime::limits::OBSERVER_S;

use crate::limits::FLUSH_PERIOD;
use crate::log::{LogWriter, Record};

/// The newest messages of a flight, and the part of the log that they are written to while there is no recorder.
pub struct Rest {
    newest: VecDeque<Record>,
    most: usize,
    part: Option<LogWriter>,
    /// Whether another recorder has taken over: it has all messages that are seen after the next look.
    ends: bool,
}

impl Rest {
    /// Keeps what a recorder may not have written when it dies: what its queues hold, for as long as it may hang, and what it
    /// flushes at once; twice that, because standbys and faults send messages too.
    pub fn new(scenario: &Scenario) -> Self {
        let seconds = OBSERVER_S as u64 + FLUSH_PERIOD.as_secs();
        let most = 2 * Topic::COUNT * scenario.run.rate_hz as usize * seconds as usize;
        Self { newest: VecDeque::with_capacity(most), most, part: None, ends: false }
    }

    /// Takes one message in that was sent.
    pub fn observe(&mut self, record: &Record) {
        if self.newest.len() == self.most {
            self.newest.pop_front();
        }
        self.newest.push_back(*record);
        if let Some(part) = &mut self.part {
            let written = part.write(record);
            self.note(written);
        }
    }

    /// Begins the part at `path` of the log of `run` with the newest messages; one that has begun goes on.
    pub fn begin(&mut self, path: &Path, scenario: &Scenario, run: &str) {
        self.ends = false;
        if self.part.is_none() {
            let begun = LogWriter::create_part(path, &to_toml(scenario), scenario.sample_ns(), run);
            let written = begun.and_then(|part| {
                let part = self.part.insert(part);
                self.newest.iter().try_for_each(|record| part.write(record))
            });
            self.note(written);
        }
    }

    /// Another recorder has taken over, or none will.
    pub fn end(&mut self) {
        self.ends = true;
    }

    /// Closes the part if it has ended; call it after the messages of this look were taken in.
    pub fn look(&mut self) {
        if self.ends {
            self.finish();
        }
    }

    /// Closes the part.
    pub fn finish(&mut self) {
        self.ends = false;
        if let Some(part) = self.part.take() {
            self.note(part.finish());
        }
    }

    /// A part that cannot be written is told once; what it lacks is counted when the log is joined.
    fn note(&mut self, written: anyhow::Result<()>) {
        if let Err(error) = written {
            eprint_line(&format!("error: {error:#}"));
            self.part = None;
        }
    }
}
