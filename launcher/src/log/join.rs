//! Joining the logs of several recorders of one flight.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::Scenario;
use contract::scenario;

use super::{Count, Log, LogWriter, Record, read};
use crate::event::Event;
use crate::recorder::LogOutcome;

/// Makes one log of `parts` in the place of the first, with all `events`; the others are removed. What two of them
/// have recorded stands in it once.
///
/// # Errors
/// When the log cannot be written; then the parts stay as they are.
pub fn join(parts: &[PathBuf], scenario: &Scenario, events: &[Event]) -> anyhow::Result<LogOutcome> {
    let first = parts.first().context("no recorder has begun a log")?;
    let mut records = vec![];
    let mut known = HashSet::new();
    for part in parts {
        // One that was killed before it wrote anything has nothing to add.
        let fresh: Vec<Record> = read(part).map(messages).unwrap_or_default();
        let fresh: Vec<Record> = fresh.into_iter().filter(|record| !known.contains(&identity(record))).collect();
        known.extend(fresh.iter().map(identity));
        records.extend(fresh);
    }
    records.sort_by_key(|record| (record.stamp().tick, record.topic() as usize));
    let whole = first.with_extension("joined");
    let written = write(&whole, scenario, &records, events);
    let outcome = written.inspect_err(|_| _ = std::fs::remove_file(&whole))?;
    std::fs::rename(&whole, first).with_context(|| format!("cannot put the joined log at {}", first.display()))?;
    parts[1..].iter().for_each(|part| _ = std::fs::remove_file(part)); // one may never have been begun
    Ok(outcome)
}

fn write(path: &Path, scenario: &Scenario, records: &[Record], events: &[Event]) -> anyhow::Result<LogOutcome> {
    let mut log = LogWriter::create(path, &scenario::to_toml(scenario), scenario.sample_ns())?;
    let mut count = Count::default();
    let mut outcome = LogOutcome::default();
    for record in records {
        outcome.dropped += count.gap(record).unwrap_or(0);
        outcome.records += 1;
        log.write(record)?;
    }
    for event in events {
        outcome.records += 1;
        log.event(event)?;
    }
    log.finish()?;
    Ok(outcome)
}

/// What tells one message from all others; a fault may have sent it twice, but then a recorder has both.
fn identity(record: &Record) -> [u64; 6] {
    let stamp = record.stamp();
    [record.topic() as u64, stamp.epoch, stamp.sequence, stamp.tick, stamp.unheard, stamp.checksum]
}

fn messages(log: Log) -> Vec<Record> {
    let Log { states, references, controls, actuators, .. } = log;
    let others = references.into_iter().map(Record::from).chain(controls.into_iter().map(Record::from));
    states.into_iter().map(Record::from).chain(others).chain(actuators.into_iter().map(Record::from)).collect()
}
