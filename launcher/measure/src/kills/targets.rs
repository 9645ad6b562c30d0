//! The promises, and what became of them.

use super::Results;
use super::judge::{GONE_MS, LOST_MS, NEAR_M};
use super::one_flight::Row;
use crate::Target;

/// Flights that are told of by number when they went wrong.
const TOLD: usize = 5;

/// One line each.
pub fn targets(results: &Results) -> Vec<Target> {
    let rows = &results.rows;
    let kills = results.kills().count();
    let wrong: Vec<String> =
        rows.iter().filter_map(|row| Some(format!("flight {}: {}", row.flight, row.complaint()?))).collect();
    let left = rows.iter().map(|row| row.left.len()).sum::<usize>();
    let successors = times(results.kills().filter_map(|kill| kill.successor_ms));
    let lost = times(results.kills().filter_map(|kill| kill.lost_ms));
    let gone = times(rows.iter().filter_map(|row| row.gone_ms));
    vec![
        Target::at_most(
            format!("flights of {} that did not go as they must", rows.len()),
            Some(wrong.len() as f64),
            0.0,
            "",
        )
        .noting(wrong[..wrong.len().min(TOLD)].join("; ")),
        Target::at_most(format!("left in memory or running after {kills} kills"), Some(left as f64), 0.0, ""),
        Target::at_most("farthest from the trajectory, flights that went on", farthest(rows), NEAR_M, "m"),
        Target::at_most("killed, until its successor's first message, median", median(&successors), 150.0, "ms"),
        Target::at_most("recorder killed, lost of the log before, max", lost.last().copied(), LOST_MS, "ms"),
        Target::at_most("launcher killed, until its last process is gone, median", median(&gone), GONE_MS, "ms"),
        Target::at_most("launcher killed, until its last process is gone, max", gone.last().copied(), GONE_MS, "ms"),
    ]
}

/// Sorted.
pub fn times(times: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    times
}

/// The one in the middle.
pub fn median(sorted: &[f64]) -> Option<f64> {
    sorted.get(sorted.len() / 2).copied()
}

/// Largest error of the flights that nothing ended before their time.
pub fn farthest<'a>(rows: impl IntoIterator<Item = &'a Row>) -> Option<f64> {
    let flown = rows.into_iter().filter(|row| row.code == Some(0));
    flown.filter_map(|row| row.position_error_m).reduce(f64::max)
}
