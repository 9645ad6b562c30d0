//! One cell of the map: the flights of one delay, jitter and probability of a miss, of which the worst counts.

use contract::scenario::Profile;
use serde::Serialize;

use super::grid::GridFlight;

/// The profiles of the map.
pub const PROFILES: [Profile; 2] = [Profile::Paper, Profile::Robust];

/// Flights that differ in their random numbers only.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    pub profile: Profile,
    pub delay_ms: f64,
    /// Jitter on top of it \[ms\].
    pub jitter_ms: f64,
    pub miss_probability: f64,
    pub flights: usize,
    /// How many of them lost the vehicle.
    pub lost: usize,
    /// Largest position error of the worst \[m\]; nothing when one was lost, which has no bound.
    pub max_position_error_m: Option<f64>,
    /// Root mean square error of the worst \[m\]; likewise.
    pub rms_position_error_m: Option<f64>,
}

impl Cell {
    fn of(flights: &[GridFlight]) -> Self {
        let GridFlight { profile, delay_ms, jitter_ms, miss_probability, .. } = flights[0];
        let lost = flights.iter().filter(|flight| flight.diverged_at_s.is_some()).count();
        let worst = |error: fn(&GridFlight) -> f64| (lost == 0).then(|| flights.iter().map(error).fold(0.0, f64::max));
        Self {
            profile,
            delay_ms,
            jitter_ms,
            miss_probability,
            flights: flights.len(),
            lost,
            max_position_error_m: worst(|flight| flight.max_position_error_m),
            rms_position_error_m: worst(|flight| flight.rms_position_error_m),
        }
    }
}

/// The cells of `flights`, in their order.
pub fn gather(flights: &[GridFlight]) -> Vec<Cell> {
    let key = |f: &GridFlight| (f.profile, f.delay_ms, f.jitter_ms, f.miss_probability);
    flights.chunk_by(|a, b| key(a) == key(b)).map(Cell::of).collect()
}

/// Delays \[ms\], jitters \[ms\] and probabilities that occur, each once and rising.
pub fn axes(cells: &[&Cell]) -> [Vec<f64>; 3] {
    [|c: &Cell| c.delay_ms, |c: &Cell| c.jitter_ms, |c: &Cell| c.miss_probability].map(|coordinate| {
        let mut axis: Vec<f64> = cells.iter().map(|cell| coordinate(cell)).collect();
        axis.sort_by(f64::total_cmp);
        axis.dedup();
        axis
    })
}

/// A profile as the scenario file spells it.
pub fn name(profile: Profile) -> &'static str {
    match profile {
        Profile::Paper => "paper",
        Profile::Robust => "robust",
    }
}
