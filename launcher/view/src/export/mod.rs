//! `export`: a run, complete or not, in the formats of other tools.
//!
//! | format | what is written | by |
//! |---|---|---|
//! | CSV, Parquet | a table for each topic, `events`, `cycles` | `tables`, `csv`, `parquet` |
//! | `ULog` | the same tables as topics of one file, and the topics of PX4 that fit | `ulog`, `px4` |
//! | MCAP for Foxglove | messages and events, and the scenes derived from them | `scenes` |
//! | Perfetto | some ticks as a trace | [`perfetto`] |
//!
//! A log is read once, message by message; nothing holds the whole flight in memory.

mod csv;
mod parquet;
pub mod perfetto;
mod px4;
mod scenes;
mod sink;
mod tables;
mod ulog;

use std::path::{Path, PathBuf};

use anyhow::Context;
use contract::Topic;
use contract::message::Stamp;
use flight::event::Event;
use flight::log::{Count, Record, Samples};
use folder::dir::Dir;
use folder::files::{named_file, named_folder};
use outcome::recorded::{Recorded, TimeSpan};
use settings::{Mode, Scenario};

use crate::cycle::CycleTimes;
use scenes::Scenes;
use sink::Sink;
use tables::Tables;
use ulog::Ulog;

/// Format of an export that is made from the messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    Csv,
    Parquet,
    Ulog,
    Foxglove,
}

/// Result of an export.
#[derive(Debug)]
pub struct Export {
    /// Folder or file that was written.
    pub out: PathBuf,
    /// Notes for users: why the log does not cover the flight, and what was left out.
    pub notes: Vec<String>,
}

/// Writes the `part` of the run at `log`, its `flight.mcap`, in a `format` to `out`; by default beside the log: into
/// the folder `csv` or `parquet`, or as `flight.ulg` or `foxglove.mcap`, in the place of an earlier export.
///
/// # Errors
/// The log cannot be read, the part has no message, `out` has files already, or the files cannot be written; then none
/// of them is new.
pub fn export(log: &Path, format: Format, part: TimeSpan, out: Option<&Path>) -> anyhow::Result<Export> {
    let (usual, extension) = match format {
        Format::Csv => ("csv", None),
        Format::Parquet => ("parquet", None),
        Format::Ulog => ("flight.ulg", Some("ulg")),
        Format::Foxglove => ("foxglove.mcap", Some("mcap")),
    };
    let out = match (out, extension) {
        (None, _) => log.with_file_name(usual),
        (Some(out), None) => named_folder(out)?,
        (Some(out), Some(extension)) => named_file(out, extension)?,
    };
    let cannot = || format!("cannot write {}: choose another place with --out", out.display());
    let folder = match extension {
        None => Dir::make(&out),
        Some(_) => Dir::open(out.parent().unwrap_or(Path::new(""))),
    };
    let folder = folder.with_context(cannot)?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let begin = |scenario: &Scenario| -> anyhow::Result<Box<dyn Sink + '_>> {
        Ok(match format {
            Format::Csv => Box::new(Tables::<csv::Csv>::begin(&folder, scenario)?),
            Format::Parquet => Box::new(Tables::<parquet::Parquet>::begin(&folder, scenario)?),
            Format::Ulog => Box::new(Ulog::begin(&folder, &name, scenario)?),
            Format::Foxglove => Box::new(Scenes::begin(&folder, &name, scenario, log)?),
        })
    };
    // A new folder of a failed export is removed; a folder with files stays.
    let cycles = format != Format::Foxglove;
    let notes = write(log, part, begin, cannot, cycles).inspect_err(|_| _ = std::fs::remove_dir(&out))?;
    Ok(Export { out, notes })
}

/// Reads the `part` of the run into the sink that `begin` makes; returns notes for users, also on missing `cycles`.
fn write<'a>(
    log: &Path,
    part: TimeSpan,
    begin: impl Fn(&Scenario) -> anyhow::Result<Box<dyn Sink + 'a>>,
    cannot: impl Fn() -> String,
    cycles: bool,
) -> anyhow::Result<Vec<String>> {
    let mut reading: Option<Reading<'a>> = None;
    let mut failed = None;
    // Messages before the part are read too, because counters are compared with those of the message before.
    let read = TimeSpan { from_s: (part.from_s - Reading::BEFORE_S).max(0.0), to_s: part.to_s };
    let recorded = Recorded::read_each(log, read, |scenario, record| {
        if failed.is_none() {
            let mut take = || {
                let reading = match &mut reading {
                    Some(reading) => reading,
                    none => none.insert(Reading::new(begin(scenario)?, part, scenario)),
                };
                reading.message(record)
            };
            failed = take().err();
        }
    })?;
    if let Some(error) = failed {
        return Err(error.context(cannot()));
    }
    let reading = reading.filter(|reading| reading.messages > 0);
    let reading = reading.with_context(|| {
        let flown_s = recorded.run.flown_s;
        format!("no message in this part: the flight lasted {flown_s:.2} s; choose another with --from and --for")
    })?;
    let left_out = reading.finish(&recorded.log.events).with_context(cannot)?;
    let no_clock = (cycles && recorded.scenario.run.mode == Mode::Inprocess)
        .then(|| "a flight in process has no clock, and so no cycles".to_owned());
    Ok(recorded.missing().into_iter().chain(left_out).chain(no_clock).collect())
}

/// Reading of a part of a log into a sink.
struct Reading<'a> {
    sink: Box<dyn Sink + 'a>,
    part: TimeSpan,
    sample_s: f64,
    /// `false` for a flight in process, which has no times.
    has_clock: bool,
    count: Count,
    /// TRUTH of the newest ticks, which comes before their other messages.
    samples: Samples,
    /// Newest counted message of each topic with the stamp before it, until the next one tells its CPU time.
    open: [Option<(Stamp, Stamp)>; Topic::COUNT],
    messages: u64,
}

impl<'a> Reading<'a> {
    const BEFORE_S: f64 = 1.0;

    fn new(sink: Box<dyn Sink + 'a>, part: TimeSpan, scenario: &Scenario) -> Self {
        let has_clock = scenario.run.mode != Mode::Inprocess;
        let (sample_s, count, samples) = (scenario.sample_s(), Count::default(), Samples::default());
        Self { sink, part, sample_s, has_clock, count, samples, open: [None; Topic::COUNT], messages: 0 }
    }

    fn message(&mut self, record: &Record) -> anyhow::Result<()> {
        self.samples.join(record);
        let tick = record.tick();
        if self.has(tick) {
            self.messages += 1;
            self.sink.message(record, self.samples.truth(tick))?;
        }
        let before = self.count.before(record).filter(|_| self.has_clock);
        let (Some(before), Some((topic, stamp))) = (before, record.stamped()) else { return Ok(()) };
        let finished = self.open[topic as usize].replace((*stamp, before));
        self.cycle(topic, finished.as_ref(), Some(stamp))
    }

    /// Adds a cycle that is finished: `after` is the stamp of the next message on its topic.
    fn cycle(&mut self, topic: Topic, cycle: Option<&(Stamp, Stamp)>, after: Option<&Stamp>) -> anyhow::Result<()> {
        let Some((stamp, before)) = cycle.filter(|(stamp, _)| self.has(stamp.tick)) else { return Ok(()) };
        let after = after.filter(|after| after.epoch == stamp.epoch);
        self.sink.cycle(topic, stamp, &CycleTimes::new(topic, stamp, before, after))
    }

    fn finish(mut self, events: &[Event]) -> anyhow::Result<Option<String>> {
        for topic in Topic::ALL {
            let last = self.open[topic as usize].take();
            self.cycle(topic, last.as_ref(), None)?;
        }
        let ticks = self.part.ticks(self.sample_s);
        events.iter().filter(|event| ticks.contains(&event.tick)).try_for_each(|event| self.sink.event(event))?;
        self.sink.finish()
    }

    fn has(&self, tick: u64) -> bool {
        self.part.ticks(self.sample_s).contains(&tick)
    }
}
