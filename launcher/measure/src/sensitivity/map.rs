//! Map of the flights of every profile under every delay, jitter and probability of a miss.
//!
//! A cell holds the flights that differ only in their random numbers; the worst of them counts.

use std::fmt::Write;
use std::path::Path;

use contract::Scenario;
use contract::scenario::{Profile, ScenarioError};
use rayon::prelude::*;
use serde::Serialize;

use crate::flights::{in_process, survival};
use flight::event;
use flight::settings;

/// Profiles of the map.
pub const PROFILES: [Profile; 2] = [Profile::Paper, Profile::Robust];
/// Delays of the map for the paper's controller \[ms\], finer near its limit.
const PAPER_DELAYS_MS: [f64; 10] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0];
/// Delays of the map for the robust controller \[ms\], finer near its limit.
const ROBUST_DELAYS_MS: [f64; 14] = [0.0, 5.0, 10.0, 20.0, 30.0, 40.0, 45.0, 50.0, 52.0, 54.0, 56.0, 58.0, 60.0, 64.0];

/// Coordinates of a flight or a cell on the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Place {
    pub profile: Profile,
    pub delay_ms: f64,
    /// Jitter, added to the delay \[ms\].
    pub jitter_ms: f64,
    pub miss_probability: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridFlight {
    pub at: Place,
    pub seed: u64,
    /// Time at which the vehicle diverged, or at which the flight ended far from its reference \[s\].
    pub failed_at_s: Option<f64>,
    /// Largest position error \[m\], up to the loss.
    pub max_position_error_m: f64,
    pub rms_position_error_m: f64,
}

/// Flights that differ only in their random numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    #[serde(flatten)]
    pub at: Place,
    pub flights: usize,
    /// Number of flights that failed.
    pub lost: usize,
    /// Largest position error of the worst flight \[m\]; `None` if any failed, because then it has no bound.
    pub max_position_error_m: Option<f64>,
    /// Root mean square error of the worst flight \[m\]; `None` if any failed.
    pub rms_position_error_m: Option<f64>,
}

/// Returns the flights of a map of the scenario in `file`, or of the survey. `delays` apply to both profiles; if empty,
/// each profile has its own. Settings that are invalid in a scenario are an error.
pub fn scenarios(
    file: Option<&Path>,
    seeds: u64,
    [delays, jitters, misses]: [&[f64]; 3],
) -> Result<Vec<Scenario>, ScenarioError> {
    let mut scenarios = vec![];
    for profile in PROFILES {
        let delays = match profile {
            _ if !delays.is_empty() => delays,
            Profile::Paper => &PAPER_DELAYS_MS,
            Profile::Robust => &ROBUST_DELAYS_MS,
        };
        for miss in rising(misses.iter().copied()) {
            for jitter in rising(jitters.iter().copied()) {
                for delay in rising(delays.iter().copied()) {
                    let settings = [
                        format!("profile={}", event::name(profile)),
                        "run.mode=inprocess".into(),
                        format!("run.command_delay_ms={delay:?}"),
                        format!("run.command_jitter_ms={jitter:?}"),
                        format!("run.command_drop_probability={miss:?}"),
                    ];
                    let mut scenario = settings::load(file, &settings)?;
                    let is_random = jitter != 0.0 || miss != 0.0;
                    for _ in 0..if is_random { seeds } else { 1 } {
                        scenarios.push(scenario.clone());
                        scenario.run.seed = scenario.run.seed.wrapping_add(1);
                    }
                }
            }
        }
    }
    Ok(scenarios)
}

/// Flies all scenarios on all cores; returns the flights in their order.
pub fn fly(scenarios: &[Scenario]) -> Vec<GridFlight> {
    let one = |scenario: &Scenario| {
        let (summary, verdict) = in_process(&Scenario { bounds: survival(), ..scenario.clone() }, |_| {});
        let (run, metrics) = (&scenario.run, summary.metrics());
        GridFlight {
            at: Place {
                profile: scenario.profile,
                delay_ms: run.command_delay_ms,
                jitter_ms: run.command_jitter_ms,
                miss_probability: run.command_drop_probability,
            },
            seed: run.seed,
            failed_at_s: verdict.failed_at_s,
            max_position_error_m: metrics.max_position_error_m,
            rms_position_error_m: metrics.rms_position_error_m,
        }
    };
    scenarios.par_iter().map(one).collect()
}

pub fn to_csv(flights: &[GridFlight]) -> String {
    let mut text = String::from("profile,delay_ms,jitter_ms,miss_probability,seed,failed_at_s,max_m,rms_m\n");
    for f in flights {
        let Place { profile, delay_ms, jitter_ms, miss_probability } = f.at;
        let (profile, lost) = (event::name(profile), f.failed_at_s.map(|t| t.to_string()).unwrap_or_default());
        let (seed, max, rms) = (f.seed, f.max_position_error_m, f.rms_position_error_m);
        // Writing to a String never fails.
        let _ = writeln!(text, "{profile},{delay_ms},{jitter_ms},{miss_probability},{seed},{lost},{max},{rms}");
    }
    text
}

/// Groups `flights` into cells, in their order.
pub fn gather(flights: &[GridFlight]) -> Vec<Cell> {
    flights.chunk_by(|a, b| a.at == b.at).map(Cell::of).collect()
}

impl Cell {
    fn of(flights: &[GridFlight]) -> Self {
        let lost = flights.iter().filter(|flight| flight.failed_at_s.is_some()).count();
        let worst = |error: fn(&GridFlight) -> f64| (lost == 0).then(|| flights.iter().map(error).fold(0.0, f64::max));
        Self {
            at: flights[0].at,
            flights: flights.len(),
            lost,
            max_position_error_m: worst(|flight| flight.max_position_error_m),
            rms_position_error_m: worst(|flight| flight.rms_position_error_m),
        }
    }
}

/// Returns delays \[ms\], jitters \[ms\] and probabilities that occur, each once and rising.
pub fn axes(cells: &[&Cell]) -> [Vec<f64>; 3] {
    let coordinates: [fn(&Place) -> f64; 3] = [|at| at.delay_ms, |at| at.jitter_ms, |at| at.miss_probability];
    coordinates.map(|coordinate| rising(cells.iter().map(|cell| coordinate(&cell.at))))
}

/// Sorts values and drops duplicates.
fn rising(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}
