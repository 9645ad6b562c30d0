//! How times are spread.

use serde::Serialize;

/// Percentiles of a set of times, by nearest rank: each is a time that was measured \[us\].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the usual percentiles")]
pub struct Distribution {
    pub n: usize,
    pub mean_us: f64,
    pub p50_us: f64,
    pub p90_us: f64,
    pub p99_us: f64,
    pub p999_us: f64,
    pub max_us: f64,
}

impl Distribution {
    /// The distribution of `times` \[ns\]; `None` of nothing.
    pub fn of(times: impl IntoIterator<Item = u64>) -> Option<Self> {
        let mut sorted: Vec<u64> = times.into_iter().collect();
        sorted.sort_unstable();
        let n = sorted.len();
        let max_us = *sorted.last()? as f64 / 1e3;
        // The smallest time that at least this many in a thousand do not exceed.
        let rank = |per_mille: usize| sorted[(n * per_mille).div_ceil(1000) - 1] as f64 / 1e3;
        let mean_us = sorted.iter().sum::<u64>() as f64 / 1e3 / n as f64;
        Some(Self { n, mean_us, p50_us: rank(500), p90_us: rank(900), p99_us: rank(990), p999_us: rank(999), max_us })
    }
}

/// The middle one of `times`, the larger of two; 0 of nothing.
pub fn median(times: &[u64]) -> u64 {
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_times_that_were_measured() {
        let all = Distribution::of((1..=1000).rev().map(|us| us * 1000)).expect("not empty");
        let expected = Distribution {
            n: 1000,
            mean_us: 500.5,
            p50_us: 500.0,
            p90_us: 900.0,
            p99_us: 990.0,
            p999_us: 999.0,
            max_us: 1000.0,
        };
        assert_eq!(all, expected);
        let one = Distribution::of([7000]).expect("not empty");
        assert_eq!([one.p50_us, one.p999_us, one.max_us], [7.0; 3]);
        assert_eq!(Distribution::of([]), None);
    }

    #[test]
    fn a_few_outliers_do_not_move_the_median() {
        assert_eq!(median(&[5, 900, 4, 800, 3]), 5);
        assert_eq!(median(&[]), 0);
    }
}
