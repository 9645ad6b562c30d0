//! Joining the logs of several recorders of one flight.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::Scenario;
use contract::scenario;

use super::read::read_in_order;
use super::{Count, LogWriter, Record};
use crate::event::Event;
use crate::recorder::LogOutcome;

/// Makes one log of `parts` in the place of the first, with all `events`; the others are removed. What two of them
/// have recorded stands in it once: each adds what is new, in the order in which it was written. What is missing of the
/// messages `sent` is told as dropped.
///
/// # Errors
/// When the log cannot be written; then the parts stay as they are.
pub fn join(parts: &[PathBuf], scenario: &Scenario, events: &[Event], sent: u64) -> anyhow::Result<LogOutcome> {
    let first = parts.first().context("no recorder has begun a log")?;
    let mut records = vec![];
    let mut known = HashSet::new();
    for part in parts {
        let mut times = HashMap::new(); // a fault may have sent a message twice
        let add = |record| {
            let nth = times.entry(identity(&record)).and_modify(|nth| *nth += 1).or_insert(1);
            if known.insert((identity(&record), *nth)) {
                records.push(record);
            }
        };
        let _ = read_in_order(part, add); // one that was killed before it wrote anything has nothing to add
    }
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
    records: &[Record],
    events: &[Event],
    sent: u64,
) -> anyhow::Result<LogOutcome> {
    let mut log = LogWriter::create(path, &scenario::to_toml(scenario), scenario.sample_ns())?;
    let mut count = Count::default();
    let mut outcome = LogOutcome { dropped: sent, ..LogOutcome::default() };
    for record in records {
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

/// What tells one message from all others, but for those that a fault has sent twice.
fn identity(record: &Record) -> [u64; 6] {
    let stamp = record.stamp();
    [record.topic() as u64, stamp.epoch, stamp.sequence, stamp.tick, stamp.unheard, stamp.checksum]
}
