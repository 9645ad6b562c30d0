//! Map of the flights of every profile under every delay, jitter and probability of a miss.
//!
//! A cell holds the flights that differ only in their random numbers; the worst of them counts.

use std::fmt::Write;

use contract::scenario::Profile;
use flight::event;
use serde::Serialize;

use crate::shipped::Flown;

/// Profiles of the map.
pub const PROFILES: [Profile; 2] = [Profile::Paper, Profile::Robust];
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

/// Returns the flights of a campaign over one profile. A flight that is the same bit for bit as the one before it, in
/// which nothing was random, is left out: a copy is no evidence.
pub fn flights(flown: &Flown, profile: Profile) -> Vec<GridFlight> {
    let flight = |row: usize| {
        let number = |column| flown.number(row, column);
        GridFlight {
            at: Place {
                profile,
                delay_ms: number("run.command_delay_ms"),
                jitter_ms: number("run.command_jitter_ms"),
                miss_probability: number("run.command_drop_probability"),
            },
            seed: number("run.seed") as u64,
            failed_at_s: Some(number("failed_at_s")).filter(|at_s| !at_s.is_nan()),
            max_position_error_m: number("max_position_error_m"),
            rms_position_error_m: number("rms_position_error_m"),
        }
    };
    let is_copy = |row: usize| {
        row > 0 && flown.text(row - 1, "hash") == flown.text(row, "hash") && flight(row - 1).at == flight(row).at
    };
    (0..flown.flights.rows()).filter(|row| !is_copy(*row)).map(flight).collect()
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
pub fn rising(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}
