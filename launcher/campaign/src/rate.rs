//! Shares of flights passed, with 95 % intervals.
//!
//! The unit of evidence is the draw: one sample of everything random. Flights of one draw are one observation: the
//! share of them that passed.

use serde::Serialize;
use view::draw::Share;

use crate::mean::interval;

/// Share of flights that passed, with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    pub survived: usize,
    pub flights: usize,
    /// Number of draws; 0 if the flights are no sample.
    pub draws: usize,
    /// Mean of the shares of the draws.
    pub share: f64,
    /// Ends of the 95 % interval of the share; NaN without draws.
    pub low: f64,
    pub high: f64,
}

impl Rate {
    /// Computes the rate of flights that each have a draw of their own.
    pub fn of(survived: usize, flights: usize) -> Self {
        let passed = std::iter::repeat_n((1, 1), survived);
        Self::over(passed.chain(std::iter::repeat_n((0, 1), flights - survived)))
    }

    /// Computes the rate of draws, each given as flights passed and flights flown.
    pub fn over(draws: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let draws: Vec<(usize, usize)> = draws.into_iter().filter(|(_, flown)| *flown > 0).collect();
        let shares: Vec<f64> = draws.iter().map(|(passed, flown)| *passed as f64 / *flown as f64).collect();
        let [survived, flights] = [draws.iter().map(|draw| draw.0).sum(), draws.iter().map(|draw| draw.1).sum()];
        let share = shares.iter().sum::<f64>() / shares.len() as f64;
        let [low, high] = interval(shares, [0.0, 1.0]);
        Self { survived, flights, draws: draws.len(), share, low, high }
    }

    /// Computes the share of flights that are no sample; it has no interval.
    pub fn counted(survived: usize, flights: usize) -> Self {
        let share = survived as f64 / flights as f64;
        Self { survived, flights, draws: 0, share, low: f64::NAN, high: f64::NAN }
    }

    /// Converts to a share for a plot; without draws the interval is a point.
    pub fn picture(&self) -> Share {
        let Self { share, low, high, .. } = *self;
        if self.draws == 0 { Share { share, low: share, high: share } } else { Share { share, low, high } }
    }

    /// Formats the interval as `93.1 to 97.4 %`, or `none` without draws.
    pub fn interval(&self) -> String {
        if self.draws == 0 && self.flights > 0 {
            return "none".to_owned();
        }
        let [low, high] = [self.low, self.high].map(|end| 100.0 * end + 0.0);
        format!("{low:.1} to {high:.1} %")
    }
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{Binomial, Discrete};

    use super::*;

    /// Reference: values of R's `binom.test` and the tables of the method.
    #[test]
    fn val_the_interval_is_that_of_clopper_and_pearson() {
        let ends = |survived: usize, flights: usize| {
            let Rate { low, high, .. } = Rate::of(survived, flights);
            [low, high]
        };
        // If all n pass, the lower end is (alpha / 2)^(1 / n).
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

    /// Sums the probabilities of all outcomes; nothing is simulated.
    #[test]
    fn val_with_one_flight_a_draw_at_least_95_percent_are_covered() {
        for flights in [1, 5, 20, 50, 200] {
            let rates: Vec<Rate> = (0..=flights).map(|passed| Rate::of(passed, flights)).collect();
            for percent in 1..100 {
                let truth = f64::from(percent) / 100.0;
                let binomial = Binomial::new(truth, flights as u64).unwrap();
                let covering = rates.iter().filter(|rate| (rate.low..=rate.high).contains(&truth));
                let chance: f64 = covering.map(|rate| binomial.pmf(rate.survived as u64)).sum();
                assert!(chance >= 0.95, "{chance} of {flights} flights at {percent} %");
            }
        }
    }

    #[test]
    fn flights_that_share_a_draw_are_one_observation() {
        let copies = Rate::over(vec![(3, 3); 20]);
        assert_eq!((copies.survived, copies.flights, copies.draws), (60, 60, 20));
        assert_eq!(copies.interval(), Rate::of(20, 20).interval());
        let mixed = Rate::over([(1, 1), (0, 4)]);
        assert_eq!((mixed.share, mixed.draws), (0.5, 2), "each draw counts alike");
        let counted = Rate::counted(3, 4);
        assert_eq!((counted.share, counted.interval().as_str()), (0.75, "none"));
    }
}
