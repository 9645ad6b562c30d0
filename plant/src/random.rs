//! Random streams: one per feature, all from the run's seed, so that switching one feature on leaves the others alone.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Who draws.
#[derive(Debug, Clone, Copy)]
#[repr(u64)]
pub enum Stream {
    /// Measurement noise.
    Noise = 1,
    /// Which commands are lost.
    Drops = 2,
    /// How late the others are.
    Jitter = 3,
}

impl Stream {
    /// The stream's generator in the run with this `seed`.
    pub fn open(self, seed: u64) -> ChaCha8Rng {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(self as u64);
        generator
    }
}
