//! Points in the unit cube, one for each sample.
//!
//! A coordinate of a point is a function of seed, sample number and key, and in a Latin hypercube of the number of
//! samples. Other keys of the campaign do not change the coordinate, except under Sobol, whose dimensions are one net.
//! All streams of random numbers of a campaign are made here, each independent of the others.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Largest number of dimensions and of samples of the Sobol sequence.
pub const MAX_SOBOL: (usize, u64) = (256, 1 << 16);

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// Independent points.
    #[default]
    Random,
    /// One point in each part of each axis, which is divided into as many parts as there are samples (`McKay`, Beckman
    /// and Conover, Technometrics 21, 1979).
    LatinHypercube,
    /// Low-discrepancy sequence of Sobol', scrambled after Owen (crate `sobol_burley`).
    Sobol,
}

/// Purpose of random numbers; each has its own streams.
#[derive(Debug, Clone, Copy)]
pub enum Purpose {
    Points,
    Strata,
    Faults,
    Seeds,
}

/// Returns the stream of random numbers `index` for a purpose.
pub fn stream(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    of_purpose(ChaCha8Rng::seed_from_u64(seed), purpose, index)
}

fn of_purpose(mut rng: ChaCha8Rng, purpose: Purpose, index: u64) -> ChaCha8Rng {
    rng.set_stream((purpose as u64) << 56 | index);
    rng
}

/// Points of a campaign.
#[derive(Debug, Clone)]
pub struct Points {
    sampling: Sampling,
    seed: u64,
    samples: u64,
    axes: Vec<Axis>,
}

/// One coordinate of the points: a key, and the source of its draws.
#[derive(Debug, Clone)]
struct Axis {
    /// SHA-256 of the campaign's seed and the key: the seed of the streams of this key.
    seed: [u8; 32],
    /// Part of the axis that each sample lies in; empty except for a Latin hypercube.
    strata: Vec<u32>,
}

impl Axis {
    fn new(seed: u64, key: &str) -> Self {
        Self {
            seed: Sha256::new().chain_update(seed.to_le_bytes()).chain_update(key).finalize().into(),
            strata: vec![],
        }
    }

    /// Returns the stream of random numbers `index` of this key for a purpose.
    fn stream(&self, purpose: Purpose, index: u64) -> ChaCha8Rng {
        of_purpose(ChaCha8Rng::from_seed(self.seed), purpose, index)
    }
}

impl Points {
    /// Prepares `samples` points with one coordinate for each key; the order of the keys counts for Sobol only.
    pub fn new(sampling: Sampling, seed: u64, samples: u64, keys: &[&str]) -> Self {
        let axis = |key: &&str| {
            let mut axis = Axis::new(seed, key);
            if sampling == Sampling::LatinHypercube {
                axis.strata = (0..samples as u32).collect();
                let mut rng = axis.stream(Purpose::Strata, 0);
                axis.strata.shuffle(&mut rng);
            }
            axis
        };
        Self { sampling, seed, samples, axes: keys.iter().map(axis).collect() }
    }

    /// Returns the point of a sample; its coordinates are above 0 and below 1.
    pub fn point(&self, sample: u64) -> Vec<f64> {
        let inside = |u: f64| u.clamp(f64::EPSILON, 1.0 - f64::EPSILON);
        let coordinate = |(dimension, axis): (usize, &Axis)| match self.sampling {
            Sampling::Random => inside(axis.stream(Purpose::Points, sample).random()),
            Sampling::LatinHypercube => {
                let within: f64 = axis.stream(Purpose::Points, sample).random();
                inside((f64::from(axis.strata[sample as usize]) + within) / self.samples as f64)
            }
            Sampling::Sobol => {
                // The sample has 24 bits; take the middle of the interval that they stand for.
                let seed = (self.seed ^ self.seed >> 32) as u32;
                let bits = sobol_burley::sample(sample as u32, dimension as u32, seed);
                f64::from(bits) + 0.5 / f64::from(1 << 24)
            }
        };
        self.axes.iter().enumerate().map(coordinate).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Sampling; 3] = [Sampling::Random, Sampling::LatinHypercube, Sampling::Sobol];
    const KEYS: [&str; 4] = ["mass_kg", "delay_ms", "wind.0", "wind.1"];

    #[test]
    fn a_point_is_a_function_of_seed_and_number() {
        for sampling in ALL {
            let [one, same, other] = [1, 1, 2].map(|seed| Points::new(sampling, seed, 64, &KEYS));
            assert_eq!(one.point(40), same.point(40));
            assert_ne!(one.point(40), other.point(40), "{sampling:?}");
            assert!((0..64).flat_map(|i| one.point(i)).all(|u| u > 0.0 && u < 1.0));
        }
    }

    #[test]
    fn a_latin_hypercube_has_one_point_in_each_part_of_each_axis() {
        let points = Points::new(Sampling::LatinHypercube, 7, 100, &KEYS);
        for dimension in 0..4 {
            let mut parts: Vec<u64> = (0..100).map(|i| (points.point(i)[dimension] * 100.0) as u64).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..100).collect::<Vec<_>>());
        }
    }

    #[test]
    fn coordinates_of_different_keys_are_independent() {
        for sampling in [Sampling::Random, Sampling::LatinHypercube] {
            let points = Points::new(sampling, 1, 1000, &KEYS);
            let product = |i: u64| (points.point(i)[2] - 0.5) * (points.point(i)[3] - 0.5);
            let correlation = (0..1000).map(product).sum::<f64>() / 1000.0 * 12.0;
            assert!(correlation.abs() < 0.1, "{sampling:?}: {correlation}");
        }
    }

    /// The first 2^m points of the first two dimensions are a (0, m, 2)-net in base 2 (Sobol', 1967): each box of area
    /// 2^-m that repeated halving of the axes makes has one point. Scrambling keeps this property.
    #[test]
    fn val_the_sobol_points_are_a_net() {
        let points = Points::new(Sampling::Sobol, 3, 64, &KEYS[..2]);
        for along in 0..=6 {
            let (columns, rows) = (f64::from(1 << along), f64::from(1 << (6 - along)));
            let mut boxes: Vec<u64> = (0..64)
                .map(|i| points.point(i))
                .map(|p| (p[0] * columns) as u64 * rows as u64 + (p[1] * rows) as u64)
                .collect();
            boxes.sort_unstable();
            assert_eq!(boxes, (0..64).collect::<Vec<_>>(), "{columns} by {rows}");
        }
    }
}
