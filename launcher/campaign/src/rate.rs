//! Shares of flights with their exact intervals, and the exact test of two shares of the same draws.

use serde::Serialize;
use statrs::distribution::{Beta, Binomial, ContinuousCDF, DiscreteCDF};

/// One less this is the confidence of an interval.
const ALPHA: f64 = 0.05;

/// How many of some flights did what was asked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    pub survived: usize,
    pub flights: usize,
    /// Ends of the exact 95 % interval of the share (Clopper and Pearson, Biometrika 26, 1934).
    pub low: f64,
    pub high: f64,
}

impl Rate {
    pub fn of(survived: usize, flights: usize) -> Self {
        let lost = flights - survived;
        // The ends are quantiles of the Beta distribution, but where one of its two numbers would be 0.
        let quantile =
            |a: usize, b: usize, share| Beta::new(a as f64, b as f64).map_or(f64::NAN, |beta| beta.inverse_cdf(share));
        let low = if survived == 0 { 0.0 } else { quantile(survived, lost + 1, ALPHA / 2.0) };
        let high = if lost == 0 { 1.0 } else { quantile(survived + 1, lost, 1.0 - ALPHA / 2.0) };
        Self { survived, flights, low, high }
    }

    pub fn share(&self) -> f64 {
        self.survived as f64 / self.flights as f64
    }

    /// `93.1 to 97.4 %`
    pub fn interval(&self) -> String {
        format!("{:.1} to {:.1} %", 100.0 * self.low, 100.0 * self.high)
    }
}

/// The chance that draws split at least so unevenly, were both controllers alike: the exact test for paired shares, two-sided
/// (`McNemar`, Psychometrika 12, 1947). `first` and `second` are the numbers of draws that only one of the two passes.
pub fn mcnemar(first: u64, second: u64) -> f64 {
    let tail = Binomial::new(0.5, first + second).map_or(f64::NAN, |binomial| binomial.cdf(first.min(second)));
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against values of R's `binom.test` and the tables of the method.
    #[test]
    fn val_the_interval_is_that_of_clopper_and_pearson() {
        let ends = |survived: usize, flights: usize| {
            let Rate { low, high, .. } = Rate::of(survived, flights);
            [low, high]
        };
        // All of n: (alpha / 2)^(1 / n).
        for (ends, expected) in [
            (ends(10, 10), [libm::pow(0.025, 0.1), 1.0]),
            (ends(0, 100), [0.0, 1.0 - libm::pow(0.025, 0.01)]),
            (ends(5, 10), [0.187_086, 0.812_914]),
            (ends(81, 263), [0.252_707_2, 0.367_632_4]),
        ] {
            assert!(
                (ends[0] - expected[0]).abs() < 1e-4 && (ends[1] - expected[1]).abs() < 1e-4,
                "{ends:?} {expected:?}"
            );
        }
    }

    /// Against the sums of binomial coefficients, and `mcnemar.exact` of R on the approval ratings of Agresti (1990).
    #[test]
    fn val_the_paired_test_is_that_of_mcnemar() {
        for (first, second, expected) in [
            (0, 0, 1.0),
            (5, 0, 2.0 / 32.0),
            (0, 5, 2.0 / 32.0),
            (1, 9, 22.0 / 1024.0),
            (4, 4, 1.0),
            (150, 86, 3.716e-5),
        ] {
            let p = mcnemar(first, second);
            assert!((p / expected - 1.0).abs() < 1e-3, "{first} and {second}: {p}, not {expected}");
        }
    }
}
