//! Two pipes of words in memory that two processes share. Written words stay readable when the writer crashes, and a
//! write costs no system call.

use std::fs::File;
use std::io;
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::fs::{MemfdFlags, ftruncate, memfd_create};

use super::mapping::{Mapping, Shared};
use crate::realtime::Doorbell;

/// Number of words that a pipe holds: about 250 samples of a flight with all their messages.
const WORDS: usize = 1 << 16;

/// Pipe with one writer and one reader.
#[repr(C)]
pub struct WordPipe {
    /// Number of words written since the beginning.
    written: AtomicU64,
    /// Number of words read since the beginning.
    read: AtomicU64,
    /// Doorbell that the writer rings to wake the reader.
    words_came: Doorbell,
    /// Doorbell that the reader rings after it has read.
    room_came: Doorbell,
    words: [AtomicU64; WORDS],
}

/// Pipes of a process and a child that works for it.
#[repr(C)]
pub struct Pipes {
    /// Pipe from the parent to the child.
    pub requests: WordPipe,
    /// Pipe from the child to the parent.
    pub answers: WordPipe,
}

impl WordPipe {
    /// Writes as many of `words` as there is room for, and returns how many.
    pub fn write(&self, words: &[u64]) -> usize {
        let written = self.written.load(Ordering::Relaxed);
        let held = written.wrapping_sub(self.read.load(Ordering::Acquire)) as usize;
        let count = words.len().min(WORDS.saturating_sub(held));
        for (at, word) in (written..).zip(&words[..count]) {
            self.words[at as usize % WORDS].store(*word, Ordering::Relaxed);
        }
        self.written.store(written.wrapping_add(count as u64), Ordering::Release);
        count
    }

    /// Appends all words that were written to `words`, and returns how many.
    pub fn read(&self, words: &mut Vec<u64>) -> usize {
        let read = self.read.load(Ordering::Relaxed);
        let count = (self.written.load(Ordering::Acquire).wrapping_sub(read) as usize).min(WORDS);
        let new = (read..).take(count).map(|at| self.words[at as usize % WORDS].load(Ordering::Relaxed));
        words.extend(new);
        self.read.store(read.wrapping_add(count as u64), Ordering::Release);
        if count > 0 {
            self.room_came.ring();
        }
        count
    }

    /// Wakes the reader.
    pub fn wake_reader(&self) {
        self.words_came.ring();
    }

    /// Sleeps until the writer wakes the reader, or `deadline_ns` (`CLOCK_MONOTONIC`) has passed; not at all if there
    /// are words to read.
    pub fn wait_for_words(&self, deadline_ns: u64) {
        let seen = self.words_came.count();
        if self.written.load(Ordering::Acquire) == self.read.load(Ordering::Relaxed) {
            self.words_came.wait(seen, deadline_ns);
        }
    }

    /// Sleeps until the reader has read, or `deadline_ns` (`CLOCK_MONOTONIC`) has passed; not at all if there is room.
    pub fn wait_for_room(&self, deadline_ns: u64) {
        let seen = self.room_came.count();
        let held = self.written.load(Ordering::Relaxed).wrapping_sub(self.read.load(Ordering::Acquire));
        if held as usize >= WORDS {
            self.room_came.wait(seen, deadline_ns);
        }
    }
}

// SAFETY: both pipes are made of atomics only.
unsafe impl Shared for Pipes {}

/// Mapping of two pipes.
pub type SharedPipes = Mapping<Pipes>;

impl SharedPipes {
    /// Creates the pipes in memory that has no name; the file is for the child.
    pub fn create() -> io::Result<(Self, File)> {
        let file = File::from(memfd_create(c"trefoil-pipes", MemfdFlags::CLOEXEC)?);
        ftruncate(&file, Self::BYTES as u64)?;
        Ok((Self::of(&file)?, file))
    }

    /// Maps the pipes that the parent has created.
    ///
    /// # Errors
    /// `file` is not of the size of such pipes.
    pub fn open(file: impl AsFd) -> io::Result<Self> {
        if rustix::fs::fstat(&file)?.st_size != Self::BYTES as i64 {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "not the pipes of a launcher"));
        }
        Self::of(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_arrive_in_order_and_no_more_are_taken_than_there_is_room_for() {
        let (ours, file) = SharedPipes::create().unwrap();
        let theirs = SharedPipes::open(&file).unwrap();
        let words: Vec<u64> = (0..3 * WORDS as u64).collect();
        let (mut sent, mut read) = (0, vec![]);
        while sent < words.len() {
            sent += ours.requests.write(&words[sent..words.len().min(sent + 40_000)]);
            assert!(sent - read.len() <= WORDS);
            if ours.requests.write(&[]) == 0 && sent - read.len() > WORDS / 2 {
                theirs.requests.read(&mut read);
            }
        }
        theirs.requests.read(&mut read);
        assert_eq!(read, words);
        assert_eq!(theirs.answers.read(&mut read), 0, "the other pipe is empty");
    }

    #[test]
    fn other_files_are_no_pipes() {
        assert!(SharedPipes::open(tempfile::tempfile().unwrap()).is_err());
    }
}
