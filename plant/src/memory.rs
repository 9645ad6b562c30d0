//! State of the plant as words, for the log and for a replay that starts from this state.
//!
//! The same functions write the words and read them back, so that both have the same order. Values that follow from the
//! settings are left out.

use std::collections::VecDeque;

use bytemuck::Pod;
use rand_chacha::ChaCha8Rng;

/// First word of a memory: its type, and the version of its layout.
const NAME: u64 = u64::from_be_bytes(*b"vehicle6");

/// Cursor over the words of a memory.
pub struct Tape<'a> {
    words: &'a mut [u64],
    at: usize,
    reads: bool,
    fits: bool,
}

impl<'a> Tape<'a> {
    /// Begins to write `words`.
    pub fn to_write(words: &'a mut [u64]) -> Self {
        let mut tape = Self { words, at: 0, reads: false, fits: true };
        tape.value(&mut { NAME });
        tape
    }

    /// Begins to read `words`; words of another type or version make the memory invalid.
    pub fn to_read(words: &'a mut [u64]) -> Self {
        let mut tape = Self { words, at: 0, reads: true, fits: true };
        let mut name = 0;
        tape.value(&mut name);
        tape.fits &= name == NAME;
        tape
    }

    /// Returns the number of words so far; `None` if there was no room for all, or a value that was read is not valid.
    pub fn length(&self) -> Option<usize> {
        self.fits.then_some(self.at)
    }

    /// Returns whether values are read from the words.
    pub fn reads(&self) -> bool {
        self.reads
    }

    /// Marks the memory as invalid.
    pub fn refuse(&mut self) {
        self.fits = false;
    }

    /// Writes or reads words.
    pub fn words(&mut self, words: &mut [u64]) {
        match self.words.get_mut(self.at..self.at + words.len()) {
            Some(place) if self.reads => words.copy_from_slice(place),
            Some(place) => place.copy_from_slice(words),
            None => self.fits = false,
        }
        self.at += words.len();
    }

    /// Writes or reads a value that is made of whole words.
    pub fn value<T: Pod>(&mut self, value: &mut T) {
        self.words(bytemuck::cast_slice_mut(std::slice::from_mut(value)));
    }

    /// Writes or reads a count; refuses a count above `most`.
    pub fn count(&mut self, count: &mut usize, most: usize) {
        let mut word = *count as u64;
        self.value(&mut word);
        if word > most as u64 {
            self.refuse();
        } else {
            *count = word as usize;
        }
    }

    /// Writes or reads a boolean.
    pub fn flag(&mut self, flag: &mut bool) {
        let mut count = usize::from(*flag);
        self.count(&mut count, 1);
        *flag = count == 1;
    }

    /// Writes or reads an optional value, with `each` for the value.
    pub fn option<T: Default>(&mut self, value: &mut Option<T>, each: impl FnOnce(&mut Self, &mut T)) {
        let mut is_there = value.is_some();
        self.flag(&mut is_there);
        if is_there {
            each(self, value.get_or_insert_default());
        } else {
            *value = None;
        }
    }

    /// Writes or reads a queue of at most `most` items, with `each` for each item.
    pub fn queue<T: Default>(&mut self, queue: &mut VecDeque<T>, most: usize, mut each: impl FnMut(&mut Self, &mut T)) {
        let mut length = queue.len();
        self.count(&mut length, most.min(self.words.len()));
        queue.resize_with(length, T::default);
        for item in queue {
            each(self, item);
        }
    }

    /// Writes or reads the position of a random stream.
    pub fn random(&mut self, random: &mut ChaCha8Rng) {
        let drawn = random.get_word_pos();
        let mut words = [drawn as u64, (drawn >> 64) as u64];
        self.words(&mut words);
        if self.reads {
            random.set_word_pos(u128::from(words[1]) << 64 | u128::from(words[0]));
        }
    }
}
