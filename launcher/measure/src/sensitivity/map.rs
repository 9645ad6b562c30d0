//! Map of the flights of every controller under every delay, jitter and probability of a miss.
//!
//! A cell holds the flights that differ only in their random numbers; the worst of them counts.

use std::fmt::Write;

use contract::scenario::Profile;
use serde::Serialize;

use crate::shipped::Flown;

/// Profiles of the map.
pub const PROFILES: [Profile; 2] = [Profile::Paper, Profile::Robust];
/// Coordinates of a flight or a cell on the map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Name of the controller: that of a profile, or one of the user.
    pub controller: String,
    pub delay_ms: f64,
    /// Jitter, added to the delay \[ms\].
    pub jitter_ms: f64,
    pub miss_probability: f64,
}

#[derive(Debug, Clone, PartialEq)]
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

/// Returns the flights of a campaign over one profile, controller by controller. A flight that is the same bit for bit
/// as the one before it, in which nothing was random, is left out: a copy is no evidence.
pub fn flights(flown: &Flown) -> Vec<GridFlight> {
    let flight = |row: usize| {
        let number = |column| flown.number(row, column);
        GridFlight {
            at: Place {
                controller: flown.text(row, "controller").to_owned(),
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
    let controllers = flown.plan.campaign.controllers.len();
    let is_copy = |row: usize| {
        row.checked_sub(controllers).is_some_and(|before| {
            flown.text(before, "hash") == flown.text(row, "hash") && flight(before).at == flight(row).at
        })
    };
    let of = |controller| (controller..flown.flights.rows()).step_by(controllers);
    (0..controllers).flat_map(of).filter(|row| !is_copy(*row)).map(flight).collect()
}

pub fn to_csv(flights: &[GridFlight]) -> String {
    let mut text = String::from("controller,delay_ms,jitter_ms,miss_probability,seed,failed_at_s,max_m,rms_m\n");
    for f in flights {
        let Place { controller, delay_ms, jitter_ms, miss_probability } = &f.at;
        let lost = f.failed_at_s.map(|t| t.to_string()).unwrap_or_default();
        let (seed, max, rms) = (f.seed, f.max_position_error_m, f.rms_position_error_m);
        // Writing to a String never fails.
        let _ = writeln!(text, "{controller},{delay_ms},{jitter_ms},{miss_probability},{seed},{lost},{max},{rms}");
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
            at: flights[0].at.clone(),
            flights: flights.len(),
            lost,
            max_position_error_m: worst(|flight| flight.max_position_error_m),
            rms_position_error_m: worst(|flight| flight.rms_position_error_m),
        }
    }
}

/// Returns the names of the controllers, in the order of the map.
pub fn controllers(cells: &[Cell]) -> Vec<&str> {
    cells.chunk_by(|a, b| a.at.controller == b.at.controller).map(|of_one| of_one[0].at.controller.as_str()).collect()
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
