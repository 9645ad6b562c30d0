//! Checksum of messages and snapshots, to detect changed bits.

use bytemuck::Pod;

/// Returns the checksum of the words of `message`.
pub fn checksum<M: Pod>(message: &M) -> u64 {
    checksum_of(bytemuck::cast_slice(bytemuck::bytes_of(message)))
}

/// Odd factor with about as many bits 1 as bits 0: 2^64 over the golden ratio.
const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
/// Number of lanes that are mixed side by side. Within a lane each word waits for the word before it; the lanes do not
/// wait for each other, so that four take the time of one.
const LANES: usize = 4;

/// Returns a checksum over `words`. Two messages that differ in one word always have different checksums; two that
/// differ in more words have equal ones with a probability of 2^-64. A checksum detects accidents, not forgeries.
pub fn checksum_of(words: &[u64]) -> u64 {
    let (rows, rest) = words.as_chunks::<LANES>();
    let mut lanes = [ODD; LANES];
    for row in rows {
        lanes.iter_mut().zip(row).for_each(|(lane, word)| *lane = mix(*lane, *word));
    }
    lanes.iter().chain(rest).fold(ODD, |hash, word| mix(hash, *word))
}

/// Mixes a word into a hash, invertibly in both, so that a single wrong word always changes the result. The shift
/// between the two multiplications spreads the upper bits too. A multiplication alone would leave them in place, where
/// one bit of the next word can cancel them.
fn mix(hash: u64, word: u64) -> u64 {
    let mixed = (hash ^ word).wrapping_mul(ODD);
    (mixed ^ mixed >> 32).wrapping_mul(ODD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_and_two_flipped_bits_change_the_checksum() {
        let good = [0.1_f64.to_bits(); 10];
        let flipped = |words: &[u64; 10], bit: usize| {
            let mut words = *words;
            words[bit / 64] ^= 1 << (bit % 64);
            words
        };
        for first in 0..10 * 64 {
            let one = flipped(&good, first);
            assert_ne!(checksum(&one), checksum(&good), "{first}");
            for second in 0..first {
                assert_ne!(checksum(&flipped(&one, second)), checksum(&good), "{second} and {first}");
            }
        }
    }
}
