//! Joining the logs of several recorders of one flight.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::Scenario;
use contract::scenario;

use super::read::read_in_order;
use super::{Count, LogWriter, Record};
use crate::event::Event;
use crate::recorder::LogOutcome;

/// Makes one log of `parts` in the place of the first, with all `events`; the others are removed. What two of them
/// have recorded stands in it once: each adds what is new, in the order in which it was written.
///
/// # Errors
/// When the log cannot be written; then the parts stay as they are.
pub fn join(parts: &[PathBuf], scenario: &Scenario, events: &[Event]) -> anyhow::Result<LogOutcome> {
    let first = parts.first().context("no recorder has begun a log")?;
    let mut records = vec![];
    let mut known = HashSet::new();
    for part in parts {
        let before = records.len();
        let add = |record| {
            if !known.contains(&identity(&record)) {
                records.push(record);
            }
        };
        let _ = read_in_order(part, add); // one that was killed before it wrote anything has nothing to add
        known.extend(records[before..].iter().map(identity));
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::What;
    use contract::message::{Message, Reference, Stamp, State};

    fn sent<M: Message + Into<Record>>(tick: u64, sequence: u64) -> Record {
        let mut message = M::default();
        *message.stamp_mut() = Stamp { tick, sequence, epoch: 1, ..Stamp::default() };
        message.sealed().into()
    }

    fn written(path: &Path, records: &[Record]) {
        let mut log = LogWriter::create(path, "", 10_000_000).unwrap();
        for record in records {
            log.write(record).unwrap();
        }
        log.finish().unwrap();
    }

    #[test]
    fn parts_become_one_log_in_the_order_in_which_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let parts = ["flight.mcap", "flight.2.mcap", "flight.3.mcap"].map(|name| folder.path().join(name));
        // Late, and with a tick that a fault has bent.
        let (late, bent) = (sent::<State>(1, 2), sent::<Reference>(1 << 60, 3));
        let first = [sent::<State>(0, 1), sent::<Reference>(0, 1), sent::<State>(2, 3), late, bent];
        let news = [sent::<State>(3, 4), sent::<Reference>(3, 4)];
        written(&parts[0], &first);
        written(&parts[1], &[first[3], first[4], news[0], news[1]]); // the third was killed before it wrote
        let events = [Event::new(1, "recorder", 2, What::TookOver)];

        let outcome = join(&parts, &Scenario::default(), &events).unwrap();

        let mut joined = vec![];
        let log = read_in_order(&parts[0], |record| joined.push(record)).unwrap();
        assert_eq!(joined, [&first[..], &news].concat());
        assert_eq!((outcome.records, &log.events[..]), (8, &events[..]));
        assert!(!parts[1].exists());
    }
}
