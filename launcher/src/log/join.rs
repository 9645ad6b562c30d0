//! Joining the logs of several recorders of one flight.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::scenario;
use contract::{Scenario, Topic};

use super::{Count, Log, LogWriter, Record, read};
use crate::event::Event;
use crate::recorder::LogOutcome;

/// Makes one log of `parts` in the place of the first, with all `events`; the others are removed. What two of them
/// have recorded stands in it once; what is missing of the messages `sent` is told as dropped.
///
/// # Errors
/// When the log cannot be written; then the parts stay as they are.
pub fn join(parts: &[PathBuf], scenario: &Scenario, events: &[Event], sent: u64) -> anyhow::Result<LogOutcome> {
    let first = parts.first().context("no recorder has begun a log")?;
    let mut records: Vec<(u64, Record)> = vec![];
    let mut known = HashSet::new();
    let mut newest = [0; Topic::COUNT];
    for part in parts {
        let mut times = HashMap::new();
        // One that was killed before it wrote anything has nothing to add.
        for record in read(part).map(messages).unwrap_or_default() {
            let nth = times.entry(identity(&record)).and_modify(|nth| *nth += 1).or_insert(1);
            if known.insert((identity(&record), *nth)) {
                records.push((place(&record, &mut newest), record));
            }
        }
    }
    records.sort_by_key(|(tick, record)| (*tick, record.topic() as usize));
    let whole = first.with_extension("joined");
    let written = write(&whole, scenario, &records, events, sent);
    let outcome = written.inspect_err(|_| _ = std::fs::remove_file(&whole))?;
    std::fs::rename(&whole, first).with_context(|| format!("cannot put the joined log at {}", first.display()))?;
    parts[1..].iter().for_each(|part| _ = std::fs::remove_file(part)); // one may never have been begun
    Ok(outcome)
}

fn write(
    path: &Path,
    scenario: &Scenario,
    records: &[(u64, Record)],
    events: &[Event],
    sent: u64,
) -> anyhow::Result<LogOutcome> {
    let mut log = LogWriter::create(path, &scenario::to_toml(scenario), scenario.sample_ns())?;
    let mut count = Count::default();
    let mut outcome = LogOutcome { dropped: sent, ..LogOutcome::default() };
    for (_, record) in records {
        outcome.dropped = outcome.dropped.saturating_sub(count.gap(record).is_some().into());
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

/// The tick at which `record` was sent, whatever its stamp says: each topic stays in the order in which it was recorded.
fn place(record: &Record, newest: &mut [u64; Topic::COUNT]) -> u64 {
    let newest = &mut newest[record.topic() as usize];
    if record.is_whole() {
        *newest = record.stamp().tick.max(*newest);
    }
    *newest
}

/// What tells one message from all others, but for those that a fault has sent twice.
fn identity(record: &Record) -> [u64; 6] {
    let stamp = record.stamp();
    [record.topic() as u64, stamp.epoch, stamp.sequence, stamp.tick, stamp.unheard, stamp.checksum]
}

fn messages(log: Log) -> Vec<Record> {
    let Log { states, references, controls, actuators, .. } = log;
    let others = references.into_iter().map(Record::from).chain(controls.into_iter().map(Record::from));
    states.into_iter().map(Record::from).chain(others).chain(actuators.into_iter().map(Record::from)).collect()
}
