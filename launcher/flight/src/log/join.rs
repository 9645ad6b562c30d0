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
    let read = gather(parts, |_| true, |record| records.push(*record));
    // One that was killed before it wrote anything has nothing to add.
    let run = read.into_iter().flatten().find_map(|part| part.written_by.run).unwrap_or_default();
    let whole = first.with_extension("joined");
    let written = write(&whole, scenario, &run, &records, events, sent);
    let outcome = written.inspect_err(|_| _ = std::fs::remove_file(&whole))?;
    std::fs::rename(&whole, first).with_context(|| format!("cannot put the joined log at {}", first.display()))?;
    parts[1..].iter().for_each(|part| _ = std::fs::remove_file(part)); // one may never have been begun
    Ok(outcome)
}

fn write(
    path: &Path,
    scenario: &Scenario,
    run: &str,
    records: &[Record],
    events: &[Event],
    sent: u64,
) -> anyhow::Result<LogOutcome> {
    let mut log = LogWriter::create_part(path, &scenario::to_toml(scenario), scenario.sample_ns(), run)?;
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

/// Reads the log at `first` with all parts of the same run that lie beside it, as one; the defect names every part that is
/// missing, not finished or not to be read. A log that only has the name of a part is left alone: the run that stands in
/// the first readable log says what belongs to it. The folder stays as it is.
///
/// # Errors
/// When no part can be read.
pub fn read_parts(first: &Path) -> anyhow::Result<Log> {
    let last = others(first).into_iter().max().unwrap_or(1);
    let mut parts: Vec<PathBuf> = (1..=last).map(|epoch| part(first, epoch)).collect();
    let mut messages = Log::default();
    let mut run = None;
    let mut is_of_run = |part: &Log| *run.get_or_insert_with(|| part.written_by.run.clone()) == part.written_by.run;
    let mut read = gather(&parts, |part| is_of_run(part), |record| messages.push(record));
    // What has the name of a later part, and is of another run, is none that this one misses.
    let mut may_be_own = |i: &usize| match &read[*i] {
        Ok(part) => is_of_run(part),
        Err(_) => parts[*i].exists(),
    };
    let own = (0..read.len()).rev().find(|i| may_be_own(i)).map_or(1, |last| last + 1);
    parts.truncate(own);
    read.truncate(own);
    if read.len() == 1 || read.iter().all(Result::is_err) {
        let Log { scenario_toml, written_by, events, defect, .. } = read.swap_remove(0)?;
        return Ok(Log { scenario_toml, written_by, events, defect, ..messages });
    }
    let mut defects = vec![];
    for (path, part) in parts.iter().zip(read) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match part {
            Ok(part) if !is_of_run(&part) => defects.push(format!("{name} is of another run")),
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

/// Reads `parts` one after the other; `each` gets every message of those that are `wanted` once. Everything else of each
/// part is returned.
fn gather(
    parts: &[PathBuf],
    mut wanted: impl FnMut(&Log) -> bool,
    mut each: impl FnMut(&Record),
) -> Vec<anyhow::Result<Log>> {
    let mut known = HashSet::new();
    let read = |part: &PathBuf| {
        let mut times = HashMap::new(); // a fault may have sent a message twice
        let mut records = vec![];
        let log = read_in_order(part, |record| records.push(*record))?;
        for record in records.iter().filter(|_| wanted(&log)) {
            let nth = times.entry(identity(record)).and_modify(|nth| *nth += 1).or_insert(1);
            if known.insert((identity(record), *nth)) {
                each(record);
            }
        }
        Ok(log)
    };
    parts.iter().map(read).collect()
}

/// What tells one message from all others, but for those that a fault has sent twice.
fn identity(record: &Record) -> [u64; 6] {
    let stamp = record.stamp();
    [record.topic() as u64, stamp.epoch, stamp.sequence, stamp.tick, stamp.delivery, stamp.checksum]
}
