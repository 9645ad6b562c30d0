//! The flights of a page: whose they are, whether they passed, how far off they were.

use std::collections::BTreeMap;

use super::bins::Binned;
use super::setup::{self, Bound};
use crate::outcome::Verdict;
use crate::plan::Plan;
use crate::rate::Rate;
use crate::table::{Cell, Table};

/// Columns of a plan that are no factors.
const NO_FACTORS: [&str; 3] = ["flight", "controller", "run.seed"];

pub struct Page<'a> {
    pub plan: &'a Plan,
    pub flights: &'a Table,
    /// Of the controllers.
    pub names: Vec<&'a str>,
    /// The number of the flight of each row.
    pub numbers: Vec<u64>,
    /// Its controller, as an index of `names`.
    pub controllers: Vec<usize>,
    /// Whether it passed; `None` where it could not be flown.
    pub passed: Vec<Option<bool>>,
    pub bounds: Vec<Bound>,
    pub error: Error,
}

/// The position error that the plots show.
pub struct Error {
    pub words: &'static str,
    /// The bound of all flights \[m\].
    pub limit: Option<f64>,
    /// Of each row \[m\].
    values: Vec<Option<f64>>,
}

impl Error {
    /// The largest error; where the campaign only bounds the one at the end, that.
    fn new(flights: &Table, bounds: &[Bound]) -> Self {
        let of = |metric: &str| bounds.iter().find(|bound| bound.metric == metric);
        let (largest, last) = ("max_position_error_m", "final_position_error_m");
        let (metric, words) = match (of(largest), of(last)) {
            (None, Some(_)) => (last, "position error at the end"),
            _ => (largest, "largest position error"),
        };
        let column = flights.column(metric);
        let value = |row: usize| column.and_then(|column| column.number(row)).filter(|error| error.is_finite());
        let limit = of(metric).and_then(|bound| bound.limit);
        Self { words, limit, values: (0..flights.rows()).map(value).collect() }
    }

    pub fn of(&self, row: usize) -> Option<f64> {
        self.values[row]
    }
}

impl<'a> Page<'a> {
    pub fn new(plan: &'a Plan, flights: &'a Table) -> Self {
        let names: Vec<&str> = plan.campaign.controllers.iter().map(|(name, _)| name.as_str()).collect();
        let number = |row: usize| match flights.column("flight").map(|all| all.cell(row)) {
            Some(Cell::Int(number)) => number as u64,
            _ => row as u64,
        };
        let numbers: Vec<u64> = (0..flights.rows()).map(number).collect();
        let verdicts = flights.column("verdict");
        let passed = |row: usize| match verdicts.map_or("", |all| all.text(row)) {
            word if word == Verdict::Passed.name() => Some(true),
            word if word == Verdict::Failed.name() => Some(false),
            _ => None,
        };
        let bounds = setup::bounds(plan);
        Self {
            controllers: numbers.iter().map(|number| (number % names.len() as u64) as usize).collect(),
            passed: (0..flights.rows()).map(passed).collect(),
            error: Error::new(flights, &bounds),
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

    /// The draw of a row: flights of the same draw differ by their controllers only.
    pub fn draw(&self, row: usize) -> u64 {
        self.numbers[row] / self.names.len() as u64
    }

    /// Whether each controller passes each draw.
    pub fn by_draw(&self) -> Vec<Vec<Option<bool>>> {
        let mut draws: BTreeMap<u64, Vec<Option<bool>>> = BTreeMap::new();
        for row in 0..self.rows() {
            let draw = draws.entry(self.draw(row)).or_insert_with(|| vec![None; self.names.len()]);
            draw[self.controllers[row]] = self.passed[row];
        }
        draws.into_values().collect()
    }

    /// The factors that vary; `parts` says in how many parts so many flights of a controller are divided.
    pub fn factors(&self, parts: impl Fn(usize) -> usize) -> Vec<Binned> {
        let columns = self.plan.columns();
        let factors = columns.iter().filter(|(name, _)| !NO_FACTORS.contains(&name.as_str()));
        factors.filter_map(|(name, _)| Binned::of(self.flights, name, |rows| parts(rows / self.names.len()))).collect()
    }

    /// How many of the flights of these rows are passed.
    pub fn rate(&self, meant: impl Fn(usize) -> bool) -> Rate {
        let flown = (0..self.rows()).filter(|row| meant(*row)).filter_map(|row| self.passed[row]);
        let (passed, all) = flown.fold((0, 0), |(passed, all), one| (passed + usize::from(one), all + 1));
        Rate::of(passed, all)
    }
}
