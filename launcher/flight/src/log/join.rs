//! The logs of several recorders of one flight: `flight.mcap`, `flight.2.mcap`, ... They are joined into the first at the end
//! of the flight; where the launcher did not live to do that, they are read together.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::Scenario;
use contract::scenario;

use super::read::read_in_order;
use super::{Count, Log, LogWriter, Record};
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
    gather(parts, |record| records.push(*record)); // one that was killed before it wrote anything has nothing to add
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

/// The file that the recorder `epoch` writes of the log at `first`.
pub fn part(first: &Path, epoch: u32) -> PathBuf {
    if epoch == 1 { first.into() } else { first.with_extension(format!("{epoch}.mcap")) }
}

/// Reads the log at `first` with all parts that lie beside it, as one; the defect names every part that is missing, not
/// finished or not to be read. The folder stays as it is.
///
/// # Errors
/// When no part can be read.
pub fn read_parts(first: &Path) -> anyhow::Result<Log> {
    let last = others(first).into_iter().max().unwrap_or(1);
    let parts: Vec<PathBuf> = (1..=last).map(|epoch| part(first, epoch)).collect();
    let mut messages = Log::default();
    let mut read = gather(&parts, |record| messages.push(record));
    if read.len() == 1 || read.iter().all(Result::is_err) {
        let Log { scenario_toml, written_by, events, defect, .. } = read.swap_remove(0)?;
        return Ok(Log { scenario_toml, written_by, events, defect, ..messages });
    }
    let mut defects = vec![];
    for (path, part) in parts.iter().zip(read) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match part {
            Ok(part) => {
                let new = |event: &Event| !messages.events.contains(event);
                let events: Vec<Event> = part.events.into_iter().filter(new).collect();
                messages.events.extend(events);
                if messages.scenario_toml.is_empty() {
                    messages.scenario_toml = part.scenario_toml;
                    messages.written_by = part.written_by;
                }
                defects.extend(part.defect.map(|defect| format!("{name}: {defect}")));
            }
            Err(_) if !path.exists() => defects.push(format!("{name} is missing")),
            Err(error) => defects.push(format!("{name}: {error:#}")),
        }
    }
    messages.defect = (!defects.is_empty()).then(|| defects.join("; "));
    Ok(messages)
}

/// Epochs of the parts beside the log at `first`.
fn others(first: &Path) -> Vec<u32> {
    /// A file of any name may lie in the folder: no flight has more recorders than this.
    const MOST: u32 = 10_000;
    let folder = first.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let stem = first.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let epoch = |name: &str| name.strip_prefix(&stem)?.strip_prefix('.')?.strip_suffix(".mcap")?.parse().ok();
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(|entry| epoch(&entry.file_name().to_string_lossy())).filter(|epoch| *epoch <= MOST).collect()
}

/// Reads `parts` one after the other; `each` gets every message once. Everything else of each part is returned.
fn gather(parts: &[PathBuf], mut each: impl FnMut(&Record)) -> Vec<anyhow::Result<Log>> {
    let mut known = HashSet::new();
    let read = |part: &PathBuf| {
        let mut times = HashMap::new(); // a fault may have sent a message twice
        read_in_order(part, |record| {
            let nth = times.entry(identity(record)).and_modify(|nth| *nth += 1).or_insert(1);
            if known.insert((identity(record), *nth)) {
                each(record);
            }
        })
    };
    parts.iter().map(read).collect()
}

/// What tells one message from all others, but for those that a fault has sent twice.
fn identity(record: &Record) -> [u64; 6] {
    let stamp = record.stamp();
    [record.topic() as u64, stamp.epoch, stamp.sequence, stamp.tick, stamp.delivery, stamp.checksum]
}
