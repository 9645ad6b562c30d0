//! Snapshots: the memory of a node as plain words, for the process that continues its work.
//!
//! ```text
//! word 0   layout    name of the node and version of its layout
//! word 1   checksum  of all other words
//! word 2.. contents  the bytes of the node's memory, then zeros
//! ```
//!
//! A snapshot is read as a whole or refused. It is refused if it is torn, comes from another node or version, or has a
//! number that is not finite.

use bytemuck::{Pod, Zeroable};

use crate::integrity::checksum_of;

/// Words of a snapshot: room for the largest memory, that of attitude-mpc, and the two words before it.
pub const SNAPSHOT_WORDS: usize = 300;

/// Largest number of words in the memory of the plant; their meaning is private to the plant. The room suffices for all
/// that the settings allow: the samples of an IMU of 1000 Hz over the latency of a receiver of 500 ms, and the readings
/// that a delayed sensor needs.
pub const PLANT_WORDS: usize = 48 * 1024;

/// Packed memory of a node.
pub type Snapshot = [u64; SNAPSHOT_WORDS];

/// Snapshot of a core that keeps no memory: the process after it begins cold.
pub const NO_MEMORY: Snapshot = [0; SNAPSHOT_WORDS];

/// Index of the first word of the contents.
const CONTENTS: usize = 2;

/// Largest memory in a snapshot \[byte\].
pub const MEMORY_BYTES: usize = 8 * (SNAPSHOT_WORDS - CONTENTS);

/// Memory of a node: a fixed layout of `f64` and of counts below 2^62, so that every word is finite when read as `f64`.
pub trait MemoryLayout: Pod {
    /// Name of the node and version of its layout, in eight letters.
    const NAME: [u8; 8];
    /// Number of words of the contents. The compiler checks that the memory fits into a snapshot, in whole words.
    const WORDS: usize = {
        assert!(size_of::<Self>().is_multiple_of(8) && size_of::<Self>() / 8 <= SNAPSHOT_WORDS - CONTENTS);
        size_of::<Self>() / 8
    };
}

/// Packs `memory` into a snapshot with layout and checksum.
pub fn pack<M: MemoryLayout>(memory: &M) -> Snapshot {
    pack_bytes(u64::from_be_bytes(M::NAME), bytemuck::bytes_of(memory))
}

/// Packs `memory` into a snapshot with `layout` and checksum; panics if it has more than [`MEMORY_BYTES`].
pub fn pack_bytes(layout: u64, memory: &[u8]) -> Snapshot {
    let mut words = [0; SNAPSHOT_WORDS];
    words[0] = layout;
    bytemuck::cast_slice_mut(&mut words[CONTENTS..])[..memory.len()].copy_from_slice(memory);
    words[1] = checksum_of(&words);
    words
}

/// Unpacks the memory in a `snapshot`; `None` if layout or checksum do not fit, or a number is not finite.
pub fn unpack<M: MemoryLayout>(snapshot: &Snapshot) -> Option<M> {
    let contents = unpack_bytes(u64::from_be_bytes(M::NAME), snapshot)?;
    let is_finite = snapshot[CONTENTS..CONTENTS + M::WORDS].iter().all(|word| f64::from_bits(*word).is_finite());
    is_finite.then(|| bytemuck::pod_read_unaligned(&contents[..size_of::<M>()]))
}

/// Returns the contents of a `snapshot`; `None` if layout or checksum do not fit.
pub fn unpack_bytes(layout: u64, snapshot: &Snapshot) -> Option<&[u8; MEMORY_BYTES]> {
    let mut unsigned = *snapshot;
    unsigned[1] = 0;
    let is_intact = snapshot[0] == layout && snapshot[1] == checksum_of(&unsigned);
    let contents = bytemuck::cast_slice(&snapshot[CONTENTS..]).try_into().ok();
    contents.filter(|_| is_intact)
}

/// Optional tick in one word: the tick plus one, 0 for none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(transparent)]
pub struct OptionalTick(u64);

impl OptionalTick {
    /// Stores `tick`; `u64::MAX` reads back as one less.
    pub fn some(tick: u64) -> Self {
        Self(tick.saturating_add(1))
    }

    /// Tick, or `None` if none is stored.
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

    impl MemoryLayout for Sample {
        const NAME: [u8; 8] = *b"sample 1";
    }

    #[derive(Debug, Clone, Copy, Pod, Zeroable)]
    #[repr(transparent)]
    struct Other(Sample);

    impl MemoryLayout for Other {
        const NAME: [u8; 8] = *b"sample 2";
    }

    const SAMPLE: Sample = Sample { tick: OptionalTick(8), count: 3, numbers: [-0.0, 1.5, f64::MIN_POSITIVE] };

    #[test]
    fn a_packed_memory_is_unpacked_bit_by_bit() {
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
