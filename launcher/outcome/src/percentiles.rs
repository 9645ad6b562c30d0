//! Percentiles and medians. Times are counted in an `HdrHistogram` of nanoseconds with three significant digits.

use hdrhistogram::Histogram;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Percentiles of a time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Percentiles {
    /// Number of values; with 0 values all percentiles are 0.
    pub n: u64,
    /// Median \[us\].
    pub p50_us: f64,
    /// Percentile 90 \[us\].
    pub p90_us: f64,
    /// Percentile 99 \[us\].
    pub p99_us: f64,
    /// Percentile 99.9 \[us\].
    pub p999_us: f64,
    /// Largest value \[us\].
    pub max_us: f64,
}

impl Percentiles {
    /// Percentiles of `times` \[ns\]; `None` when there are none.
    pub fn of(times: impl IntoIterator<Item = u64>) -> Option<Self> {
        let histogram = recorded(times);
        (!histogram.is_empty()).then(|| percentiles(&histogram))
    }
}

/// Makes an empty histogram of 1 ns to 60 s with three significant digits. Longer times count as 60 s.
pub fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, 60_000_000_000, 3).expect("the bounds are constants that hdrhistogram accepts")
}

/// Makes a histogram of `times` \[ns\].
pub fn recorded(times: impl IntoIterator<Item = u64>) -> Histogram<u64> {
    let mut histogram = histogram();
    times.into_iter().for_each(|time| histogram.saturating_record(time));
    histogram
}

/// Percentiles of a histogram of nanoseconds; all 0 when it is empty.
pub fn percentiles(histogram: &Histogram<u64>) -> Percentiles {
    let at = |quantile| histogram.value_at_quantile(quantile) as f64 / 1e3;
    Percentiles {
        n: histogram.len(),
        p50_us: at(0.5),
        p90_us: at(0.9),
        p99_us: at(0.99),
        p999_us: at(0.999),
        max_us: histogram.max() as f64 / 1e3,
    }
}

/// Median of `times` \[ns\]; 0 when there are none.
pub fn median_ns(times: impl IntoIterator<Item = u64>) -> u64 {
    recorded(times).value_at_quantile(0.5)
}

/// Exact median of a few `values` of any unit, the larger of the middle two; `None` when there are none.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_and_medians_are_those_of_the_times() {
        let all = Percentiles::of((1..=1000).rev().map(|us| us * 1000)).expect("not empty");
        let got = [all.p50_us, all.p90_us, all.p99_us, all.p999_us, all.max_us];
        for (got, exact) in got.into_iter().zip([500.0, 900.0, 990.0, 999.0, 1000.0]) {
            assert!((got / exact - 1.0).abs() < 1e-3, "{got} {exact}");
        }
        assert_eq!((median([5.0, 900.0, -4.0, 800.0, 3.0]), median_ns([5, 900, 4, 800, 3])), (Some(5.0), 5));
        assert_eq!((Percentiles::of([]), median([]), median_ns([])), (None, None, 0));
    }
}
