//! Histograms of nanoseconds, what they amount to, and their files.

use std::fs;
use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::IntervalLogWriterBuilder;
use serde::Serialize;

/// Percentiles of one figure.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Percentiles {
    /// Number of values.
    pub n: u64,
    /// Median \[us\].
    pub p50_us: f64,
    /// \[us\]
    pub p90_us: f64,
    /// \[us\]
    pub p99_us: f64,
    /// \[us\]
    pub p999_us: f64,
    /// Largest \[us\].
    pub max_us: f64,
}

/// One nanosecond to a minute, three significant digits.
pub fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, 60_000_000_000, 3).expect("the bounds are constants that hdrhistogram accepts")
}

/// What a histogram of nanoseconds amounts to.
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

/// Writes a histogram in full as `folder`/`name`.hlog, the log format of `HdrHistogram`: one interval, V2 compressed.
pub(super) fn write(folder: &Path, name: &str, histogram: &Histogram<u64>) -> anyhow::Result<()> {
    let path = folder.join(format!("{name}.hlog"));
    let mut text = Vec::new();
    let mut serializer = V2DeflateSerializer::new();
    let mut builder = IntervalLogWriterBuilder::new();
    builder.add_comment(&format!("{name} of one flight, nanoseconds")).with_max_value_divisor(1e3);
    let log = builder.begin_log_with(&mut text, &mut serializer);
    let written = log.map(|mut log| log.write_histogram(histogram, Duration::ZERO, Duration::from_secs(1), None));
    let cannot = || format!("cannot write {}", path.display());
    written.with_context(cannot)?.map_err(|error| anyhow::anyhow!("{error:?}")).with_context(cannot)?;
    fs::create_dir_all(folder).and_then(|()| fs::write(&path, text)).with_context(cannot)
}
