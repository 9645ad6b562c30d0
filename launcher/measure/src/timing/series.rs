//! Series of times by round, and the comparison of two series.

use std::fmt::Write;

use serde::Serialize;

use outcome::percentiles::{Percentiles, median, recorded};

/// Measured times of one quantity, all rounds \[ns\].
#[derive(Debug, Clone, Default)]
pub struct MeasuredTimes {
    pub name: String,
    /// Times, one list per round \[ns\].
    pub rounds: Vec<Vec<u64>>,
}

/// Ratio of two series, over the rounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    pub median: f64,
    pub min: f64,
    pub max: f64,
}

impl MeasuredTimes {
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), rounds: vec![] }
    }

    /// Splits the times into rounds of `length`; an incomplete round is left out.
    #[must_use]
    pub fn split(&self, length: usize) -> Self {
        let rounds = self.rounds.iter().flat_map(|times| times.chunks_exact(length)).map(<[u64]>::to_vec).collect();
        Self { name: self.name.clone(), rounds }
    }

    /// Returns the distribution of all rounds together.
    pub fn all(&self) -> Option<Percentiles> {
        Percentiles::of(self.rounds.iter().flatten().copied())
    }

    /// Computes `figure` of each round.
    pub fn each(&self, figure: impl Fn(&Percentiles) -> f64) -> Vec<f64> {
        self.rounds.iter().filter_map(|times| Percentiles::of(times.iter().copied())).map(|d| figure(&d)).collect()
    }

    /// Computes the ratio of `figure` to that of `reference`, round by round.
    pub fn over(&self, reference: &Self, figure: impl Fn(&Percentiles) -> f64 + Copy) -> Option<Ratio> {
        let pairs = self.each(figure).into_iter().zip(reference.each(figure));
        Ratio::of(pairs.map(|(ours, theirs)| ours / theirs))
    }
}

impl Ratio {
    /// Summarises the finite ratios of the rounds; `None` if there is none.
    pub fn of(ratios: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut ratios: Vec<f64> = ratios.into_iter().filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        let (min, max) = (*ratios.first()?, *ratios.last()?);
        Some(Self { median: median(ratios)?, min, max })
    }

    /// Formats the smallest and the largest ratio, for a note.
    pub fn spread(&self) -> String {
        format!("{:.2} to {:.2}", self.min, self.max)
    }
}

/// Formats the full histograms as CSV: times to three significant digits with their counts, round by round.
pub fn to_csv<'a>(series: impl IntoIterator<Item = &'a MeasuredTimes>) -> String {
    let mut csv = String::from("series,round,value_ns,count\n");
    for MeasuredTimes { name, rounds } in series {
        for (round, times) in rounds.iter().enumerate() {
            for bin in recorded(times.iter().copied()).iter_recorded() {
                // Writing to a String never fails.
                let _ =
                    writeln!(csv, "{name},{round},{},{}", bin.value_iterated_to(), bin.count_since_last_iteration());
            }
        }
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(rounds: &[&[u64]]) -> MeasuredTimes {
        MeasuredTimes { name: "s".into(), rounds: rounds.iter().map(|round| round.to_vec()).collect() }
    }

    #[test]
    fn ratios_are_taken_within_a_round() {
        let ours = series(&[&[20], &[200], &[1500]]);
        let theirs = series(&[&[10], &[100], &[500]]);
        let ratio = ours.over(&theirs, |d| d.p50_us).expect("three rounds");
        assert_eq!(ratio, Ratio { median: 2.0, min: 2.0, max: 3.0 });
        assert_eq!(ours.over(&series(&[]), |d| d.p50_us), None);
        assert_eq!(Ratio::of([1.0, 4.0, 3.0, f64::INFINITY]).map(|r| r.median), Some(3.0));
    }

    #[test]
    fn splitting_keeps_the_order_and_only_whole_rounds() {
        assert_eq!(series(&[&[1, 2, 3, 4, 5], &[6, 7]]).split(2).rounds, [[1, 2], [3, 4], [6, 7]]);
    }

    #[test]
    fn the_histogram_keeps_every_time() {
        let csv = to_csv([&series(&[&[5, 5, 7], &[9]])]);
        assert_eq!(csv, "series,round,value_ns,count\ns,0,5,2\ns,0,7,1\ns,1,9,1\n");
    }
}
