//! `[limit]`: the value of one setting up to which a flight passes.
//!
//! ```toml
//! [limit]
//! key = "run.command_delay_ms"       # a number of a scenario
//! from = 0.0                         # safe end of the range; from above `to` the search goes downwards
//! to = 100.0
//! resolution = 1.0                   # distance of neighbouring values, which divides the range
//! grid = 8                           # number of values that are flown first, both ends included; default 8
//! ```
//!
//! A flight can pass beyond a value at which it fails: profile `paper` flies the survey if a fault lets every second or
//! every fourth CONTROLS pass, and is lost with every third. So the whole grid is flown first. Bisection then narrows
//! the first step of the grid, seen from `from`, that begins with a pass and ends with a failure, until pass and
//! failure are neighbours. The limit is that pass. Values of the grid beyond it that pass are islands, which are
//! recorded and do not count. A failure between two values of the grid that pass stays unseen: a finer grid sees it.
//!
//! Values are counted by steps of the resolution from `from`, so that a setting of whole numbers gets whole numbers.

use anyhow::ensure;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Value;
use view::draw::short;

use crate::table::{Cell, ColumnType};

/// Column of the limit.
pub const LIMIT: &str = "limit";
/// Column of the number of flights that a search flew.
pub const FLIGHTS: &str = "limit_flights";
/// Column of the islands, as a list in text.
pub const ISLANDS: &str = "limit_islands";
/// Largest number of steps of a range.
const MAX_STEPS: f64 = 1e6;

/// `[limit]` of a campaign file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// Dotted key of the setting, a number of a scenario.
    pub key: String,
    /// Safe end of the range, at which the search begins.
    pub from: f64,
    /// Other end of the range; if it is below `from`, the search goes downwards.
    pub to: f64,
    /// Distance of neighbouring values, in the unit of the key; it divides the range.
    pub resolution: f64,
    /// Number of values that are flown first, both ends included; absent = 8, or all if the range has fewer.
    #[schemars(range(min = 2))]
    #[serde(default = "eight")]
    grid: u32,
}

fn eight() -> u32 {
    8
}

/// Steps from `from` to a limit; `None` if the flight fails already at `from`. Fewer steps are worse.
pub type LimitSteps = Option<u64>;

/// Result of a search; values are given by their steps from `from`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundLimit {
    /// Last value that passes before the first failure.
    pub limit: LimitSteps,
    /// First value that fails; `None` if all values of the grid pass.
    pub fails_at: LimitSteps,
    /// Values of the grid that pass beyond the first failure, in the order of the range.
    pub islands: Vec<u64>,
    pub flights: u64,
}

impl Limit {
    /// Checks the numbers.
    ///
    /// # Errors
    /// The range is empty or not finite, the resolution does not divide it, or the grid has fewer than two values.
    pub fn check(&self) -> anyhow::Result<()> {
        let Self { from, to, resolution, grid, .. } = self;
        ensure!(from.is_finite() && to.is_finite() && from != to, "`from` = {from}, `to` = {to}: give two finite ends");
        let range = (to - from).abs();
        ensure!(
            *resolution > 0.0 && *resolution <= range,
            "`resolution` = {resolution}: give a distance above 0 and at most that of the ends, {}",
            short(range)
        );
        let steps = range / resolution;
        ensure!(
            (steps - steps.round()).abs() < 1e-6,
            "`resolution` = {resolution} does not divide the range from {from} to {to}: change one of them"
        );
        ensure!(steps <= MAX_STEPS, "the range has {steps:.0} steps of `resolution`: at most {MAX_STEPS}");
        ensure!(*grid >= 2, "`grid` = {grid}: give how many values are flown first, 2 or more");
        Ok(())
    }

    /// Number of steps from one end of the range to the other.
    pub fn steps(&self) -> u64 {
        ((self.to - self.from).abs() / self.resolution).round() as u64
    }

    /// Value that lies `step` steps from `from`.
    pub fn value(&self, step: u64) -> f64 {
        let (step, steps) = (step as f64, self.steps() as f64);
        (self.from * (steps - step) + self.to * step) / steps
    }

    /// Steps from `from` to a value of the table.
    pub fn step(&self, value: f64) -> u64 {
        ((value - self.from).abs() / self.resolution).round() as u64
    }

    /// Key and value of the setting, `step` steps from `from`; a whole number becomes an integer.
    pub fn setting(&self, step: u64) -> (String, Value) {
        let value = self.value(step);
        let value = if value.fract() == 0.0 { Value::Integer(value as i64) } else { Value::Float(value) };
        (self.key.clone(), value)
    }

    /// Values that are flown first, as steps.
    pub fn grid(&self) -> Vec<u64> {
        let steps = self.steps();
        let parts = u64::from(self.grid).min(steps + 1) - 1;
        (0..=parts).map(|part| (part * steps + parts / 2) / parts).collect()
    }

    /// Searches the limit; `passes` flies a value given by its steps. Ends with `None` as soon as `passes`
    /// returns `None`.
    pub fn search(&self, mut passes: impl FnMut(u64) -> Option<bool>) -> Option<FoundLimit> {
        let grid = self.grid();
        let passed = grid.iter().map(|step| passes(*step)).collect::<Option<Vec<bool>>>()?;
        let mut flights = grid.len() as u64;
        let Some(first) = passed.iter().position(|passed| !passed) else {
            return Some(FoundLimit { limit: grid.last().copied(), fails_at: None, islands: vec![], flights });
        };
        let beyond = grid.iter().zip(&passed).skip(first);
        let islands = beyond.filter_map(|(step, passed)| passed.then_some(*step)).collect();
        let Some(before) = first.checked_sub(1) else {
            return Some(FoundLimit { limit: None, fails_at: Some(0), islands, flights });
        };
        let (mut pass, mut failure) = (grid[before], grid[first]);
        while failure - pass > 1 {
            let middle = pass.midpoint(failure);
            flights += 1;
            if passes(middle)? { pass = middle } else { failure = middle }
        }
        Some(FoundLimit { limit: Some(pass), fails_at: Some(failure), islands, flights })
    }

    /// Least and largest value of the true limit. They differ only if the search met an end of the range; then one of
    /// them is infinite.
    pub fn between(&self, limit: LimitSteps) -> [f64; 2] {
        let beyond = f64::INFINITY.copysign(self.to - self.from);
        let mut ends = match limit {
            None => [-beyond, self.from - self.resolution.copysign(self.to - self.from)],
            Some(step) if step == self.steps() => [self.to, beyond],
            Some(step) => [self.value(step); 2],
        };
        ends.sort_by(f64::total_cmp);
        ends
    }

    /// Returns whether a limit lies nearer to the safe end than `value`.
    pub fn is_before(&self, limit: LimitSteps, value: f64) -> bool {
        limit.is_none_or(|step| (value - self.value(step)) * (self.to - self.from) > 0.0)
    }

    /// Formats a limit with its unit; the text says so if the limit lies beyond an end of the range.
    pub fn words(&self, limit: LimitSteps, unit: &str) -> String {
        let more = if self.to > self.from { "more" } else { "less" };
        let words = match limit {
            None => format!("fails at {} {unit}", short(self.from)),
            Some(step) if step == self.steps() => format!("{} {unit} or {more}", short(self.to)),
            Some(step) => format!("{} {unit}", short(self.value(step))),
        };
        words.replace("  ", " ").trim_end().to_owned()
    }

    /// Cells of a search, for [`columns`].
    pub fn cells(&self, found: &FoundLimit) -> Vec<Cell> {
        let real = |step: LimitSteps| step.map_or(Cell::None, |step| Cell::Real(self.value(step)));
        let end = match (found.limit, found.fails_at) {
            (None, _) => "below",
            (_, None) => "or_more",
            _ => "within",
        };
        let islands: Vec<String> = found.islands.iter().map(|step| short(self.value(*step))).collect();
        vec![
            real(found.limit),
            Cell::Text(end.into()),
            real(found.fails_at),
            Cell::Int(found.flights as i64),
            Cell::Text(islands.join(", ")),
        ]
    }
}

/// Columns that a search adds to the table: the limit, its place in the range (`below`, `within` or `or_more`), the
/// first value that fails, the number of flights, the islands.
pub fn columns() -> Vec<(String, ColumnType)> {
    let columns = [
        (LIMIT, ColumnType::Real),
        ("limit_end", ColumnType::Text),
        ("limit_fails_at", ColumnType::Real),
        (FLIGHTS, ColumnType::Int),
        (ISLANDS, ColumnType::Text),
    ];
    columns.map(|(name, kind)| (name.to_owned(), kind)).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit(text: &str) -> Limit {
        toml::from_str(&format!("key = 'run.command_delay_ms'\n{text}")).unwrap()
    }

    /// Searches 0 to 70 in steps of 1; `passes` judges a value. Returns the result and the values flown, in order.
    fn searched(passes: impl Fn(u64) -> bool) -> (FoundLimit, Vec<u64>) {
        let mut flown = vec![];
        let found = limit("from = 0.0\nto = 70.0\nresolution = 1.0").search(|step| {
            flown.push(step);
            Some(passes(step))
        });
        (found.unwrap(), flown)
    }

    #[test]
    fn bisection_goes_into_the_first_step_of_the_grid_that_fails() {
        let (found, flown) = searched(|step| step <= 57);
        assert_eq!((found.limit, found.fails_at, found.flights), (Some(57), Some(58), 11));
        assert_eq!(flown, [0, 10, 20, 30, 40, 50, 60, 70, 55, 57, 58]);
        assert!(found.islands.is_empty());
    }

    /// A plain bisection would find 52 here, because the middle of the range passes.
    #[test]
    fn passes_beyond_the_first_failure_are_islands_and_do_not_count() {
        let (found, flown) = searched(|step| step <= 13 || (30..=52).contains(&step) || step == 70);
        assert_eq!((found.limit, found.fails_at), (Some(13), Some(14)));
        assert_eq!(found.islands, [30, 40, 50, 70]);
        assert_eq!(flown[8..], [15, 12, 13, 14]);
    }

    #[test]
    fn a_limit_beyond_the_range_is_reported_as_such() {
        let up = limit("from = 0.0\nto = 70.0\nresolution = 1.0");
        let (all, _) = searched(|_| true);
        assert_eq!((all.limit, all.fails_at, all.flights), (Some(70), None, 8));
        assert_eq!((up.words(all.limit, "ms"), up.between(all.limit)), ("70 ms or more".into(), [70.0, f64::INFINITY]));
        let (none, flown) = searched(|step| step > 5);
        assert_eq!((none.limit, none.fails_at, flown.len()), (None, Some(0), 8), "nothing below `from` is searched");
        assert_eq!(none.islands, [10, 20, 30, 40, 50, 60, 70]);
        assert_eq!((up.words(None, "ms"), up.between(None)), ("fails at 0 ms".into(), [f64::NEG_INFINITY, -1.0]));
        let [_, end, fails_at, ..] = &up.cells(&all)[..] else { panic!("five cells") };
        assert_eq!((end, fails_at), (&Cell::Text("or_more".into()), &Cell::None));
        assert_eq!(up.cells(&none)[..2], [Cell::None, Cell::Text("below".into())]);
        let [low, high] = up.between(Some(69));
        assert_eq!((low, high, up.words(Some(69), "")), (69.0, 69.0, "69".into()));
    }

    #[test]
    fn a_search_goes_downwards_from_the_larger_end() {
        let down = limit("from = 2.0\nto = 0.5\nresolution = 0.1\ngrid = 4");
        assert_eq!(down.grid().iter().map(|step| down.value(*step)).collect::<Vec<_>>(), [2.0, 1.5, 1.0, 0.5]);
        let found = down.search(|step| Some(down.value(step) > 1.25)).unwrap();
        assert_eq!(found.limit.map(|step| down.value(step)), Some(1.3));
        assert_eq!(down.words(Some(15), "m"), "0.5 m or less");
        assert_eq!((down.words(None, "m"), down.between(Some(15))), ("fails at 2 m".into(), [f64::NEG_INFINITY, 0.5]));
        assert_eq!((0..=15).map(|step| down.step(down.value(step))).collect::<Vec<_>>(), (0..=15).collect::<Vec<_>>());
    }

    #[test]
    fn whole_values_are_whole_numbers_and_a_short_range_is_flown_whole() {
        let whole = limit("from = 10\nto = 14\nresolution = 1");
        assert_eq!(whole.grid(), [0, 1, 2, 3, 4]);
        assert_eq!(whole.setting(3).1, Value::Integer(13));
        let found = whole.search(|step| Some(step < 3)).unwrap();
        assert_eq!((found.limit, found.flights), (Some(2), 5), "neighbours need no bisection");
        let tenths = limit("from = 0\nto = 1\nresolution = 0.1");
        assert_eq!(tenths.setting(3).1, Value::Float(0.3));
    }

    #[test]
    fn a_search_ends_with_a_flight_that_has_no_verdict() {
        let mut flown = 0;
        let found = limit("from = 0\nto = 70\nresolution = 1").search(|step| {
            flown += 1;
            (step < 20).then_some(true)
        });
        assert_eq!((found, flown), (None, 3));
    }

    #[test]
    fn numbers_that_make_no_search_are_refused() {
        for (numbers, part) in [
            ("from = 1\nto = 1\nresolution = 1", "two finite ends"),
            ("from = 0\nto = inf\nresolution = 1", "two finite ends"),
            ("from = 0\nto = 10\nresolution = 0", "above 0 and at most that of the ends, 10"),
            ("from = 0\nto = 10\nresolution = 11", "above 0 and at most"),
            ("from = 0\nto = 10\nresolution = 3", "does not divide the range from 0 to 10"),
            ("from = 0\nto = 1e7\nresolution = 1", "at most 1000000"),
            ("from = 0\nto = 10\nresolution = 1\ngrid = 1", "2 or more"),
        ] {
            let said = limit(numbers).check().unwrap_err().to_string();
            assert!(said.contains(part), "{numbers}: {said}");
        }
        limit("from = 0.0\nto = 0.3\nresolution = 0.1").check().unwrap();
    }
}
