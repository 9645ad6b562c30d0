//! Random streams: one per feature and fault, all from the run's seed, so that switching one on leaves the others alone.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Streams of faults begin here; those of features are below.
const FAULTS: u64 = 1 << 32;

/// What the numbers are drawn for.
#[derive(Debug, Clone, Copy)]
pub enum Stream {
    /// Measurement noise.
    Noise,
    /// Which commands are lost.
    Drops,
    /// How late the others are.
    Jitter,
    /// Gusts.
    Turbulence,
    /// The fault at this place in the scenario.
    Fault(usize),
}

impl Stream {
    /// The stream's generator in the run with this `seed`.
    pub fn open(self, seed: u64) -> ChaCha8Rng {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(self.number());
        generator
    }

    fn number(self) -> u64 {
        match self {
            Self::Noise => 1,
            Self::Drops => 2,
            Self::Jitter => 3,
            Self::Turbulence => 4,
            Self::Fault(index) => FAULTS + index as u64,
        }
    }
}
