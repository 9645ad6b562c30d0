//! The recorder: a process that writes every message of the ring, TRUTH, and every event it gets, to `flight.mcap`.
//!
//! The recorder never holds the ring back: its queues overflow before a publisher would wait, and gaps in the sequence
//! numbers tell how many messages were lost. If the disk fails, the recorder reports this once, keeps the good part of
//! the file and goes on counting. At its end it prints its [`LogOutcome`], one line of JSON, for the launcher. If the
//! launcher dies, the recorder closes the log and ends.

use std::path::Path;
use std::process::ExitCode;
use std::time::{Instant, UNIX_EPOCH};

use contract::exit;
pub use ring::observers::Observers;
use runtime::console;
use runtime::domain::Domain;
use runtime::ports::Ports;
use runtime::process::die_with_launcher;
use runtime::realtime::phase;
use rustix::io::Errno;
use rustix::process::{getppid, set_parent_process_death_signal};
use settings::{FaultKind, Scenario};

use crate::event::{Event, EventReader};
use crate::limits::{FLUSH_PERIOD, RECORDER_POLL};
use crate::log::{Count, LogOutcome, LogWriter, Memory, Record};

/// Runs the recorder as this process.
pub fn main(namespace: &str, epoch: u32, path: &Path) -> ExitCode {
    match record(namespace, epoch, path) {
        Ok(outcome) => {
            console::print(&(serde_json::to_string(&outcome).unwrap_or_default() + "\n"));
            console::finish(exit::FLOWN).into()
        }
        Err(error) => {
            console::eprint_line(&format!("recorder: {error:#}"));
            console::finish(exit::PROCESS_LOST).into()
        }
    }
}

fn record(namespace: &str, epoch: u32, path: &Path) -> anyhow::Result<LogOutcome> {
    let launcher = getppid();
    die_with_launcher(namespace)?;
    let (mut ports, scenario) = Ports::join(namespace)?;
    // The file comes before the ports, so that a recorder is not ready unless it can write.
    let mut log = CountedLog::create_part(path, &scenario, &run_of(namespace)?)?;
    let observers = Observers::open(&mut ports, &scenario)?;
    let mut reader = EventReader::new(std::io::stdin());
    let page = ports.page.clone();
    let role = &page.recorder;
    ports.probe(|| role.ready.set(epoch))?;
    let mut remembered = 0;
    // From now on the recorder survives the launcher, because it has a log to close.
    set_parent_process_death_signal(None)?;
    loop {
        let closing = page.phase.count() >= phase::CLOSE || getppid() != launcher;
        let mut newest = 0;
        let count = observers.drain(|record| {
            if record.is_intact() {
                newest = newest.max(record.tick());
            }
            if let Record::State(state) = record
                && record.is_intact()
                && scenario.is_remembered(state.stamp.tick)
            {
                remembered = state.stamp.tick;
            }
            log.write(record);
        });
        // The plant writes its snapshot after it has sent the STATE.
        if remembered > 0
            && let Some(memories) = Memory::of_all(&page, remembered)
        {
            for memory in &memories {
                log.write_memory(memory);
            }
            remembered = 0;
        }
        page.recorded.raise(newest as u32);
        let count = count
            + reader.drain(|event| match event {
                Ok(event) => log.write_event(&event),
                Err(_) => log.outcome.dropped += 1,
            });
        if count == 0 && closing {
            return Ok(log.finish());
        }
        log.keep_safe();
        if count == 0 {
            std::thread::sleep(RECORDER_POLL);
        }
    }
}

/// Returns the name of the run in `namespace`, the same for all its recorders; the name contains the time of the
/// settings.
pub(crate) fn run_of(namespace: &str) -> anyhow::Result<String> {
    let written = std::fs::metadata(Domain::find(namespace)?.file("scenario.toml"))?.modified()?;
    Ok(format!("{}-{namespace}", written.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos()))
}

/// A log that counts lost messages and survives a failing disk.
pub struct CountedLog {
    writer: Option<LogWriter>,
    /// Instant at which the log was last forced to the disk; `unsynced` is `true` if something was written since.
    synced: Instant,
    unsynced: bool,
    count: Count,
    outcome: LogOutcome,
    /// First tick without space on the disk, if the scenario has the fault `disk-full`.
    full_from: Option<u64>,
}

impl CountedLog {
    /// Creates the log of a flight that has one recorder.
    pub fn create(path: &Path, scenario: &Scenario) -> anyhow::Result<Self> {
        let writer = LogWriter::create(path, &settings::to_toml(scenario), scenario.sample_ns())?;
        Ok(Self::begin(writer, scenario))
    }

    /// Creates the log of one of several recorders of `run`.
    fn create_part(path: &Path, scenario: &Scenario, run: &str) -> anyhow::Result<Self> {
        let writer = LogWriter::create_part(path, &settings::to_toml(scenario), scenario.sample_ns(), run)?;
        Ok(Self::begin(writer, scenario))
    }

    fn begin(writer: LogWriter, scenario: &Scenario) -> Self {
        let full = scenario.fault.iter().filter(|fault| fault.kind == FaultKind::DiskFull);
        let full_from = full.map(|fault| fault.ticks(scenario.sample_s()).start).min();
        let (count, outcome) = (Count::default(), LogOutcome::default());
        Self { writer: Some(writer), synced: Instant::now(), unsynced: false, count, outcome, full_from }
    }

    /// Writes one message, or counts it as dropped; counts the missing messages before it as dropped too.
    pub fn write(&mut self, record: &Record) {
        let gap = self.count.gap(record);
        let missed = gap.unwrap_or(0);
        self.outcome.dropped = self.outcome.dropped.saturating_add(missed);
        let full = self.full_from.is_some_and(|from| record.is_intact() && record.tick() >= from);
        let write = |writer: &mut LogWriter| {
            if full { Err(writer.give_up(std::io::Error::from(Errno::NOSPC).into())) } else { writer.write(record) }
        };
        let written = self.writer.as_mut().map(write);
        self.note(written);
    }

    /// Writes one event, or counts it as dropped.
    pub fn write_event(&mut self, event: &Event) {
        let written = self.writer.as_mut().map(|writer| writer.write_event(event));
        self.note(written);
    }

    /// Writes the snapshot of a node; it is not counted as a record.
    pub fn write_memory(&mut self, memory: &Memory) {
        if let Some(Err(error)) = self.writer.as_mut().map(|writer| writer.write_memory(memory)) {
            self.fail(&error);
        }
    }

    fn note(&mut self, written: Option<anyhow::Result<()>>) {
        match written {
            Some(Ok(())) => {
                self.outcome.records += 1;
                self.unsynced = true;
            }
            Some(Err(error)) => self.fail(&error),
            None => self.outcome.dropped += 1,
        }
    }

    /// Forces the newest records to the disk, once a second, so that neither a kill nor a loss of power loses them.
    fn keep_safe(&mut self) {
        if self.unsynced && self.synced.elapsed() > FLUSH_PERIOD {
            if let Some(Err(error)) = self.writer.as_mut().map(LogWriter::sync) {
                self.fail(&error);
            }
            (self.synced, self.unsynced) = (Instant::now(), false);
        }
    }

    pub fn finish(mut self) -> LogOutcome {
        if let Some(Err(error)) = self.writer.take().map(LogWriter::finish) {
            self.fail(&error);
        }
        self.outcome
    }

    fn fail(&mut self, error: &anyhow::Error) {
        self.writer = None;
        self.outcome.dropped += 1;
        self.outcome.error = Some(format!("{error:#}"));
    }
}

#[cfg(test)]
mod tests {
    use contract::message::Truth;

    use super::*;

    #[test]
    fn a_lost_truth_counts_as_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = CountedLog::create(&folder.path().join("flight.mcap"), &Scenario::default()).unwrap();
        for sequence in [1, 2, 5] {
            log.write(&Truth { tick: sequence - 1, sequence, ..Truth::default() }.with_checksum().into());
        }
        assert_eq!(log.finish(), LogOutcome { records: 3, dropped: 2, error: None });
    }
}
