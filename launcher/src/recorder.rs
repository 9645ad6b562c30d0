//! The recorder: a process that writes every message of every topic to `flight.mcap`, and every event it is told of.
//!
//! It never holds the ring back: its queues overflow before a publisher would wait, and what they lost is counted by
//! the gaps in the sequence numbers. When the disk fails it says so once, keeps the good part of the file and goes on
//! counting. Its last word, one line of JSON on stdout, tells the launcher how it went.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::console;
use contract::message::{Actuators, Controls, Reference, State};
use contract::port::{Receive, Wire};
use contract::process::{Seat, SeatError, die_with_launcher, exit};
use contract::realtime::{Board, phase};
use contract::scenario::{self, FaultKind, Scenario};
use contract::topic::Topic;
use rustix::io::Errno;
use serde::{Deserialize, Serialize};

use crate::event::{Event, Hearing};
use crate::log::{Count, LogWriter, Record};

/// How often the queues are emptied.
const POLL: Duration = Duration::from_millis(2);

/// The recorder's last word.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogOutcome {
    /// Messages and events written.
    pub records: u64,
    /// Those lost before they could be written.
    pub dropped: u64,
    /// Why the log ends early, if it does.
    pub error: Option<String>,
    /// Messages that were sent, as far as the recorder can tell; in its last word only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sent: Option<u64>,
}

/// The four topics as one stream of records.
pub struct Observers {
    board: Arc<Board>,
    states: Box<dyn Receive<State>>,
    references: Box<dyn Receive<Reference>>,
    controls: Box<dyn Receive<Controls>>,
    actuators: Box<dyn Receive<Actuators>>,
}

impl Observers {
    /// Joins all four topics.
    pub fn join(seat: &Seat) -> Result<Self, SeatError> {
        Ok(Self {
            board: seat.board.clone(),
            states: seat.observer()?,
            references: seat.observer()?,
            controls: seat.observer()?,
            actuators: seat.observer()?,
        })
    }

    /// Empties the queues into `each`, every topic in its own order; how many there were. What comes from a process that
    /// has no place in the run is no part of the flight.
    pub fn drain(&self, mut each: impl FnMut(Record)) -> usize {
        fn one<M: Wire + Into<Record>>(board: &Board, port: &dyn Receive<M>, each: &mut impl FnMut(Record)) -> usize {
            let office = board.office(M::TOPIC);
            let received = std::iter::from_fn(|| port.receive()).filter(|(_, port)| office.knows(*port));
            received.map(|(message, _)| each(message.into())).count()
        }
        one(&self.board, &*self.states, &mut each)
            + one(&self.board, &*self.references, &mut each)
            + one(&self.board, &*self.controls, &mut each)
            + one(&self.board, &*self.actuators, &mut each)
    }
}

/// Runs the recorder as this process.
pub fn main(namespace: &str, epoch: u32, path: &Path) -> ExitCode {
    match record(namespace, epoch, path) {
        Ok(outcome) => {
            console::print(&(serde_json::to_string(&outcome).unwrap_or_default() + "\n"));
            console::finish(exit::FLOWN)
        }
        Err(error) => {
            console::eprint_line(&format!("recorder: {error:#}"));
            console::finish(exit::PROCESS_LOST)
        }
    }
}

fn record(namespace: &str, epoch: u32, path: &Path) -> anyhow::Result<LogOutcome> {
    die_with_launcher(namespace)?;
    let seat = Seat::join(namespace, "recorder", epoch)?;
    // The file first: a recorder that has joined is one that can write.
    let mut log = Log::create(path, &seat.scenario)?;
    let observers = Observers::join(&seat)?;
    let mut hearing = Hearing::new(std::io::stdin());
    let office = seat.board.archive();
    let mut is_ready = false;
    loop {
        // What a node has sent reaches those who have looked since it opened its port, though it may be gone by now.
        let all_are_here = Topic::ALL.iter().all(|topic| seat.board.office(*topic).ready.get() > 0);
        let closing = seat.board.phase().count() >= phase::CLOSE || office.holder() > epoch;
        let mut newest = 0;
        let count = observers.drain(|record| {
            if record.is_whole() {
                newest = newest.max(record.stamp().tick);
            }
            log.write(&record);
        });
        seat.board.recorded().raise(newest as u32);
        if all_are_here && !is_ready {
            office.ready.set(epoch);
            is_ready = true;
        }
        let count = count
            + hearing.drain(|event| match event {
                Ok(event) => log.event(&event),
                Err(_) => log.outcome.dropped += 1,
            });
        if count == 0 {
            if closing {
                let sent = Some(log.sent);
                return Ok(LogOutcome { sent, ..log.finish() });
            }
            log.idle();
            std::thread::sleep(POLL);
        }
    }
}

/// A log that counts what it lost and survives a failing disk.
pub struct Log {
    writer: Option<LogWriter>,
    /// When the newest message was written, unless it was flushed since.
    written: Option<Instant>,
    count: Count,
    /// Messages sent, as far as that tells.
    sent: u64,
    outcome: LogOutcome,
    /// From this tick on there is no space left, as a fault of the scenario wants it.
    full_from: Option<u64>,
}

impl Log {
    /// Begins the file.
    pub fn create(path: &Path, scenario: &Scenario) -> anyhow::Result<Self> {
        let writer = Some(LogWriter::create(path, &scenario::to_toml(scenario), scenario.sample_ns())?);
        let full = scenario.fault.iter().filter(|fault| fault.kind == FaultKind::DiskFull);
        let full_from = full.map(|fault| fault.ticks(scenario.sample_s()).start).min();
        Ok(Self { writer, written: None, count: Count::default(), sent: 0, outcome: LogOutcome::default(), full_from })
    }

    /// Writes one message, or counts it as dropped.
    pub fn write(&mut self, record: &Record) {
        let gap = self.count.gap(record);
        let missed = gap.unwrap_or(0);
        self.sent = self.sent.saturating_add(gap.map_or(0, |gap| gap.saturating_add(1)));
        self.outcome.dropped = self.outcome.dropped.saturating_add(missed);
        let full = self.full_from.is_some_and(|from| record.is_whole() && record.stamp().tick >= from);
        let write = |writer: &mut LogWriter| {
            if full { Err(writer.give_up(std::io::Error::from(Errno::NOSPC).into())) } else { writer.write(record) }
        };
        let written = self.writer.as_mut().map(write);
        self.note(written);
    }

    /// Writes one event, or counts it as dropped.
    pub fn event(&mut self, event: &Event) {
        let written = self.writer.as_mut().map(|writer| writer.event(event));
        self.note(written);
    }

    fn note(&mut self, written: Option<anyhow::Result<()>>) {
        match written {
            Some(Ok(())) => {
                self.outcome.records += 1;
                self.written = Some(Instant::now());
            }
            Some(Err(error)) => self.fail(&error),
            None => self.outcome.dropped += 1,
        }
    }

    /// Nothing to write just now: what was written a second ago goes out of reach of a kill.
    fn idle(&mut self) {
        if self.written.is_some_and(|when| when.elapsed() > Duration::from_secs(1)) {
            self.written = None;
            if let Some(Err(error)) = self.writer.as_mut().map(LogWriter::flush) {
                self.fail(&error);
            }
        }
    }

    /// Closes the file.
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
