//! The index at the end of a finished log tells which part of the file has which time. With the index, a part of a long
//! flight is read without the rest.

use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{BufReader, Read, Result, Seek, SeekFrom};
use std::ops::{Range, RangeInclusive};

use mcap::parse_record;
use mcap::read::LinearReader;
use mcap::records::{ChunkIndex, Record, op};

use super::{EVENTS, MEMORY};
use crate::limits::MAX_INDEX_BYTES;

/// A span of simulated time \[ns\], compared with the `log_time` of messages.
pub type LogSpan = RangeInclusive<u64>;
/// Span of a whole flight.
pub const ALL: LogSpan = 0..=u64::MAX;

/// Records that a reader wants of a log.
#[derive(Debug, Clone)]
pub enum WantedRecords {
    /// Messages of a span of time, and every event.
    Messages(LogSpan),
    /// Snapshots of the nodes in a span of time.
    Memories(LogSpan),
}

impl WantedRecords {
    fn has(&self, chunk: &ChunkIndex, topics: &HashMap<u16, String>) -> bool {
        let overlaps =
            |span: &LogSpan| chunk.message_start_time <= *span.end() && chunk.message_end_time >= *span.start();
        let holds = |topic| {
            chunk.message_index_offsets.keys().any(|channel| topics.get(channel).is_none_or(|known| known == topic))
        };
        match self {
            Self::Messages(span) => overlaps(span) || holds(EVENTS),
            Self::Memories(span) => overlaps(span) && holds(MEMORY),
        }
    }
}

/// Reader of a log file that leaves out some ranges of bytes.
pub struct Parts {
    file: BufReader<File>,
    at: u64,
    left_out: std::vec::IntoIter<Range<u64>>,
    next: Option<Range<u64>>,
}

impl Parts {
    /// Reads from a `file` of `size` bytes the parts that may hold `wanted` records; the whole file if it has no index.
    pub fn of(mut file: File, size: u64, wanted: &WantedRecords) -> Result<Self> {
        let left_out = match wanted {
            WantedRecords::Messages(span) if *span == ALL => None,
            _ => left_out(&mut file, size, wanted),
        };
        file.rewind()?;
        let mut left_out = left_out.unwrap_or_default().into_iter();
        let next = left_out.next();
        Ok(Self { file: BufReader::new(file), at: 0, left_out, next })
    }

    /// Returns whether nothing is left out from here on.
    pub fn is_all(&self) -> bool {
        self.next.is_none()
    }
}

impl Read for Parts {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let mut most = buffer.len();
        if let Some(next) = &self.next {
            if self.at == next.start {
                self.file.seek(SeekFrom::Start(next.end))?;
                self.at = next.end;
                self.next = self.left_out.next();
                return self.read(buffer);
            }
            most = most.min(usize::try_from(next.start - self.at).unwrap_or(usize::MAX));
        }
        let read = self.file.read(&mut buffer[..most])?;
        self.at += read as u64;
        Ok(read)
    }
}

/// Returns the byte ranges of unwanted chunks and their message indexes, in order; `None` without a consistent index.
fn left_out(file: &mut File, size: u64, wanted: &WantedRecords) -> Option<Vec<Range<u64>>> {
    let index = read_index(file, size)?;
    let records = || LinearReader::sans_magic(&index).map_while(std::result::Result::ok);
    let topics = records().filter_map(|record| match record {
        Record::Channel(channel) => Some((channel.id, channel.topic)),
        _ => None,
    });
    let topics: HashMap<u16, String> = topics.collect();
    let mut known = BTreeSet::new();
    let mut left_out: Vec<Range<u64>> = vec![];
    for record in records() {
        let Record::ChunkIndex(chunk) = record else { continue };
        // The first chunk of a channel is kept, because it may hold the channel record, and so is a chunk without
        // message index.
        let begins_one = chunk.message_index_offsets.keys().filter(|channel| known.insert(**channel)).count() > 0;
        if begins_one || chunk.message_index_offsets.is_empty() || wanted.has(&chunk, &topics) {
            continue;
        }
        let start = chunk.chunk_start_offset;
        let end = start.checked_add(chunk.chunk_length)?.checked_add(chunk.message_index_length)?;
        match left_out.last_mut() {
            Some(last) if last.end == start => last.end = end,
            Some(last) if last.end > start => return None,
            _ => left_out.push(start..end),
        }
    }
    left_out.last().is_none_or(|last| last.end <= size).then_some(left_out)
}

/// Reads the index of a file of `size` bytes, whose place the footer tells; `None` if the index is missing or too long.
fn read_index(file: &mut File, size: u64) -> Option<Vec<u8>> {
    /// Length of the footer \[bytes\]: opcode, length of the body, and three numbers.
    const FOOTER_BYTES: u64 = 1 + 8 + 20;
    let footer_at = size.checked_sub(FOOTER_BYTES + mcap::MAGIC.len() as u64)?;
    let mut footer = [0; FOOTER_BYTES as usize];
    file.seek(SeekFrom::Start(footer_at)).ok()?;
    file.read_exact(&mut footer).ok()?;
    let Ok(Record::Footer(found)) = parse_record(footer[0], &footer[9..]) else { return None };
    let length = footer_at.checked_sub(found.summary_start).filter(|length| *length <= MAX_INDEX_BYTES)?;
    if footer[0] != op::FOOTER || found.summary_start == 0 {
        return None;
    }
    let mut index = vec![0; length as usize];
    file.seek(SeekFrom::Start(found.summary_start)).ok()?;
    file.read_exact(&mut index).ok()?;
    Some(index)
}
