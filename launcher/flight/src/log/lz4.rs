//! Compression of the chunks of a log with LZ4, which MCAP's readers know. The crate `mcap` compresses only by
//! libraries in C; this module does it in Rust.

use std::collections::VecDeque;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom, Write};

use crc32fast::Hasher;
use lz4_flex::frame::{BlockSize, FrameDecoder, FrameEncoder, FrameInfo};
use mcap::records::op;
use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::{MAGIC, McapError, McapResult};

use crate::limits::MAX_RECORD_BYTES;

/// Name of the compression in the log.
const NAME: &str = "lz4";
/// Length of the head of a record \[bytes\]: opcode, and length of the body.
const HEAD: usize = 9;

/// Destination of an MCAP writer that compresses each chunk on its way to the `file`.
///
/// The writer must send chunks that are not compressed. When it asks for its position, it gets the position in the
/// file; lengths of chunks and checksums, which the writer cannot know, are corrected here. A chunk is written once it
/// is complete, so that a killed process leaves chunks that can be read.
pub struct Compressor<W> {
    file: W,
    /// Bytes written to the file.
    at: u64,
    /// Bytes of the record that is not complete yet.
    begun: Vec<u8>,
    /// Length of the record of each chunk, and of its compressed content \[bytes\], until they are in the index.
    chunks: VecDeque<(u64, u64)>,
    /// Checksum of the section of the file that is being written.
    sum: Hasher,
    /// `true` after the last record.
    has_ended: bool,
}

impl<W: Write> Compressor<W> {
    pub fn new(file: W) -> Self {
        Self { file, at: 0, begun: vec![], chunks: VecDeque::new(), sum: Hasher::new(), has_ended: false }
    }

    /// Returns the length of the record that has begun, if it is complete.
    fn complete(&self) -> Option<usize> {
        let length = match self.begun.get(1..HEAD) {
            _ if self.at == 0 || self.has_ended => MAGIC.len(),
            Some(length) => HEAD + u64::from_le_bytes(length.try_into().ok()?) as usize,
            None => return None,
        };
        (self.begun.len() >= length).then_some(length)
    }

    /// Writes a complete record in the form that it has in the compressed log.
    fn pass(&mut self, record: &[u8]) -> Result<()> {
        let body = record.get(HEAD..).unwrap_or_default();
        match record[0] {
            op::CHUNK => {
                /// Bytes of the times, the length and the checksum of the content; the name of the compression follows.
                const TOLD: usize = 8 + 8 + 8 + 4;
                let content = compress(&body[TOLD + 4 + 8..])?;
                let length = content.len() as u64;
                let body = [&body[..TOLD], &name(), &length.to_le_bytes(), &content].concat();
                self.chunks.push_back(((HEAD + body.len()) as u64, length));
                self.emit_record(op::CHUNK, &body)
            }
            op::CHUNK_INDEX => {
                /// Bytes of the times and the offset; the length of the record follows.
                const BEFORE: usize = 8 + 8 + 8;
                /// Bytes of the empty name of the compression, and of the compressed and the true length of the
                /// content.
                const AFTER: usize = 4 + 8 + 8;
                let next = self.chunks.pop_front(); // the index has the order of the chunks
                let (length, compressed) =
                    next.ok_or_else(|| Error::other("an index of more chunks than there are"))?;
                let (rest, after) = body[BEFORE + 8..].split_at(body.len() - BEFORE - 8 - AFTER);
                let (length, compressed) = (length.to_le_bytes(), compressed.to_le_bytes());
                let body = [&body[..BEFORE], &length, rest, &name(), &compressed, &after[4 + 8..]].concat();
                self.emit_record(op::CHUNK_INDEX, &body)
            }
            op::DATA_END => {
                let sum = std::mem::take(&mut self.sum).finalize();
                self.emit_record(op::DATA_END, &sum.to_le_bytes())?;
                self.sum = Hasher::new(); // the sum of the summary begins behind this record
                Ok(())
            }
            op::FOOTER => {
                let (told, _) = record.split_at(record.len() - 4);
                self.sum.update(told);
                let sum = std::mem::take(&mut self.sum).finalize();
                self.has_ended = true;
                self.emit(&[told, &sum.to_le_bytes()].concat())
            }
            _ => self.emit(record),
        }
    }

    fn emit_record(&mut self, opcode: u8, body: &[u8]) -> Result<()> {
        self.emit(&[opcode])?;
        self.emit(&(body.len() as u64).to_le_bytes())?;
        self.emit(body)
    }

    fn emit(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes)?;
        self.at += bytes.len() as u64;
        self.sum.update(bytes);
        Ok(())
    }
}

impl<W: Write> Write for Compressor<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.begun.extend_from_slice(bytes);
        while let Some(length) = self.complete() {
            let rest = self.begun.split_off(length);
            let record = std::mem::replace(&mut self.begun, rest);
            self.pass(&record)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        self.file.flush()
    }
}

/// Returns the position; a seek to any other position fails.
impl<W: Write> Seek for Compressor<W> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.at + self.begun.len() as u64),
            _ => Err(ErrorKind::Unsupported.into()),
        }
    }
}

/// Returns the name of the compression as a string of the format.
fn name() -> [u8; 4 + NAME.len()] {
    let length = (NAME.len() as u32).to_le_bytes();
    std::array::from_fn(|i| *length.get(i).unwrap_or_else(|| &NAME.as_bytes()[i - length.len()]))
}

fn compress(bytes: &[u8]) -> Result<Vec<u8>> {
    let mut frame = FrameEncoder::with_frame_info(FrameInfo::new().block_size(BlockSize::Max256KB), vec![]);
    frame.write_all(bytes)?;
    Ok(frame.finish()?)
}

/// Decompresses chunks, each as a whole.
#[derive(Default)]
pub struct Lz4 {
    content: Vec<u8>,
    /// Number of bytes of the content that were handed on.
    taken: usize,
}

impl Decompressor for Lz4 {
    fn next_read_size(&self) -> usize {
        usize::MAX // the reader limits it to the chunk
    }

    fn decompress(&mut self, src: &[u8], dst: &mut [u8]) -> McapResult<DecompressResult> {
        if !src.is_empty() {
            let mut frame = FrameDecoder::new(src).take(MAX_RECORD_BYTES as u64);
            let read = frame.read_to_end(&mut self.content);
            read.map_err(|error| McapError::DecompressionError(error.to_string()))?;
        }
        let rest = &self.content[self.taken..];
        let wrote = rest.len().min(dst.len());
        dst[..wrote].copy_from_slice(&rest[..wrote]);
        self.taken += wrote;
        Ok(DecompressResult { consumed: src.len(), wrote })
    }

    fn reset(&mut self) -> McapResult<()> {
        self.content.clear();
        self.taken = 0;
        Ok(())
    }

    fn name(&self) -> &'static str {
        NAME
    }
}

#[cfg(test)]
mod tests {
    use lz4_flex::frame::BlockMode;

    use super::*;

    #[test]
    fn frames_of_other_programs_are_read_into_any_buffer() {
        let content: Vec<u8> = (0..300_000_u32).flat_map(|n| (n / 7).to_le_bytes()).collect();
        let linked = FrameInfo::new().block_mode(BlockMode::Linked).block_size(BlockSize::Max64KB);
        for info in [linked.block_checksums(true).content_checksum(true), FrameInfo::new()] {
            let mut frame = FrameEncoder::with_frame_info(info.content_size(Some(content.len() as u64)), vec![]);
            frame.write_all(&content).unwrap();
            let mut src = &frame.finish().unwrap()[..];
            let mut lz4 = Lz4::default();
            let mut read: Vec<u8> = vec![];
            while read.len() < content.len() {
                let mut dst = [0; 1000];
                let DecompressResult { consumed, wrote } = lz4.decompress(src, &mut dst).unwrap();
                assert!(wrote > 0);
                read.extend(&dst[..wrote]);
                src = &src[consumed..];
            }
            assert!(read == content);
        }
    }
}
