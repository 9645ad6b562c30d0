//! 95 % interval of a median, whatever the distribution.
//!
//! Its ends are order statistics: of `n` draws the `k`-th least and the `k`-th largest, where `k - 1` or fewer of `n`
//! tosses of a coin show heads with a probability of at most 2.5 % (David and Nagaraja, Order Statistics, 2003, 7.1).
//! Only the order of the draws matters, so limits beyond the range count like all others.

use statrs::distribution::{Binomial, DiscreteCDF};

use crate::mean::ALPHA;

/// Returns the places of the ends among sorted draws, from 0; `None` for fewer than six draws, which have no interval.
pub fn interval(draws: usize) -> Option<[usize; 2]> {
    let rank = Binomial::new(0.5, draws as u64).ok()?.inverse_cdf(ALPHA / 2.0) as usize;
    (rank > 0).then(|| [rank - 1, draws - rank])
}

/// Place of the median among `draws` sorted draws, from 0; the lower one of two in the middle.
pub fn place(draws: usize) -> usize {
    draws.saturating_sub(1) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the table of ranks in Conover, Practical Nonparametric Statistics, 1999, A3, and R's `qbinom`.
    #[test]
    fn val_the_ends_are_those_of_the_tables() {
        for (draws, expected) in
            [(5, None), (6, Some([0, 5])), (9, Some([1, 7])), (20, Some([5, 14])), (100, Some([39, 60]))]
        {
            assert_eq!(interval(draws), expected, "{draws} draws");
        }
    }

    /// Sums the probability that the median lies within the interval over all numbers of draws below the median.
    #[test]
    fn the_interval_covers_the_median_in_at_least_95_percent() {
        for draws in 6..200_usize {
            let [low, high] = interval(draws).unwrap();
            let tosses = Binomial::new(0.5, draws as u64).unwrap();
            let covered = tosses.cdf(high as u64) - tosses.cdf(low as u64);
            assert!(covered >= 0.95 && place(draws) >= low && place(draws) <= high, "{draws}: {covered}");
        }
    }
}
