//! What a node remembers from tick to tick, as plain words: for the process that continues its work.
//!
//! ```text
//! word 0   layout    which node, and which version of its layout
//! word 1   checksum  of all others
//! word 2.. contents  numbers as their bits, zero after the last
//! ```
//!
//! Nothing of a snapshot is used before all of it was read: one of another node or version, a torn one and one with a
//! number that is none are refused.

use crate::integrity::checksum;

/// Words of a snapshot, enough for every node: attitude-mpc needs 48 and more for the constraints it starts from.
pub const SNAPSHOT_WORDS: usize = 128;

/// A node's memory.
pub type Snapshot = [u64; SNAPSHOT_WORDS];

/// Where the contents begin.
const CONTENTS: usize = 2;

/// Fills a snapshot, word by word.
#[derive(Debug, Clone)]
pub struct Writer {
    words: Snapshot,
    next: usize,
}

impl Writer {
    /// An empty snapshot of a `layout`: eight letters that name node and version.
    pub fn new(layout: [u8; 8]) -> Self {
        let mut words = [0; SNAPSHOT_WORDS];
        words[0] = u64::from_be_bytes(layout);
        Self { words, next: CONTENTS }
    }

    /// How many words are free.
    pub fn room(&self) -> usize {
        SNAPSHOT_WORDS.saturating_sub(self.next)
    }

    /// Adds a count, a tick, a set of flags.
    pub fn word(&mut self, word: u64) {
        if let Some(place) = self.words.get_mut(self.next) {
            *place = word;
        }
        self.next += 1;
    }

    /// Adds two words: whether there is one, and which.
    pub fn optional(&mut self, word: Option<u64>) {
        self.word(u64::from(word.is_some()));
        self.word(word.unwrap_or(0));
    }

    /// Adds numbers.
    pub fn numbers(&mut self, numbers: &[f64]) {
        for number in numbers {
            self.word(number.to_bits());
        }
    }

    /// The snapshot; should its words not have sufficed, one that everybody refuses.
    pub fn seal(mut self) -> Snapshot {
        if self.next > SNAPSHOT_WORDS {
            return [0; SNAPSHOT_WORDS];
        }
        self.words[1] = sum(&self.words);
        self.words
    }
}

/// Reads a snapshot in the order it was written; `None` is what refuses it.
#[derive(Debug, Clone)]
pub struct Reader<'a> {
    words: &'a Snapshot,
    next: usize,
}

impl<'a> Reader<'a> {
    /// Opens a snapshot of `layout` that is whole.
    pub fn open(layout: [u8; 8], words: &'a Snapshot) -> Option<Self> {
        let whole = words[0] == u64::from_be_bytes(layout) && words[1] == sum(words);
        whole.then_some(Self { words, next: CONTENTS })
    }

    /// The next word.
    pub fn word(&mut self) -> Option<u64> {
        let word = self.words.get(self.next).copied();
        self.next += 1;
        word
    }

    /// The next two words: whether there is one, and which.
    pub fn optional(&mut self) -> Option<Option<u64>> {
        let (present, word) = (self.word()?, self.word()?);
        (present <= 1).then_some((present == 1).then_some(word))
    }

    /// The next number, if it is one.
    pub fn number(&mut self) -> Option<f64> {
        self.word().map(f64::from_bits).filter(|number| number.is_finite())
    }

    /// The next `N` numbers.
    pub fn numbers<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Some(numbers)
    }
}

/// Over all words, the place of the checksum itself taken as 0.
fn sum(words: &Snapshot) -> u64 {
    let mut words = *words;
    words[1] = 0;
    checksum(&words)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYOUT: [u8; 8] = *b"sample 1";

    fn sample() -> Snapshot {
        let mut writer = Writer::new(LAYOUT);
        writer.word(7);
        writer.optional(None);
        writer.optional(Some(u64::MAX));
        writer.numbers(&[-0.0, 1.5, f64::MIN_POSITIVE]);
        writer.seal()
    }

    #[test]
    fn what_was_written_is_read() {
        let snapshot = sample();
        let mut reader = Reader::open(LAYOUT, &snapshot).unwrap();
        assert_eq!(reader.word(), Some(7));
        assert_eq!((reader.optional(), reader.optional()), (Some(None), Some(Some(u64::MAX))));
        let numbers = reader.numbers::<3>().unwrap();
        assert_eq!(numbers.map(f64::to_bits), [-0.0_f64, 1.5, f64::MIN_POSITIVE].map(f64::to_bits));
    }

    #[test]
    fn foreign_empty_and_torn_ones_are_refused() {
        assert!(Reader::open(*b"sample 2", &sample()).is_none());
        assert!(Reader::open(LAYOUT, &[0; SNAPSHOT_WORDS]).is_none());
        let mut later = Writer::new(LAYOUT);
        later.word(8);
        let later = later.seal();
        for torn_at in 1..SNAPSHOT_WORDS {
            let mut torn = sample();
            torn[torn_at..].copy_from_slice(&later[torn_at..]);
            let is_intact = torn == sample() || torn == later;
            assert_eq!(Reader::open(LAYOUT, &torn).is_some(), is_intact, "torn at word {torn_at}");
        }
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut writer = Writer::new(LAYOUT);
            writer.numbers(&[1.0, bad]);
            let snapshot = writer.seal();
            assert_eq!(Reader::open(LAYOUT, &snapshot).unwrap().numbers::<2>(), None);
        }
    }

    #[test]
    fn too_many_words_are_told_by_a_refusal() {
        let mut writer = Writer::new(LAYOUT);
        writer.numbers(&[1.0; SNAPSHOT_WORDS - CONTENTS]);
        assert_eq!(writer.room(), 0);
        assert!(Reader::open(LAYOUT, &writer.clone().seal()).is_some());
        writer.word(1);
        assert!(Reader::open(LAYOUT, &writer.seal()).is_none());
        let snapshot = sample();
        let mut reader = Reader::open(LAYOUT, &snapshot).unwrap();
        let read = std::iter::repeat_with(|| reader.word()).take_while(Option::is_some).count();
        assert_eq!(read, SNAPSHOT_WORDS - CONTENTS);
    }
}
