//! Part of the log that a dead recorder did not write. The launcher receives every message too, keeps the newest
//! messages, and writes them to a part of its own until another recorder has taken over. So the death of a recorder
//! costs no message.

use std::collections::VecDeque;
use std::path::Path;

use runtime::console::eprint_line;
use runtime::limits::OBSERVER_S;
use settings::{Scenario, to_toml};

use crate::limits::FLUSH_PERIOD;
use crate::log::{LogWriter, Record};

/// Newest messages of a flight, and the part of the log to which they are written while there is no recorder.
pub struct LogRemainder {
    newest: VecDeque<Record>,
    most: usize,
    part: Option<LogWriter>,
    /// `true` if the part ends at the next look: another recorder has all later messages, or none will.
    ends: bool,
}

impl LogRemainder {
    /// Makes room for the messages that a dead recorder may not have written: twice those of the time that its queues
    /// hold and of one flush period, because standbys and faults send messages too.
    pub fn new(scenario: &Scenario) -> Self {
        let seconds = OBSERVER_S as u64 + FLUSH_PERIOD.as_secs();
        let most = 2 * Record::KINDS * scenario.run.rate_hz as usize * seconds as usize;
        Self { newest: VecDeque::with_capacity(most), most, part: None, ends: false }
    }

    /// Takes in one sent message.
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

    /// Begins the part at `path` of the log of `run` with the newest messages; a part that was begun already is
    /// continued.
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

    /// Ends the part at the next look: another recorder has taken over, or none will.
    pub fn end(&mut self) {
        self.ends = true;
    }

    /// Closes the part if it is to end; call this after the messages of this look were taken in.
    pub fn look(&mut self) {
        if self.ends {
            self.finish();
        }
    }

    /// Closes the part, if there is one.
    pub fn finish(&mut self) {
        self.ends = false;
        if let Some(part) = self.part.take() {
            self.note(part.finish());
        }
    }

    /// Reports once that the part cannot be written, and gives the part up; its missing messages are counted when the
    /// log is joined.
    fn note(&mut self, written: anyhow::Result<()>) {
        if let Err(error) = written {
            eprint_line(&format!("error: {error:#}"));
            self.part = None;
        }
    }
}
