//! The metrics of several flights side by side.

use serde_json::json;

use crate::report::sections::METRICS;
use crate::summary::Metrics;
use crate::table::Table;

/// A row for each metric, a column for each flight; `titles` name them.
pub fn metrics(titles: &[&str], flights: &[Metrics]) -> Table {
    let flights: Vec<_> = flights.iter().map(|metrics| json!(metrics)).collect();
    let cell = |value: &serde_json::Value, decimals: usize| {
        value.as_f64().map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
    };
    let row = |(key, name, unit, decimals): &(&str, &str, &str, usize)| {
        let name = if unit.is_empty() { (*name).to_owned() } else { format!("{name} [{unit}]") };
        std::iter::once(name).chain(flights.iter().map(|flight| cell(&flight[*key], *decimals + 1))).collect()
    };
    let headings: Vec<&str> = std::iter::once("").chain(titles.iter().copied()).collect();
    Table::new("", &headings, METRICS.iter().map(row).collect())
}
