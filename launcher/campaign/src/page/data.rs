//! Flights of a page: their controllers, verdicts and position errors.

use std::collections::BTreeMap;

use super::bins::Binned;
use super::bounds::{self, Bound};
use crate::evidence::Evidence;
use crate::observed::Observed;
use crate::plan::Plan;
use crate::rate::Rate;
use crate::row::Standing;
use crate::table::{Cell, FlightTable};

/// Columns of a plan that are not factors.
const NO_FACTORS: [&str; 3] = ["flight", "controller", "run.seed"];

pub struct CampaignPage<'a> {
    pub plan: &'a Plan,
    pub flights: &'a FlightTable,
    /// Names of the controllers.
    pub names: Vec<&'a str>,
    /// Number of the flight of each row.
    pub numbers: Vec<u64>,
    /// Controller of each row, as an index of `names`.
    pub controllers: Vec<usize>,
    /// Verdict of each row: `true` if passed; `None` if it could not be flown.
    pub passed: Vec<Option<bool>>,
    pub bounds: Vec<Bound>,
    pub error: ShownError,
    pub evidence: Evidence,
    /// Value of the limit's setting in a flight in real time, shown beside the limits.
    pub observed: Option<Observed>,
}

/// Position error shown in the plots.
pub struct ShownError {
    pub words: &'static str,
    /// Bound \[m\], if all flights have the same one.
    pub limit: Option<f64>,
    /// Error of each row \[m\]; `None` unless finite.
    values: Vec<Option<f64>>,
}

impl ShownError {
    /// Takes the largest error, or the error at the end if the campaign bounds only that.
    fn new(flights: &FlightTable, bounds: &[Bound]) -> Self {
        let of = |metric: &str| bounds.iter().find(|bound| bound.metric == metric);
        let (largest, last) = ("max_position_error_m", "final_position_error_m");
        let (metric, words) = match (of(largest), of(last)) {
            (None, Some(_)) => (last, "position error at the end"),
            _ => (largest, "largest position error"),
        };
        let column = flights.column(metric);
        let value = |row: usize| column.and_then(|column| column.number(row)).filter(|error| error.is_finite());
        let limit = of(metric).and_then(Bound::of_all);
        Self { words, limit, values: (0..flights.rows()).map(value).collect() }
    }

    pub fn of(&self, row: usize) -> Option<f64> {
        self.values[row]
    }
}

impl<'a> CampaignPage<'a> {
    pub fn new(plan: &'a Plan, flights: &'a FlightTable) -> Self {
        let names: Vec<&str> = plan.campaign.controllers.iter().map(|(name, _)| name.as_str()).collect();
        let number = |row: usize| match flights.column("flight").map(|all| all.cell(row)) {
            Some(Cell::Int(number)) => number as u64,
            _ => row as u64,
        };
        let numbers: Vec<u64> = (0..flights.rows()).map(number).collect();
        let verdicts = flights.column("verdict");
        let passed = |row: usize| match verdicts.map_or("", |all| all.text(row)) {
            word if word == Standing::Passed.name() => Some(true),
            word if word == Standing::Failed.name() => Some(false),
            _ => None,
        };
        let bounds = bounds::of(plan, flights);
        Self {
            controllers: numbers.iter().map(|number| (number % names.len() as u64) as usize).collect(),
            passed: (0..flights.rows()).map(passed).collect(),
            error: ShownError::new(flights, &bounds),
            evidence: Evidence::of(plan, flights),
            observed: None,
            plan,
            flights,
            names,
            numbers,
            bounds,
        }
    }

    pub fn rows(&self) -> usize {
        self.flights.rows()
    }

    /// Case of a row; flights of one case differ only by their controllers.
    pub fn case(&self, row: usize) -> u64 {
        self.numbers[row] / self.names.len() as u64
    }

    /// Number of flights that a complete campaign has of each draw and controller.
    pub fn each(&self) -> u64 {
        let of_controller = self.plan.flights() / self.names.len() as u64;
        of_controller / self.evidence.all_draws().max(1)
    }

    /// Returns the row of each controller, by case; `None` for a controller without a row. Only rows for which `meant`
    /// is true count.
    pub fn by_case(&self, meant: impl Fn(usize) -> bool) -> BTreeMap<u64, Vec<Option<usize>>> {
        let mut cases: BTreeMap<u64, Vec<Option<usize>>> = BTreeMap::new();
        for row in (0..self.rows()).filter(|row| meant(*row)) {
            let case = cases.entry(self.case(row)).or_insert_with(|| vec![None; self.names.len()]);
            case[self.controllers[row]] = Some(row);
        }
        cases
    }

    /// Factors that vary; `parts` gives the number of parts for a number of flights of a controller.
    pub fn factors(&self, parts: impl Fn(usize) -> usize) -> Vec<Binned> {
        let columns = self.plan.columns();
        let factors = columns.iter().filter(|(name, _)| !NO_FACTORS.contains(&name.as_str()));
        factors.filter_map(|(name, _)| Binned::of(self.flights, name, |rows| parts(rows / self.names.len()))).collect()
    }

    /// Computes the rate over the rows for which `meant` is true.
    pub fn rate(&self, meant: impl Fn(usize) -> bool) -> Rate {
        self.rate_of((0..self.rows()).filter(|row| meant(*row)))
    }

    /// Computes the rate over given rows.
    pub fn rate_of(&self, rows: impl Iterator<Item = usize>) -> Rate {
        self.evidence.rate(rows.filter_map(|row| Some((self.numbers[row], self.passed[row]?))))
    }

    /// Computes the rate of each controller; flights that could not be flown are not counted.
    pub fn rates(&self) -> Vec<(&'a str, Rate)> {
        let of = |i: usize| self.rate(|row| self.controllers[row] == i);
        self.names.iter().enumerate().map(|(i, name)| (*name, of(i))).collect()
    }
}
