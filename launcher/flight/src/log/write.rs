//! Writes the flight log so that the part on the disk can be read even if the writer dies.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufWriter, Seek},
    path::{Path, PathBuf},
    time::{Instant, SystemTime, UNIX_EPOCH},
};

use anyhow::Context;
use contract::message::LAYOUT;
use folder::files;
use mcap::{
    McapError, McapResult, WriteOptions, Writer,
    records::{MessageHeader, Metadata},
};

use super::lz4::Compressor;
use super::{Channel, Memory, Record, SCENARIO, WRITTEN_BY, schema};
use crate::event::Event;
use crate::limits::{CHUNK_BYTES, FLUSH_PERIOD};
use crate::provenance::{Git, ProgramIdentity};

type Mcap = Writer<Compressor<BufWriter<File>>>;

/// The log of a run that is being flown.
///
/// The first write error ends the log, not the run: it is returned once, the file is cut back to its last complete
/// chunk, and later calls do nothing.
pub struct LogWriter {
    path: PathBuf,
    /// `None` after an error.
    mcap: Option<Mcap>,
    /// Handle of the file that `mcap` writes, used to read its length and to cut it.
    file: File,
    /// Channel number of each [kind](Record::kind) of message.
    channels: [u16; Record::KINDS],
    events: u16,
    memory: u16,
    /// Sample time \[ns\].
    sample_ns: u64,
    /// Bytes of messages in the open chunk, and its newest log time.
    open_bytes: usize,
    newest_ns: u64,
    /// Length and log time up to which the file holds complete chunks, and the instant of the last flush.
    whole_bytes: u64,
    whole_ns: u64,
    flushed: Instant,
}

impl LogWriter {
    /// Creates or replaces the file at `path`, the only log of its run. The run's merged settings are its first record.
    /// Log time is simulated: ticks times `sample_ns`.
    pub fn create(path: &Path, scenario_toml: &str, sample_ns: u64) -> anyhow::Result<Self> {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self::create_part(path, scenario_toml, sample_ns, &format!("{}-{}", since.as_nanos(), std::process::id()))
    }

    /// Does the same as [`Self::create`] for one of several logs of `run`; all of them carry the name `run`.
    pub fn create_part(path: &Path, scenario_toml: &str, sample_ns: u64, run: &str) -> anyhow::Result<Self> {
        let cannot_create = || format!("cannot create {}", path.display());
        Self::begin(files::create(path).with_context(cannot_create)?, path, scenario_toml, sample_ns, run)
    }

    /// Begins the log in a `file` that is open and empty; errors name it `path`.
    pub fn begin(file: File, path: &Path, scenario_toml: &str, sample_ns: u64, run: &str) -> anyhow::Result<Self> {
        let cannot_create = || format!("cannot create {}", path.display());
        let sink = BufWriter::with_capacity(2 * CHUNK_BYTES, file.try_clone().with_context(cannot_create)?);
        let (mcap, channels, [events, memory]) =
            open(sink, scenario_toml, sample_ns, run).map_err(plain).with_context(cannot_create)?;
        let mut writer = Self {
            path: path.into(),
            mcap: Some(mcap),
            file,
            channels,
            events,
            memory,
            sample_ns,
            open_bytes: 0,
            newest_ns: 0,
            whole_bytes: 0,
            whole_ns: 0,
            flushed: Instant::now(),
        };
        writer.flush()?;
        Ok(writer)
    }

    /// Adds a channel of the caller's own, and returns its number for [`Self::write_encoded`].
    pub fn add_channel(&mut self, channel: &Channel) -> anyhow::Result<u16> {
        self.mcap.as_mut().map_or(Ok(0), |mcap| add_channel(mcap, channel).map_err(plain))
    }

    /// Writes the bytes of a message of a channel from [`Self::add_channel`], with its simulated time \[ns\].
    pub fn write_encoded(&mut self, channel_id: u16, log_time: u64, bytes: &[u8]) -> anyhow::Result<()> {
        self.append(&MessageHeader { channel_id, sequence: 0, log_time, publish_time: 0 }, bytes)
    }

    pub fn write(&mut self, record: &Record) -> anyhow::Result<()> {
        let (sequence, publish_time) = match record {
            Record::Truth(truth) => (truth.sequence, 0),
            _ => record.stamped().map_or((0, 0), |(topic, stamp)| (stamp.sequence, stamp.publish_ns[topic as usize])),
        };
        let header = MessageHeader {
            channel_id: self.channels[record.kind()],
            sequence: sequence as u32,
            log_time: self.log_time(record.tick()),
            publish_time,
        };
        self.append(&header, &schema::encode(record))
    }

    pub fn write_event(&mut self, event: &Event) -> anyhow::Result<()> {
        self.write_encoded(self.events, self.log_time(event.tick), &schema::encode_event(event))
    }

    /// Writes the snapshot of a node.
    pub fn write_memory(&mut self, memory: &Memory) -> anyhow::Result<()> {
        self.write_encoded(self.memory, self.log_time(memory.tick), &schema::encode_memory(memory))
    }

    fn log_time(&self, tick: u64) -> u64 {
        tick.saturating_mul(self.sample_ns)
    }

    fn append(&mut self, header: &MessageHeader, bytes: &[u8]) -> anyhow::Result<()> {
        let Some(mcap) = &mut self.mcap else { return Ok(()) };
        if let Err(error) = mcap.write_to_known_channel(header, bytes) {
            return Err(self.give_up(plain(error)));
        }
        self.open_bytes += bytes.len();
        self.newest_ns = self.newest_ns.max(header.log_time);
        if self.open_bytes >= CHUNK_BYTES || self.flushed.elapsed() >= FLUSH_PERIOD { self.flush() } else { Ok(()) }
    }

    /// Hands everything to the system, where a kill cannot lose it. [`Self::write`] does so after 64 KiB or a second.
    pub fn flush(&mut self) -> anyhow::Result<()> {
        let Some(mcap) = &mut self.mcap else { return Ok(()) };
        let reach = mcap.flush().map_err(plain).and_then(|()| Ok(self.file.stream_position()?));
        match reach {
            Ok(bytes) => self.whole_bytes = bytes,
            Err(error) => return Err(self.give_up(error)),
        }
        self.whole_ns = self.newest_ns;
        self.open_bytes = 0;
        self.flushed = Instant::now();
        Ok(())
    }

    /// Hands everything to the system, and waits until it is on the disk, where a loss of power cannot lose it.
    pub fn sync(&mut self) -> anyhow::Result<()> {
        self.flush()?;
        match self.file.sync_data() {
            Err(error) if self.mcap.is_some() => Err(self.give_up(error.into())),
            _ => Ok(()),
        }
    }

    /// Writes the index and the footer, which mark the log as complete. A writer that is dropped does so too, but
    /// cannot report an error.
    pub fn finish(mut self) -> anyhow::Result<()> {
        self.flush()?;
        let Some(mcap) = &mut self.mcap else { return Ok(()) };
        match mcap.finish() {
            Ok(_) => Ok(()),
            Err(error) => Err(self.give_up(plain(error))),
        }
    }

    /// Ends the log at its last complete chunk, and adds the time of this end to the error.
    pub fn give_up(&mut self, error: anyhow::Error) -> anyhow::Error {
        drop(self.mcap.take()); // dropped before the cut, because it may still write a torn chunk or a footer
        let torn = match self.file.set_len(self.whole_bytes) {
            Ok(()) => "",
            Err(_) => ", then torn", // readers accept a torn log
        };
        let whole_s = self.whole_ns as f64 * 1e-9;
        error.context(format!("cannot write {}: the log is whole up to {whole_s:.2} s{torn}", self.path.display()))
    }
}

/// Starts the file: settings first, then the schemas and channels (in the first chunk), of events and snapshots last.
fn open(
    sink: BufWriter<File>,
    scenario_toml: &str,
    sample_ns: u64,
    run: &str,
) -> McapResult<(Mcap, [u16; Record::KINDS], [u16; 2])> {
    let ProgramIdentity { version, git } = ProgramIdentity::this();
    let Git { commit, changed } = git.unwrap_or_default();
    let mut mcap = WriteOptions::new()
        .compression(None) // `Compressor` compresses the chunks
        .chunk_size(None) // `LogWriter` closes the chunks
        .disable_seeking(true) // a chunk is written when it is complete, never patched
        .calculate_data_section_crc(false) // `Compressor` has these checksums
        .calculate_summary_section_crc(false)
        .library(concat!("trefoil ", env!("CARGO_PKG_VERSION")))
        .create(Compressor::new(sink))?;
    mcap.write_metadata(&metadata(SCENARIO.0, &[(SCENARIO.1, scenario_toml)]))?;
    mcap.write_metadata(&metadata(
        WRITTEN_BY,
        &[
            ("version", &version),
            ("commit", &commit),
            ("changed", &changed.to_string()),
            ("layout", &LAYOUT.join(" ")),
            ("run", run),
            ("log_time", &format!("simulated time: stamp.tick times {sample_ns} ns")),
            ("publish_time", "CLOCK_MONOTONIC of the publication; 0 for TRUTH, and in process"),
        ],
    ))?;
    mcap.flush()?;
    let (mut channels, mut others) = ([0; Record::KINDS], [0; 2]);
    for (number, channel) in channels.iter_mut().chain(&mut others).zip(super::channels()) {
        *number = add_channel(&mut mcap, &channel)?;
    }
    Ok((mcap, channels, others))
}

fn add_channel(mcap: &mut Mcap, channel: &Channel) -> McapResult<u16> {
    let schema = mcap.add_schema(channel.schema, "protobuf", channel.descriptors)?;
    let publisher = BTreeMap::from([("publisher".into(), channel.publisher.into())]);
    mcap.add_channel(schema, &channel.topic, "protobuf", &publisher)
}

pub(super) fn metadata(name: &str, entries: &[(&str, &str)]) -> Metadata {
    let entries = entries.iter().map(|&(key, value)| (key.into(), value.into()));
    Metadata { name: name.into(), metadata: entries.collect() }
}

/// Returns the system's error of a failed write, without MCAP's text around it.
fn plain(error: McapError) -> anyhow::Error {
    match error {
        McapError::Io(error) => error.into(),
        error => error.into(),
    }
}
