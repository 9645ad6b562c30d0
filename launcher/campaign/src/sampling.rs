//! Points in the unit cube, one for each sample.
//!
//! A point is a function of seed and sample number. All streams of random numbers of a campaign are made here, each
//! independent of the others.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((purpose as u64) << 56 | index);
    rng
}

/// Points of a campaign.
#[derive(Debug, Clone)]
pub struct Points {
    sampling: Sampling,
    seed: u64,
    samples: u64,
    dimensions: usize,
    /// Latin hypercube: the part of each sample, by dimension.
    strata: Vec<Vec<u32>>,
}

impl Points {
    /// Prepares `samples` points in `dimensions` dimensions.
    pub fn new(sampling: Sampling, seed: u64, samples: u64, dimensions: usize) -> Self {
        let permutation = |dimension: usize| {
            let mut parts: Vec<u32> = (0..samples as u32).collect();
            parts.shuffle(&mut stream(seed, Purpose::Strata, dimension as u64));
            parts
        };
        let strata =
            if sampling == Sampling::LatinHypercube { (0..dimensions).map(permutation).collect() } else { vec![] };
        Self { sampling, seed, samples, dimensions, strata }
    }

    /// Returns the point of a sample; its coordinates are above 0 and below 1.
    pub fn point(&self, sample: u64) -> Vec<f64> {
        let mut rng = stream(self.seed, Purpose::Points, sample);
        let inside = |u: f64| u.clamp(f64::EPSILON, 1.0 - f64::EPSILON);
        let coordinate = |dimension: usize| match self.sampling {
            Sampling::Random => inside(rng.random()),
            Sampling::LatinHypercube => {
                let within: f64 = rng.random();
                inside((f64::from(self.strata[dimension][sample as usize]) + within) / self.samples as f64)
            }
            Sampling::Sobol => {
                // The sample has 24 bits; take the middle of the interval that they stand for.
                let bits = sobol_burley::sample(sample as u32, dimension as u32, self.sobol_seed());
                f64::from(bits) + 0.5 / f64::from(1 << 24)
            }
        };
        (0..self.dimensions).map(coordinate).collect()
    }

    fn sobol_seed(&self) -> u32 {
        (self.seed ^ self.seed >> 32) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Sampling; 3] = [Sampling::Random, Sampling::LatinHypercube, Sampling::Sobol];

    #[test]
    fn a_point_is_a_function_of_seed_and_number() {
        for sampling in ALL {
            let [one, same, other] = [1, 1, 2].map(|seed| Points::new(sampling, seed, 64, 3));
            assert_eq!(one.point(40), same.point(40));
            assert_ne!(one.point(40), other.point(40), "{sampling:?}");
            assert!((0..64).flat_map(|i| one.point(i)).all(|u| u > 0.0 && u < 1.0));
        }
    }

    #[test]
    fn a_latin_hypercube_has_one_point_in_each_part_of_each_axis() {
        let points = Points::new(Sampling::LatinHypercube, 7, 100, 4);
        for dimension in 0..4 {
            let mut parts: Vec<u64> = (0..100).map(|i| (points.point(i)[dimension] * 100.0) as u64).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..100).collect::<Vec<_>>());
        }
    }

    /// The first 2^m points of the first two dimensions are a (0, m, 2)-net in base 2 (Sobol', 1967): each box of area
    /// 2^-m that repeated halving of the axes makes has one point. Scrambling keeps this property.
    #[test]
    fn val_the_sobol_points_are_a_net() {
        let points = Points::new(Sampling::Sobol, 3, 64, 2);
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
