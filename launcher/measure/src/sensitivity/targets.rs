//! What the map must show: where the paper's controller has its limit, and how far beyond it the robust one flies.

use contract::scenario::Profile;

use super::cell::{Cell, name};
use crate::findings::{Target, Verdict};

/// What the paper claims of its controller \[m\].
const PAPER_ERROR_M: f64 = 0.7;
/// What the shipped survey must stay inside of, at the edge as in the middle \[m\].
const ROBUST_ERROR_M: f64 = 0.06;

/// The promises, which are about the survey.
pub fn targets(survey: bool, cells: &[Cell]) -> Vec<Target> {
    let promises = [
        (Profile::Paper, 4.0, 0.0, Some(PAPER_ERROR_M)),
        (Profile::Paper, 10.0, 0.0, None),
        (Profile::Robust, 58.0, 0.0, Some(ROBUST_ERROR_M)),
        (Profile::Robust, 0.0, 0.4, Some(ROBUST_ERROR_M)),
    ];
    promises
        .into_iter()
        .map(|(profile, delay_ms, miss, limit_m)| {
            let here =
                |c: &&Cell| (c.profile, c.delay_ms, c.jitter_ms, c.miss_probability) == (profile, delay_ms, 0.0, miss);
            let cell = cells.iter().find(here);
            let figure = format!("{}, {delay_ms} ms delay, {:.0} % missed", name(profile), miss * 100.0);
            match cell {
                _ if !survey => unknown(figure, limit_m, "promised of the survey only"),
                None => unknown(figure, limit_m, "not on this map"),
                Some(cell) => judged(figure, limit_m, cell),
            }
        })
        .collect()
}

fn judged(figure: String, limit_m: Option<f64>, cell: &Cell) -> Target {
    match limit_m {
        // A lost flight is as far off as can be.
        Some(limit_m) => {
            let error_m = cell.max_position_error_m.unwrap_or(f64::INFINITY);
            Target::at_most(figure + ": largest error", Some(error_m), limit_m, "m")
        }
        None => Target {
            figure: figure + ": flights lost",
            measured: Some(cell.lost as f64),
            unit: "",
            target: format!("all {}", cell.flights),
            verdict: if cell.lost == cell.flights { Verdict::Ok } else { Verdict::Short },
            note: "the limit is real: the reading of the paper that flies is this fragile".into(),
        },
    }
}

fn unknown(figure: String, limit_m: Option<f64>, why: &str) -> Target {
    match limit_m {
        Some(limit_m) => Target::at_most(figure + ": largest error", None, limit_m, "m").noting(why),
        None => Target {
            figure: figure + ": flights lost",
            measured: None,
            unit: "",
            target: "all".into(),
            verdict: Verdict::Inconclusive,
            note: why.into(),
        },
    }
}
