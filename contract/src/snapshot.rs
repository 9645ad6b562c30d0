//! What a node remembers from tick to tick, as plain words: for the process that continues its work.
//!
//! ```text
//! word 0   layout    which node, and which version of its layout
//! word 1   checksum  of all others
//! word 2.. contents  the bytes of the node's memory, then zeros
//! ```
//!
//! A snapshot is read as a whole or refused: one of another node or version, a torn one, and one with a number that is
//! not finite.

use bytemuck::{Pod, Zeroable};

use crate::integrity::checksum;

/// Words of a snapshot: as many as the largest memory has, that of attitude-mpc, and the two before it.
pub const SNAPSHOT_WORDS: usize = 128;

/// Words that the memory of the plant takes at most; what is in them is the plant's affair.
pub const PLANT_WORDS: usize = 1024;

/// A node's memory, packed.
pub type Snapshot = [u64; SNAPSHOT_WORDS];

/// The first word of the contents.
const CONTENTS: usize = 2;

/// A node's memory: a fixed layout of `f64` and of counts below 2^62, so that every word is finite when read as `f64`.
pub trait Layout: Pod {
    /// Eight letters that name the node and the version of its layout.
    const NAME: [u8; 8];
    /// Words of the contents. The memory fits into a snapshot, and is made of whole words.
    const WORDS: usize = {
        assert!(size_of::<Self>().is_multiple_of(8) && size_of::<Self>() / 8 <= SNAPSHOT_WORDS - CONTENTS);
        size_of::<Self>() / 8
    };
}

/// The snapshot of `memory`.
pub fn pack<M: Layout>(memory: &M) -> Snapshot {
    let mut words = [0; SNAPSHOT_WORDS];
    words[0] = u64::from_be_bytes(M::NAME);
    bytemuck::cast_slice_mut(&mut words[CONTENTS..CONTENTS + M::WORDS]).copy_from_slice(bytemuck::bytes_of(memory));
    words[1] = checksum(&words);
    words
}

/// The memory in a `snapshot`; `None` refuses it.
pub fn unpack<M: Layout>(snapshot: &Snapshot) -> Option<M> {
    let contents = &snapshot[CONTENTS..CONTENTS + M::WORDS];
    let unsigned = {
        let mut words = *snapshot;
        words[1] = 0;
        words
    };
    let is_intact = snapshot[0] == u64::from_be_bytes(M::NAME) && snapshot[1] == checksum(&unsigned);
    let is_finite = contents.iter().all(|word| f64::from_bits(*word).is_finite());
    (is_intact && is_finite).then(|| bytemuck::pod_read_unaligned(bytemuck::cast_slice(contents)))
}

/// A tick, or none, in one word: the tick plus one, 0 for none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(transparent)]
pub struct OptionalTick(u64);

impl OptionalTick {
    /// This tick.
    pub fn some(tick: u64) -> Self {
        Self(tick.saturating_add(1))
    }

    /// The tick, if there is one.
    pub fn get(self) -> Option<u64> {
        self.0.checked_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    #[repr(C)]
    struct Sample {
        tick: OptionalTick,
        count: u64,
        numbers: [f64; 3],
    }

    impl Layout for Sample {
        const NAME: [u8; 8] = *b"sample 1";
    }

    #[derive(Debug, Clone, Copy, Pod, Zeroable)]
    #[repr(transparent)]
    struct Other(Sample);

    impl Layout for Other {
        const NAME: [u8; 8] = *b"sample 2";
    }

    const SAMPLE: Sample = Sample { tick: OptionalTick(8), count: 3, numbers: [-0.0, 1.5, f64::MIN_POSITIVE] };

    #[test]
    fn what_was_packed_is_unpacked_bit_by_bit() {
        let read: Sample = unpack(&pack(&SAMPLE)).unwrap();
        assert_eq!(bytemuck::bytes_of(&read), bytemuck::bytes_of(&SAMPLE));
        assert_eq!((read.tick.get(), OptionalTick::some(7), OptionalTick::default().get()), (Some(7), read.tick, None));
    }

    #[test]
    fn snapshots_of_another_layout_empty_and_torn_ones_are_refused() {
        assert!(unpack::<Other>(&pack(&SAMPLE)).is_none());
        assert!(unpack::<Sample>(&[0; SNAPSHOT_WORDS]).is_none());
        let later = pack(&Sample { count: 4, ..SAMPLE });
        for torn_at in 1..SNAPSHOT_WORDS {
            let mut torn = pack(&SAMPLE);
            torn[torn_at..].copy_from_slice(&later[torn_at..]);
            let is_intact = torn == pack(&SAMPLE) || torn == later;
            assert_eq!(unpack::<Sample>(&torn).is_some(), is_intact, "torn at word {torn_at}");
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for place in 0..3 {
                let mut sample = SAMPLE;
                sample.numbers[place] = bad;
                assert_eq!(unpack::<Sample>(&pack(&sample)), None);
            }
        }
    }
}
