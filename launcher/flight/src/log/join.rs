//! The logs of several recorders of one flight: `flight.mcap`, `flight.2.mcap`, ..., and what the launcher wrote after
//! a recorder died, `flight.1.rest.mcap`. At the end of the flight they are joined into the first. If the launcher died
//! before that, they are read together.

use std::cell::RefCell;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::message::{Stamp, Truth};

use contract::Topic;
use settings::Scenario;

use super::index::{ALL, LogSpan};
use super::order::TickByTick;
use super::outcome::LogOutcome;
use super::read::{read_in_order, read_memories};
use super::{Count, Log, LogWriter, Memory, Record};
use crate::event::Event;

/// Joins `parts` into one log with all `events`. This log replaces the first part; the other parts are removed. A
/// message that two parts have recorded is written once: each part adds its new messages in the order of its file.
/// A message of the `sent` ones that no part has counts as dropped.
///
/// # Errors
/// Fails if the log cannot be written; then the parts stay as they are.
pub fn join(parts: &[PathBuf], scenario: &Scenario, events: &[Event], sent: u64) -> anyhow::Result<LogOutcome> {
    let first = parts.first().context("no recorder has begun a log")?;
    let whole = first.with_extension("joined");
    let written = write(&whole, parts, scenario, events, sent);
    let outcome = written.inspect_err(|_| _ = std::fs::remove_file(&whole))?;
    std::fs::rename(&whole, first).with_context(|| format!("cannot put the joined log at {}", first.display()))?;
    parts[1..].iter().for_each(|part| _ = std::fs::remove_file(part)); // the part may never have been begun
    Ok(outcome)
}

fn write(
    path: &Path,
    parts: &[PathBuf],
    scenario: &Scenario,
    events: &[Event],
    sent: u64,
) -> anyhow::Result<LogOutcome> {
    let begin = |run: &str| LogWriter::create_part(path, &settings::to_toml(scenario), scenario.sample_ns(), run);
    let mut log = None;
    let mut failed = None;
    let mut count = Count::default();
    let mut outcome = LogOutcome { dropped: sent, ..LogOutcome::default() };
    // A part that cannot be read adds nothing: its recorder was killed before it wrote anything.
    gather(
        parts,
        &ALL,
        |_| true,
        |part, record| {
            if failed.is_some() {
                return;
            }
            let mut write = || {
                let log = match &mut log {
                    Some(log) => log,
                    none => none.insert(begin(&part.written_by.run)?),
                };
                log.write(record)
            };
            failed = write().err();
            outcome.dropped = outcome.dropped.saturating_sub(count.gap(record).is_some().into());
            outcome.records += 1;
        },
    );
    if let Some(error) = failed {
        return Err(error);
    }
    let mut log = log.map_or_else(|| begin(""), Ok)?;
    for part in parts {
        let mut written = Ok(());
        let read = read_memories(part, ALL, |_, memory| {
            if written.is_ok() {
                written = log.write_memory(&memory);
            }
        });
        written?;
        drop(read); // a part that cannot be read has no snapshots either
    }
    for event in events {
        outcome.records += 1;
        log.write_event(event)?;
    }
    log.finish()?;
    Ok(outcome)
}

/// Returns the file that the recorder `epoch` of the log at `first` writes.
pub fn part(first: &Path, epoch: u32) -> PathBuf {
    if epoch == 1 { first.into() } else { first.with_extension(format!("{epoch}.mcap")) }
}

/// Returns the file for the messages that the recorder `epoch` of the log at `first` had not written when it died.
pub fn rest(first: &Path, epoch: u32) -> PathBuf {
    first.with_extension(format!("{epoch}.rest.mcap"))
}

/// Reads the log at `first` with all parts of its run into memory, as [`stream`] does.
pub fn read_parts(first: &Path) -> anyhow::Result<Log> {
    let mut messages = Log::default();
    let Log { scenario_toml, written_by, events, defect, .. } = stream(first, ALL, |_, record| messages.push(record))?;
    Ok(Log { scenario_toml, written_by, events, defect, ..messages })
}

/// Reads the log at `first` and all parts of the same run beside it as one log. The result has no messages: `each` gets
/// those of the `span`, tick by tick, with the scenario and the origin of the log. In a log that has an index, the span
/// is found through it. The defect names every part that is missing, unfinished or unreadable. The first readable log
/// determines the run; a log with the name of a part but of another run is left out. No file is changed.
///
/// # Errors
/// Fails if no part can be read.
pub fn stream(first: &Path, span: LogSpan, mut each: impl FnMut(&Log, &Record)) -> anyhow::Result<Log> {
    let mut parts = parts_of(first);
    let mut whole = Log::default();
    let mut run = None;
    let mut is_of_run = |part: &Log| *run.get_or_insert_with(|| part.written_by.run.clone()) == part.written_by.run;
    let head = RefCell::new(Log::default());
    let mut ordered = TickByTick::new(|record: &Record| each(&head.borrow(), record));
    let mut read = gather(
        &parts,
        &span,
        |part| is_of_run(part),
        |part, record| {
            let mut head = head.borrow_mut();
            if head.scenario_toml.is_empty() {
                (head.scenario_toml, head.written_by) = (part.scenario_toml.clone(), part.written_by.clone());
            }
            drop(head);
            ordered.push(record);
        },
    );
    ordered.finish();
    // Trailing logs of another run are no parts, and are not reported.
    let mut may_be_own = |i: &usize| match &read[*i] {
        Ok(part) => is_of_run(part),
        Err(_) => parts[*i].exists(),
    };
    let own = (0..read.len()).rev().find(|i| may_be_own(i)).map_or(1, |last| last + 1);
    parts.truncate(own);
    read.truncate(own);
    if read.len() == 1 || read.iter().all(Result::is_err) {
        return read.swap_remove(0);
    }
    let mut defects = vec![];
    for (path, part) in parts.iter().zip(read) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match part {
            Ok(part) if !is_of_run(&part) => defects.push(format!("{name} is of another run")),
            Ok(part) => {
                let new = |event: &Event| !whole.events.contains(event);
                let events: Vec<Event> = part.events.into_iter().filter(new).collect();
                whole.events.extend(events);
                if whole.scenario_toml.is_empty() {
                    whole.scenario_toml = part.scenario_toml;
                    whole.written_by = part.written_by;
                }
                defects.extend(part.defect.map(|defect| format!("{name}: {defect}")));
            }
            Err(_) if !path.exists() => defects.push(format!("{name} is missing")),
            Err(error) => defects.push(format!("{name}: {error:#}")),
        }
    }
    whole.defect = (!defects.is_empty()).then(|| defects.join("; "));
    Ok(whole)
}

/// Reads the newest snapshots of the nodes at or before the time `until_ns`, from the log at `first` with all parts of
/// its run; empty if the log has no snapshots.
///
/// # Errors
/// Fails if no part can be read.
pub fn memories(first: &Path, until_ns: u64) -> anyhow::Result<Vec<Memory>> {
    /// Span that is read first \[ns\]: snapshots are written every ten seconds, unless one was incomplete.
    const RECENT_NS: u64 = 30_000_000_000;
    let recent = memories_of(first, until_ns.saturating_sub(RECENT_NS)..=until_ns)?;
    if recent.is_empty() { memories_of(first, 0..=until_ns) } else { Ok(recent) }
}

/// Reads the newest snapshots of the nodes in a `span` of time.
fn memories_of(first: &Path, span: LogSpan) -> anyhow::Result<Vec<Memory>> {
    let mut newest: Vec<Memory> = vec![];
    let (mut run, mut failed, mut read) = (None, None, 0);
    for part in parts_of(first) {
        let each = |log: &Log, memory: Memory| {
            let at = newest.first().map_or(0, |known| known.tick);
            let is_of_run = *run.get_or_insert_with(|| log.written_by.run.clone()) == log.written_by.run;
            if !is_of_run || memory.tick < at {
                return;
            }
            if memory.tick > at {
                newest.clear();
            }
            if !newest.iter().any(|known| known.topic == memory.topic) {
                newest.push(memory);
            }
        };
        match read_memories(&part, span.clone(), each) {
            Ok(()) => read += 1,
            Err(why) => failed = failed.or(Some(why)),
        }
    }
    match failed {
        Some(why) if read == 0 => Err(why),
        _ => Ok(newest),
    }
}

/// Returns the files that may belong to the log at `first`, in the order of its recorders.
fn parts_of(first: &Path) -> Vec<PathBuf> {
    let last = others(first).into_iter().max().unwrap_or(1);
    let rest = |epoch: u32| Some(rest(first, epoch)).filter(|rest| rest.exists());
    (1..=last).flat_map(|epoch| [Some(part(first, epoch)), rest(epoch)]).flatten().collect()
}

/// Returns the epochs in the names of the files beside the log at `first`.
fn others(first: &Path) -> Vec<u32> {
    /// Largest epoch of a part, more than a flight has recorders: a file in the folder may have any name.
    const MOST: u32 = 10_000;
    let folder = first.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let stem = first.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let epoch = |name: &str| {
        let name = name.strip_prefix(&stem)?.strip_prefix('.')?.strip_suffix(".mcap")?;
        name.strip_suffix(".rest").unwrap_or(name).parse().ok()
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(|entry| epoch(&entry.file_name().to_string_lossy())).filter(|epoch| *epoch <= MOST).collect()
}

/// Reads the `span` of `parts` one after the other, and returns each part without its messages. `each` gets every
/// message of the `wanted` parts once, in the order of writing. A single part is always wanted.
fn gather(
    parts: &[PathBuf],
    span: &LogSpan,
    mut wanted: impl FnMut(&Log) -> bool,
    mut each: impl FnMut(&Log, &Record),
) -> Vec<anyhow::Result<Log>> {
    if let [part] = parts {
        return vec![read_in_order(part, span.clone(), each)];
    }
    let mut known = Recent::default();
    let read = |part: &PathBuf| {
        let mut here = Recent::default(); // a fault may have sent a message twice
        read_in_order(part, span.clone(), |part, record| {
            let identity = identity(record);
            if wanted(part) && here.add(identity) > known.times(&identity) {
                known.add(identity);
                each(part, record);
            }
        })
    };
    parts.iter().map(read).collect()
}

/// Counts how often each of the newest messages was seen: a recorder and the launcher write side by side for seconds.
#[derive(Default)]
struct Recent {
    times: HashMap<Identity, u32>,
    order: VecDeque<Identity>,
}

impl Recent {
    /// Number of messages that are remembered: more than a recorder and the launcher write side by side.
    const MOST: usize = 200_000;

    /// Counts a message, and returns how often it was seen, this time included.
    fn add(&mut self, identity: Identity) -> u32 {
        self.order.push_back(identity);
        if self.order.len() > Self::MOST
            && let Some(oldest) = self.order.pop_front()
            && let Entry::Occupied(mut times) = self.times.entry(oldest)
        {
            *times.get_mut() -= 1;
            if *times.get() == 0 {
                times.remove();
            }
        }
        *self.times.entry(identity).and_modify(|times| *times += 1).or_insert(1)
    }

    fn times(&self, identity: &Identity) -> u32 {
        self.times.get(identity).copied().unwrap_or(0)
    }
}

/// Fields that identify a message; they are equal only for copies that a fault has sent.
type Identity = [u64; 6];

fn identity(record: &Record) -> Identity {
    let of_topic = |(topic, stamp): (_, &Stamp)| {
        [topic as u64, stamp.epoch, stamp.sequence, stamp.tick, stamp.delivery, stamp.checksum]
    };
    match record {
        Record::Truth(Truth { tick, sequence, checksum, .. }) => {
            [Topic::COUNT as u64, 0, *sequence, *tick, 0, *checksum]
        }
        _ => record.stamped().map_or([0; 6], of_topic),
    }
}
