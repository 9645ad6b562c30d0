//! Compares two controllers on the same draws: difference of the shares passed or of a metric, its 95 % interval, and
//! p-value.

use std::collections::BTreeMap;

use statrs::distribution::{Binomial, ContinuousCDF, Discrete, StudentsT};

use crate::mean::{ALPHA, interval};

/// Difference of the shares that two controllers pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Mean over the draws of the first controller's share less the second's.
    pub share: f64,
    /// Ends of the 95 % interval.
    pub low: f64,
    pub high: f64,
    /// Probability of a difference of at least this size if the two controllers were alike.
    pub p: f64,
}

impl Difference {
    /// Computes the difference over draws. Each draw is given as passed flights of the first controller less those of
    /// the second, and the number of flights of each controller.
    pub fn over(draws: &[(i64, usize)]) -> Self {
        let shares: Vec<f64> = draws.iter().map(|(more, flown)| *more as f64 / *flown as f64).collect();
        let share = shares.iter().sum::<f64>() / shares.len() as f64;
        let [low, high] = interval(shares, [-1.0, 1.0]);
        Self { share, low, high, p: sign_flip(draws.iter().map(|(more, _)| *more)) }
    }
}

/// Difference of a metric of two controllers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MetricDifference {
    /// Mean over the draws of the first controller's metric less the second's.
    pub mean: f64,
    /// Ends of the 95 % interval.
    pub low: f64,
    pub high: f64,
    /// Effect size: the mean as a multiple of the draws' standard deviation, Cohen's `d_z` (Statistical Power Analysis
    /// for the Behavioral Sciences, 1988). Below 0.2 it is commonly called negligible, from 0.8 on large.
    pub effect: f64,
    /// Probability of a mean at least as far from 0 if the two controllers were alike.
    pub p: f64,
}

impl MetricDifference {
    /// Computes the difference over draws, each given as the first controller's metric less the second's, by Student's
    /// paired t-test (Biometrika 6, 1908). `None` with fewer than two draws, or if all are equal but not 0.
    pub fn over(draws: &[f64]) -> Option<Self> {
        let n = draws.len() as f64;
        let mean = draws.iter().sum::<f64>() / n;
        let deviation = (draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0)).sqrt();
        let student = StudentsT::new(0.0, 1.0, n - 1.0).ok()?;
        if draws.iter().all(|x| *x == 0.0) {
            return Some(Self { mean: 0.0, low: 0.0, high: 0.0, effect: 0.0, p: 1.0 });
        }
        let error = deviation / n.sqrt();
        let reach = student.inverse_cdf(1.0 - ALPHA / 2.0) * error;
        (error > 0.0).then(|| Self {
            mean,
            low: mean - reach,
            high: mean + reach,
            effect: mean / deviation,
            p: 2.0 * student.cdf(-(mean / error).abs()),
        })
    }
}

/// Returns the two-sided probability of a sum at least as far from 0 if each term had either sign with the same
/// probability: the exact permutation test of paired differences (Fisher, The Design of Experiments, 1935). For terms
/// of -1, 0 or 1 it is the exact test of `McNemar` (Psychometrika 12, 1947).
fn sign_flip(terms: impl Iterator<Item = i64>) -> f64 {
    let (mut sizes, mut sum) = (BTreeMap::new(), 0);
    for term in terms.filter(|term| *term != 0) {
        *sizes.entry(term.unsigned_abs()).or_insert(0_u64) += 1;
        sum += term;
    }
    let most: u64 = sizes.iter().map(|(size, count)| size * count).sum();
    if sum == 0 {
        return 1.0;
    }
    // `chances[i]` is the probability that the positive terms have the sum `i`. Sums beyond the observed one or its
    // mirror image, whichever is lower, are left out.
    let tail = ((most - sum.unsigned_abs()) / 2) as usize;
    let mut chances = vec![0.0; tail + 1];
    chances[0] = 1.0;
    for (size, count) in sizes {
        let Ok(binomial) = Binomial::new(0.5, count) else { return f64::NAN };
        let mut next = vec![0.0; tail + 1];
        for plus in 0..=count.min(tail as u64 / size) {
            let (chance, shift) = (binomial.pmf(plus), (plus * size) as usize);
            if chance > 0.0 {
                next[shift..].iter_mut().zip(&chances).for_each(|(sum, before)| *sum += chance * before);
            }
        }
        chances = next;
    }
    (2.0 * chances.iter().sum::<f64>()).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: sums of binomial coefficients, and `mcnemar.exact` of R on the approval ratings of Agresti (1990).
    #[test]
    fn val_with_one_flight_per_draw_the_test_is_that_of_mcnemar() {
        for (first, second, expected) in [
            (0, 0, 1.0),
            (5, 0, 2.0 / 32.0),
            (0, 5, 2.0 / 32.0),
            (1, 9, 22.0 / 1024.0),
            (4, 4, 1.0),
            (150, 86, 3.716e-5),
        ] {
            let p = sign_flip([vec![1; first], vec![0; 7], vec![-1; second]].concat().into_iter());
            assert!((p / expected - 1.0).abs() < 1e-3, "{first} and {second}: {p}, not {expected}");
        }
    }

    /// Reference: enumeration of all signs.
    #[test]
    fn val_the_test_counts_every_choice_of_signs() {
        for terms in [vec![3, -1, 2, 2, 1], vec![1, 1, 1, -3], vec![5], vec![2, 2, -2, 0, 3, 3]] {
            let seen: i64 = terms.iter().sum();
            let sum = |signs: u32| -> i64 {
                terms.iter().enumerate().map(|(i, term)| if signs >> i & 1 == 1 { *term } else { -*term }).sum()
            };
            let all = 1_u32 << terms.len();
            let as_far = (0..all).filter(|signs| sum(*signs).abs() >= seen.abs()).count();
            let (p, expected) = (sign_flip(terms.iter().copied()), as_far as f64 / f64::from(all));
            assert!((p - expected).abs() < 1e-12, "{terms:?}: {p}, not {expected}");
        }
    }

    /// Reference: the sleep data of Student's paper, by `t.test(..., paired = TRUE)` of R.
    #[test]
    fn val_the_difference_of_a_metric_is_that_of_student() {
        let more = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
        let it = MetricDifference::over(&more).unwrap();
        for (is, expected) in
            [(it.mean, 1.58), (it.low, 0.700_114_2), (it.high, 2.459_885_8), (it.p, 0.002_833), (it.effect, 1.284_558)]
        {
            assert!((is - expected).abs() < 1e-5, "{is}, not {expected}");
        }
    }

    #[test]
    fn fewer_than_two_draws_give_no_difference_and_neither_do_equal_flights() {
        assert_eq!(MetricDifference::over(&[]), None);
        assert_eq!(MetricDifference::over(&[1.0]), None);
        assert_eq!(MetricDifference::over(&[1.0, 1.0]), None);
        let same = MetricDifference::over(&[0.0, 0.0]).unwrap();
        assert_eq!((same.mean, same.effect, same.p), (0.0, 0.0, 1.0));
    }

    #[test]
    fn copies_of_a_draw_change_no_test() {
        let once = Difference::over(&[(1, 1), (1, 1), (0, 1), (-1, 1), (1, 1)]);
        let thrice = Difference::over(&[(3, 3), (3, 3), (0, 3), (-3, 3), (3, 3)]);
        assert_eq!((once.share, once.low, once.high), (thrice.share, thrice.low, thrice.high));
        assert!((once.p - thrice.p).abs() < 1e-12 && (once.p - 0.625).abs() < 1e-12, "{once:?}");
    }
}
