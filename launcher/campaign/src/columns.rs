//! Columns of a table of flights that describe the outcome of a flight.

use anyhow::{bail, ensure};
use outcome::metrics::Metrics;
use outcome::solves::SolverRecord;
use serde_json::Value;
use settings::moved::Moved;
use settings::{moved, nearest};

use crate::table::ColumnType;

/// Columns of the outcome: verdict, cause of a failure, outcome in words, time of the failure, time flown, every metric
/// of run.json, counts of the solver, and the hash.
pub fn of_the_outcome() -> Vec<(String, ColumnType)> {
    let own = [
        ("verdict", ColumnType::Text),
        ("cause", ColumnType::Text),
        ("outcome", ColumnType::Text),
        ("failed_at_s", ColumnType::Real),
        ("flown_s", ColumnType::Real),
    ];
    let mut columns: Vec<(String, ColumnType)> = own.map(|(name, kind)| (name.to_owned(), kind)).into();
    columns.extend(measured(&Metrics::default(), &SolverRecord::default()).into_iter().map(|(name, value)| {
        let kind = if value.is_u64() { ColumnType::Int } else { ColumnType::Real };
        (name, kind)
    }));
    columns.push(("hash".to_owned(), ColumnType::Text));
    columns
}

/// Columns of the outcome that are numbers.
pub fn metrics() -> Vec<String> {
    let is_number = |(name, kind)| matches!(kind, ColumnType::Real | ColumnType::Int).then_some(name);
    of_the_outcome().into_iter().filter_map(is_number).collect()
}

/// Checks that the table of flights has a column `metric` of numbers; the error begins with `who`.
pub fn require_metric(who: &str, metric: &str) -> anyhow::Result<()> {
    if let Some(Moved { title, .. }) = moved::find(moved::NameKind::Column, metric) {
        bail!("{who}: {title}");
    }
    let known = metrics();
    let hint = nearest(metric, known.iter().map(String::as_str));
    let hint = hint.map_or(String::new(), |meant| format!("did you mean {meant:?}? "));
    ensure!(
        known.iter().any(|name| name == metric),
        "{who}: there is no metric {metric:?}; {hint}there are {}",
        known.join(", ")
    );
    Ok(())
}

/// Lists metrics and counts of the solver by column name; each is a number or null.
pub fn measured(metrics: &Metrics, solver: &SolverRecord) -> Vec<(String, Value)> {
    let mut measured = vec![];
    let metrics = serde_json::to_value(metrics).expect("metrics are numbers");
    for (name, value) in metrics.as_object().into_iter().flatten() {
        match value {
            Value::Array(axes) => {
                let names = if name.contains("rates") { ["p", "q", "r"] } else { ["phi", "theta", "psi"] };
                measured.extend(names.iter().zip(axes).map(|(axis, value)| (format!("{name}_{axis}"), value.clone())));
            }
            value => measured.push((name.clone(), value.clone())),
        }
    }
    let counts = serde_json::to_value(solver).expect("counts are numbers");
    let counts = counts.as_object().into_iter().flatten().filter(|(_, value)| value.is_u64());
    measured.extend(counts.map(|(name, value)| (format!("solver_{name}"), value.clone())));
    measured.push(("solver_iterations_max".into(), solver.iterations.max.into()));
    measured
}
