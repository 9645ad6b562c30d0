//! Reads a flight log back, whether it is complete, torn or damaged.

use std::{
    collections::{BTreeMap, HashMap},
    io::Read,
    iter::Peekable,
    path::Path,
};

use anyhow::{Context, bail, ensure};
use contract::message::{Actuators, Controls, LAYOUT, Reference, State, Truth};
use folder::files;
use mcap::{
    McapError, parse_record,
    records::{Record as McapRecord, op},
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};
use settings::file::MAX_LOG_BYTES;

use super::index::{ALL, LogSpan, Parts, WantedRecords};
use super::lz4::Lz4;
use super::{EVENTS, MEMORY, Memory, Record, SCENARIO, WRITTEN_BY, order, schema};
use crate::event::Event;
use crate::limits::{MAX_EVENTS, MAX_RECORD_BYTES};
use crate::provenance::{Git, ProgramIdentity};

/// Program and run that wrote a log.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WrittenBy {
    pub program: ProgramIdentity,
    /// Layout of the log's messages, as in [`LAYOUT`].
    pub layout: String,
    /// Name of the run, the same in each log of the run.
    pub run: String,
}

impl WrittenBy {
    fn of(mut keys: BTreeMap<String, String>) -> Self {
        let mut text = |key| keys.remove(key).unwrap_or_default();
        let git = Git { commit: text("commit"), changed: text("changed") == "true" };
        let program = ProgramIdentity { version: text("version"), git: Some(git).filter(|git| !git.commit.is_empty()) };
        Self { program, layout: text("layout"), run: text("run") }
    }

    /// Returns a note for users that another program wrote the log, or may have written it; `None` if this program is
    /// known to have written it.
    pub fn other_program(&self) -> Option<String> {
        let this = ProgramIdentity::this();
        (!self.program.is_same(&this)).then(|| format!("the log was written by {}, and this is {this}", self.program))
    }

    /// Checks that the messages are laid out as in this program; otherwise other values would be read than were
    /// written.
    ///
    /// # Errors
    /// Fails if the layouts differ; the error names both versions and both layouts.
    pub fn check_layout(&self) -> anyhow::Result<()> {
        let (this, layout) = (ProgramIdentity::this(), LAYOUT.join(" "));
        let Self { program, layout: theirs, .. } = self;
        ensure!(
            *theirs == layout,
            "the log is of another layout: it was written by {program}, whose messages are laid out as {theirs}; this is {this}, \
             which reads {layout}. Read it with the program of that version"
        );
        Ok(())
    }
}

/// A flight log. The messages of each type are in the order of writing; the lists are empty if the messages were not
/// kept.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Log {
    /// The run's merged settings.
    pub scenario_toml: String,
    pub written_by: WrittenBy,
    pub states: Vec<State>,
    pub references: Vec<Reference>,
    pub controls: Vec<Controls>,
    pub actuators: Vec<Actuators>,
    pub truths: Vec<Truth>,
    /// Events of the processes.
    pub events: Vec<Event>,
    /// Reason why reading stopped before the footer: the log's writer was killed, or the file is damaged. Everything
    /// before the defect was read, and its checksums fit.
    pub defect: Option<String>,
}

impl Log {
    /// Returns all messages tick by tick, within a tick TRUTH first and then in the ring's order. Messages of one type
    /// keep their order of writing.
    pub fn tick_by_tick(&self) -> impl Iterator<Item = Record> {
        fn all<M: Copy + Into<Record>>(messages: &[M]) -> Peekable<Box<dyn Iterator<Item = Record> + '_>> {
            let records: Box<dyn Iterator<Item = Record>> = Box::new(messages.iter().map(|message| (*message).into()));
            records.peekable()
        }
        let Self { states, references, controls, actuators, truths, .. } = self;
        let mut by_kind = [all(states), all(references), all(controls), all(actuators), all(truths)];
        std::iter::from_fn(move || {
            let ticks = by_kind.each_mut().map(|records| records.peek().map(order::tick));
            by_kind[order::next(ticks)?].next()
        })
    }

    /// Returns whether the log was finished and every checksum fits.
    pub fn complete(&self) -> bool {
        self.defect.is_none()
    }

    /// Appends a message.
    pub fn push(&mut self, record: &Record) {
        match *record {
            Record::State(message) => self.states.push(message),
            Record::Reference(message) => self.references.push(message),
            Record::Controls(message) => self.controls.push(message),
            Record::Actuators(message) => self.actuators.push(message),
            Record::Truth(message) => self.truths.push(message),
        }
    }
}

/// Reads the log at `path` into memory, up to the first defect; an error if the defect comes before the scenario.
pub fn read(path: &Path) -> anyhow::Result<Log> {
    let mut messages = Log::default();
    let Log { scenario_toml, written_by, events, defect, .. } =
        read_in_order(path, ALL, |_, record| messages.push(record))?;
    Ok(Log { scenario_toml, written_by, events, defect, ..messages })
}

/// Reads the log at `path`. Its messages are not kept: `each` gets those of the `span` one by one, in the order of
/// writing, with the log as read so far, which has the scenario and the origin of the log already.
pub fn read_in_order(path: &Path, span: LogSpan, mut each: impl FnMut(&Log, &Record)) -> anyhow::Result<Log> {
    walk(path, &WantedRecords::Messages(span), |log, found| {
        if let Found::Message(record) = found {
            each(log, record);
        }
    })
}

/// Reads the snapshots in the `span` of the log at `path`, up to a defect; `each` gets each of them with the log as
/// read so far.
pub fn read_memories(path: &Path, span: LogSpan, mut each: impl FnMut(&Log, Memory)) -> anyhow::Result<()> {
    let read = walk(path, &WantedRecords::Memories(span), |log, found| {
        if let Found::Memory(memory) = found {
            each(log, memory);
        }
    });
    read.map(drop)
}

/// Record that is passed on to the caller.
enum Found<'a> {
    Message(&'a Record),
    Memory(Memory),
}

/// Reads what is `wanted` of the log at `path`; `each` gets each record found, with the log as read so far.
fn walk(path: &Path, wanted: &WantedRecords, each: impl FnMut(&Log, Found)) -> anyhow::Result<Log> {
    let cannot_read = || format!("cannot read {}", path.display());
    let (file, size) = files::open(path, MAX_LOG_BYTES).with_context(cannot_read)?;
    let mut file = Parts::of(file, size, wanted).with_context(cannot_read)?;
    let mut mcap = LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_record_length_limit(MAX_RECORD_BYTES) // a longer record is damage
            .with_prevalidate_chunk_crcs(true)
            .with_validate_data_section_crc(file.is_all())
            .with_validate_summary_section_crc(true),
    );
    mcap.add_decompressor(Lz4::default())?;
    let mut contents = Contents {
        each,
        wanted,
        log: Log::default(),
        has_scenario: false,
        schemas: HashMap::new(),
        channels: HashMap::new(),
        events: None,
        memory: None,
    };
    contents.log.defect = loop {
        match mcap.next_event() {
            None => break None,
            Some(Ok(LinearReadEvent::ReadRequest(bytes))) => {
                let count = file.read(mcap.insert(bytes)).with_context(cannot_read)?;
                mcap.notify_read(count);
            }
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                if let Err(error) = contents.take(opcode, data) {
                    break Some(format!("{error:#}"));
                }
            }
            Some(Err(McapError::UnsupportedCompression(name))) => bail!(
                "cannot read {}: another program has compressed it with {name}; only lz4 is read, which \
                 `mcap compress --compression lz4` writes",
                path.display()
            ),
            Some(Err(error)) => break Some(error.to_string()),
        }
    };
    if !contents.has_scenario {
        let reason = contents.log.defect.as_deref().unwrap_or("it holds no scenario");
        bail!("{} is not a flight log: {reason}", path.display());
    }
    Ok(contents.log)
}

/// State of a reading: the log as read so far, and the meaning of its channel numbers.
struct Contents<'a, F> {
    /// Called with each message and snapshot that is wanted.
    each: F,
    wanted: &'a WantedRecords,
    /// Log as read so far, without these messages and snapshots.
    log: Log,
    has_scenario: bool,
    /// Kinds of messages by the number of the schema, and by the number of the channel.
    schemas: HashMap<u16, usize>,
    channels: HashMap<u16, usize>,
    events: Option<u16>,
    memory: Option<u16>,
}

impl<F: FnMut(&Log, Found)> Contents<'_, F> {
    /// Takes in one record; irrelevant kinds are not parsed.
    fn take(&mut self, opcode: u8, data: &[u8]) -> anyhow::Result<()> {
        if !matches!(opcode, op::METADATA | op::SCHEMA | op::CHANNEL | op::MESSAGE) {
            return Ok(());
        }
        match parse_record(opcode, data)? {
            McapRecord::Metadata(mut record) if record.name == SCENARIO.0 && !self.has_scenario => {
                self.log.scenario_toml = record.metadata.remove(SCENARIO.1).context("the scenario record is empty")?;
                self.has_scenario = true;
            }
            McapRecord::Metadata(record) if record.name == WRITTEN_BY => {
                self.log.written_by = WrittenBy::of(record.metadata);
            }
            McapRecord::Schema { header, .. } => {
                let kind = schema::MESSAGES.iter().position(|name| header.name == *name);
                self.schemas.extend(kind.map(|kind| (header.id, kind)));
            }
            McapRecord::Channel(channel) => {
                let kind = self.schemas.get(&channel.schema_id);
                self.channels.extend(kind.map(|&kind| (channel.id, kind)));
                match channel.topic.as_str() {
                    EVENTS => self.events = Some(channel.id),
                    MEMORY => self.memory = Some(channel.id),
                    _ => {}
                }
            }
            McapRecord::Message { header, data } => {
                if let Some(&kind) = self.channels.get(&header.channel_id) {
                    ensure!(self.has_scenario, "a message stands before the scenario");
                    if matches!(self.wanted, WantedRecords::Messages(span) if span.contains(&header.log_time)) {
                        (self.each)(&self.log, Found::Message(&schema::decode(kind, &data)?));
                    }
                } else if self.memory == Some(header.channel_id) {
                    if matches!(self.wanted, WantedRecords::Memories(span) if span.contains(&header.log_time)) {
                        let memory = schema::decode_memory(&data).context("a snapshot cannot be read")?;
                        (self.each)(&self.log, Found::Memory(memory));
                    }
                } else if self.events == Some(header.channel_id) {
                    ensure!(self.log.events.len() < MAX_EVENTS, "it has more than {MAX_EVENTS} events");
                    self.log.events.push(schema::decode_event(&data).context("an event cannot be read")?);
                }
            }
            _ => {}
        }
        Ok(())
    }
}
