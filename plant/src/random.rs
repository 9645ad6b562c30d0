//! Random streams, and normal numbers from them. Each feature and fault has a stream of its own, all from the run's
//! seed, so that one feature does not change the draws of another.
//!
//! Normal numbers are drawn by the ziggurat method (Marsaglia and Tsang, Journal of Statistical Software 5(8), 2000):
//! 256 layers of equal area cover `f(x) = exp(-x^2 / 2)`, and layer i reaches from 0 to `x_i`. A point drawn in a layer
//! is accepted if it is below f. `rand_distr` draws the same numbers, but with exponential and logarithm of the
//! platform.

use std::sync::LazyLock;

use rand::distr::Open01;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Words of a stream that [`begin_tick`] reserves for each tick; a tick uses a few tens at most.
const WORDS_PER_TICK: u128 = 256;
/// Number of the first fault's stream; the streams of features have lower numbers.
const FAULTS: u64 = 1 << 32;

/// Width `x_0` of a rectangle of height `f(x_1)` that has the area of the bottom layer with its tail.
const X_0: f64 = 3.910_757_959_537_09;
const X_1: f64 = 3.654_152_885_361_009;
/// Pairs `x_i` and `f(x_i)`; the last pair is the top of f.
static LAYERS: LazyLock<[(f64, f64); 257]> = LazyLock::new(|| {
    let f = |x: f64| libm::exp(-x * x / 2.0);
    let area = X_0 * f(X_1);
    let mut layers = [(0.0, 1.0); 257];
    layers[0] = (X_0, f(X_0));
    layers[1] = (X_1, f(X_1));
    for i in 2..256 {
        let (x, height) = layers[i - 1];
        let x = (-2.0 * libm::log(area / x + height)).sqrt();
        layers[i] = (x, f(x));
    }
    layers
});

/// Purpose of a random stream.
#[derive(Debug, Clone, Copy)]
pub enum Stream {
    /// Measurement noise.
    Noise,
    /// Loss of commands.
    Drops,
    /// Jitter of commands.
    Jitter,
    /// Turbulence.
    Turbulence,
    /// Sensors of the navigation unit.
    Navigation,
    /// Sensors of rotor speeds and tilt.
    Telemetry,
    /// Fault at this index in the scenario.
    Fault(usize),
}

impl Stream {
    /// Opens the stream in the run with this `seed`.
    pub fn open(self, seed: u64) -> ChaCha8Rng {
        LazyLock::force(&LAYERS); // compute the table before the flight
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
            Self::Navigation => 5,
            Self::Telemetry => 6,
            Self::Fault(index) => FAULTS + index as u64,
        }
    }
}

/// Moves a stream to the draws of `tick`: they depend on seed and tick alone, also if ticks were left out.
pub fn begin_tick(random: &mut ChaCha8Rng, tick: u64) {
    random.set_word_pos(u128::from(tick) * WORDS_PER_TICK);
}

/// Draws a normal number of standard deviation 1.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    loop {
        let bits = random.next_u64();
        let [(x_i, f_i), (x_next, f_next)] = [0, 1].map(|above| LAYERS[(bits & 0xff) as usize + above]);
        // The upper 52 bits are the mantissa of a number from 2 to below 4; minus 3, the number is from -1 to below 1.
        let share = f64::from_bits((bits >> 12) | 2_f64.to_bits()) - 3.0;
        let x = share * x_i;
        if x.abs() < x_next {
            return x;
        }
        if x_i == X_0 {
            return tail(random).copysign(share);
        }
        if f_next + (f_i - f_next) * random.random::<f64>() < libm::exp(-x * x / 2.0) {
            return x;
        }
    }
}

/// Draws a normal number beyond `x_1`, by rejection from an exponential distribution.
fn tail(random: &mut ChaCha8Rng) -> f64 {
    loop {
        let [x, y] = [(); 2].map(|()| -libm::log(random.sample(Open01)));
        let beyond = x / X_1;
        if 2.0 * y >= beyond * beyond {
            return X_1 + beyond;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::StandardNormal;

    use super::*;

    #[test]
    fn val_normal_numbers_are_those_of_rand_distr_draw_by_draw() {
        let [mut ours, mut theirs] = [(); 2].map(|()| Stream::Noise.open(1));
        let mut tails = 0;
        for _ in 0..1_000_000 {
            let (x, expected): (f64, f64) = (normal(&mut ours), theirs.sample(StandardNormal));
            assert!((x - expected).abs() < 1e-12, "{x} {expected}");
            tails += u64::from(x.abs() > X_1);
        }
        assert_eq!(ours, theirs);
        assert!(tails > 200, "{tails} of about 258");
    }
}
