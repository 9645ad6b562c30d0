//! `campaign.html`: how often, which controller more, where the border is, and which are the worst.
//!
//! | module | holds |
//! |---|---|
//! | `setup` | what all flights have in common, and their bounds |
//! | `pairs` | the controllers compared draw by draw |
//! | `bins` | the values of a factor, few enough to stand on an axis |
//! | `factors` | each factor by itself |
//! | `maps` | every two factors, with the border |
//! | `worst` | the flights that went worst, flown again for the page |

mod bins;
mod factors;
mod maps;
mod pairs;
mod setup;
mod worst;

use std::collections::BTreeMap;

use view::draw::{self, STYLE, Share, escape, list};

use crate::outcome::Verdict;
use crate::plan::Plan;
use crate::rate::Rate;
use crate::table::{Cell, Table};
use bins::Binned;
use setup::Bound;

const OWN_STYLE: &str = include_str!("../../assets/campaign.css");
/// Columns of a plan that are no factors.
const NO_FACTORS: [&str; 3] = ["flight", "controller", "run.seed"];
/// Reasons that are told.
const REASONS: usize = 12;

/// How many of the flights that `meant` picks are passed; those that could not be flown are not counted.
pub fn rate(flights: &Table, meant: impl Fn(usize) -> bool) -> Rate {
    let Some(verdicts) = flights.column("verdict") else { return Rate::of(0, 0) };
    let (mut passed, mut flown) = (0, 0);
    for row in (0..flights.rows()).filter(|row| meant(*row)) {
        let verdict = verdicts.text(row);
        passed += usize::from(verdict == Verdict::Passed.name());
        flown += usize::from(verdict != Verdict::Invalid.name());
    }
    Rate::of(passed, flown)
}

/// The page of some flights of a plan. `again` with a number behind it is what a user types to fly one again.
pub fn page(plan: &Plan, flights: &Table, again: &str) -> anyhow::Result<String> {
    let all = Page::new(plan, flights);
    let worst = worst::section(&all, again)?;
    let names: Vec<&str> = all.names.clone();
    let body = [
        all.head(),
        all.controllers(),
        pairs::section(&names, &all.by_draw()),
        all.causes(),
        all.invalid(),
        factors::section(&all),
        maps::section(&all),
        worst,
        setup::section(plan),
    ];
    let title = format!("Campaign {}", plan.campaign.name());
    Ok(draw::page(&title, &format!("{STYLE}{OWN_STYLE}"), &body.concat()))
}

struct Page<'a> {
    plan: &'a Plan,
    flights: &'a Table,
    /// Of the controllers.
    names: Vec<&'a str>,
    /// The number of the flight of each row.
    numbers: Vec<u64>,
    /// Its controller, as an index of `names`.
    controllers: Vec<usize>,
    /// Whether it passed; `None` where it could not be flown.
    passed: Vec<Option<bool>>,
    bounds: Vec<Bound>,
    error: Error,
}

/// The position error that the plots show.
struct Error {
    words: &'static str,
    /// The bound of all flights \[m\].
    limit: Option<f64>,
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

    fn of(&self, row: usize) -> Option<f64> {
        self.values[row]
    }
}

impl<'a> Page<'a> {
    fn new(plan: &'a Plan, flights: &'a Table) -> Self {
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

    fn rows(&self) -> usize {
        self.flights.rows()
    }

    /// The draw of a row: flights of the same draw differ by their controllers only.
    fn draw(&self, row: usize) -> u64 {
        self.numbers[row] / self.names.len() as u64
    }

    /// Whether each controller passes each draw.
    fn by_draw(&self) -> Vec<Vec<Option<bool>>> {
        let mut draws: BTreeMap<u64, Vec<Option<bool>>> = BTreeMap::new();
        for row in 0..self.rows() {
            let draw = draws.entry(self.draw(row)).or_insert_with(|| vec![None; self.names.len()]);
            draw[self.controllers[row]] = self.passed[row];
        }
        draws.into_values().collect()
    }

    /// The factors that vary; `parts` says in how many parts so many flights of a controller are divided.
    fn factors(&self, parts: impl Fn(usize) -> usize) -> Vec<Binned> {
        let columns = self.plan.columns();
        let factors = columns.iter().filter(|(name, _)| !NO_FACTORS.contains(&name.as_str()));
        factors.filter_map(|(name, _)| Binned::of(self.flights, name, |rows| parts(rows / self.names.len()))).collect()
    }

    /// How many of the flights of these rows are passed.
    fn rate(&self, meant: impl Fn(usize) -> bool) -> Rate {
        let flown = (0..self.rows()).filter(|row| meant(*row)).filter_map(|row| self.passed[row]);
        let (passed, all) = flown.fold((0, 0), |(passed, all), one| (passed + usize::from(one), all + 1));
        Rate::of(passed, all)
    }

    fn head(&self) -> String {
        let (there, planned) = (self.rows() as u64, self.plan.flights());
        let all = self.rate(|_| true);
        let invalid = self.rows() - all.flights;
        let partial = if there < planned {
            format!("<p class=\"warn\">{there} of {planned} flights are there: the same command flies the others.</p>")
        } else {
            String::new()
        };
        let mut tiles = vec![];
        // A rate over several controllers is the rate of none.
        if self.names.len() == 1 {
            let share = if all.flights == 0 { draw::DASH.to_owned() } else { percent(&all, " <small>%</small>") };
            tiles.push(("passed".to_owned(), share));
            tiles.push(("exact 95 % interval".to_owned(), all.interval()));
        } else {
            tiles.push(("controllers".to_owned(), self.names.len().to_string()));
            tiles.push(("draws that each of them flies".to_owned(), (planned / self.names.len() as u64).to_string()));
        }
        tiles.push(("failed".to_owned(), (all.flights - all.survived).to_string()));
        tiles.push(("invalid: could not be flown, and counted as neither".to_owned(), invalid.to_string()));
        format!(
            "<p class=\"kind\">Campaign</p><h1>{}</h1><p class=\"facts\"><span><b>{there}</b> flights</span>\
             <span>seed <b>{}</b></span><span>campaign <b>{}</b></span></p>{partial}<div class=\"tiles\">{}</div><p>{}</p>",
            escape(self.plan.campaign.name()),
            self.plan.campaign.seed(),
            &self.plan.campaign.hash()[..12],
            list(tiles),
            escape(&setup::passed(&self.bounds))
        )
    }

    fn controllers(&self) -> String {
        if self.names.len() == 1 {
            return String::new();
        }
        let row = |(i, name): (usize, &&str)| {
            let rate = self.rate(|row| self.controllers[row] == i);
            let share = Share { share: rate.share(), low: rate.low, high: rate.high };
            let (share, picture) = match rate.flights {
                0 => (draw::DASH.to_owned(), String::new()),
                _ => (percent(&rate, " %"), draw::interval(&share)),
            };
            vec![escape(name), rate.survived.to_string(), rate.flights.to_string(), share, rate.interval(), picture]
        };
        let headings = ["controller", "passed", "of", "share", "exact 95 % interval", "0 to 100 %"];
        let table = draw::table(&headings, self.names.iter().enumerate().map(row));
        let next = if self.names.len() > 1 {
            " Intervals that overlap do not say that the controllers are alike: the next table compares them draw by draw."
        } else {
            ""
        };
        format!(
            "<section id=\"controllers\"><h2>Controllers</h2><p>The share of flights passed, with the interval of Clopper and \
             Pearson.{next}</p>{table}</section>"
        )
    }

    /// Of what the flights of each controller failed.
    fn causes(&self) -> String {
        let Some(causes) = self.flights.column("cause") else { return String::new() };
        let mut counts: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for row in (0..self.rows()).filter(|row| self.passed[*row] == Some(false)) {
            counts.entry(causes.text(row)).or_insert_with(|| vec![0; self.names.len()])[self.controllers[row]] += 1;
        }
        if counts.is_empty() {
            return String::new();
        }
        let mut counts: Vec<(&str, Vec<usize>)> = counts.into_iter().collect();
        counts.sort_by_key(|(_, counts)| std::cmp::Reverse(counts.iter().sum::<usize>()));
        let headings: Vec<&str> = std::iter::once("controller").chain(counts.iter().map(|(cause, _)| *cause)).collect();
        let row = |(i, name): (usize, &&str)| {
            std::iter::once(escape(name)).chain(counts.iter().map(|(_, counts)| counts[i].to_string())).collect()
        };
        let table = draw::table(&headings, self.names.iter().enumerate().map(row));
        format!(
            "<section id=\"causes\"><h2>Why flights failed</h2><p>Failed flights by their cause.</p>{table}</section>"
        )
    }

    /// Why flights could not be flown.
    fn invalid(&self) -> String {
        let Some(outcomes) = self.flights.column("outcome") else { return String::new() };
        let mut reasons: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
        for row in (0..self.rows()).filter(|row| self.passed[*row].is_none()) {
            reasons.entry(outcomes.text(row)).or_default().push(self.numbers[row]);
        }
        if reasons.is_empty() {
            return String::new();
        }
        let mut reasons: Vec<(&str, Vec<u64>)> = reasons.into_iter().collect();
        reasons.sort_by_key(|(_, numbers)| std::cmp::Reverse(numbers.len()));
        let others = match reasons.len() {
            0..=REASONS => String::new(),
            all => format!("<p>{} more reasons are in the column <code>outcome</code>.</p>", all - REASONS),
        };
        let row = |(reason, numbers): &(&str, Vec<u64>)| {
            vec![escape(reason), numbers.len().to_string(), numbers[0].to_string()]
        };
        let table = draw::table(&["reason", "flights", "the first"], reasons.iter().take(REASONS).map(row));
        format!(
            "<section id=\"invalid\"><h2>Flights that could not be flown</h2><p>They count as neither passed nor \
             failed.</p>{table}{others}</section>"
        )
    }
}

/// The share of a rate in percent.
fn percent(rate: &Rate, sign: &str) -> String {
    format!("{:.1}{sign}", 100.0 * rate.share())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Campaign, outcome, shard};

    /// All flights of a campaign.
    fn flown(text: &str) -> (Plan, Table) {
        let plan = Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let mut table = Table::new(&shard::columns(&plan));
        for number in 0..plan.flights() {
            let flight = plan.flight(number);
            let outcome = outcome::fly(&flight, || true, |_| {}).unwrap();
            table.push([plan.cells(&flight), outcome.cells].concat());
        }
        (plan, table)
    }

    #[test]
    fn the_page_has_rates_border_and_the_worst_flights_with_their_commands() {
        let (plan, table) = flown(
            "samples = 3\n[settings]\nrun.duration_s = 1.0\n[vary]\nmpc.np = [4, 20]\nmpc.nu = [3, 5]\n\
             bounds.max_position_error_m = [1e-9, 1.0]\nplant.airframe.mass_kg = { uniform = [1.0, 1.3] }\n",
        );
        let invalid = rate(&table, |row| table.column("verdict").unwrap().text(row) == "invalid");
        assert_eq!(invalid.flights, 0, "counted as neither");
        assert_eq!((rate(&table, |_| true).survived, rate(&table, |_| true).flights), (9, 18));
        let html = page(&plan, &table, "launcher campaign x.toml --only").unwrap();
        for part in [
            "50.0 <small>%</small>",
            "26.0 to 74.0 %",
            "plant.airframe.mass_kg",
            "class=\"border\"",
            "<code>launcher campaign x.toml --only ",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert_eq!(html.matches("class=\"worst\"").count(), 9, "those that failed");
    }

    #[test]
    fn the_page_says_why_flights_failed_or_could_not_be_flown() {
        let (plan, table) = flown(
            "[settings]\nrun.duration_s = 1.0\n[vary]\nmpc.np = [4, 20]\nmpc.nu = [3, 5]\n\
             bounds.max_position_error_m = [1e-9, 1.0]\n",
        );
        let html = page(&plan, &table, "").unwrap();
        for part in [
            "<th scope=\"col\">position error</th>",
            "<td data-label=\"position error\">3</td>",
            "`mpc.nu` = 5 is longer than `mpc.np` = 4",
            "<td data-label=\"flights\">2</td><td data-label=\"the first\">1</td>",
            "position error by a limit that is not the same in all flights",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
    }

    #[test]
    fn several_controllers_are_compared_draw_by_draw_and_never_pooled() {
        let (plan, table) = flown(
            "seeds = 5\n[settings]\nrun.duration_s = 1.0\n[controller.lax]\nbounds.max_position_error_m = 1.0\n\
             [controller.strict]\nbounds.max_position_error_m = 1e-9\n",
        );
        let page_of = Page::new(&plan, &table);
        assert_eq!(page_of.by_draw(), vec![vec![Some(true), Some(false)]; 5]);
        assert_eq!(page_of.rows(), 10);
        let html = page(&plan, &table, "").unwrap();
        assert!(
            html.contains("<td data-label=\"only A passes\">5</td><td data-label=\"only B passes\">0</td>"),
            "{html}"
        );
        assert!(html.contains(">0.0625</td>") && !html.contains("<dt>passed</dt>"), "{html}");
        assert_eq!(html.matches("The same draw passed under lax.").count(), 5, "each draw once");
    }

    #[test]
    fn a_page_of_no_flights_is_a_page() {
        let plan = Plan::new(Campaign::read("", "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let html = page(&plan, &Table::new(&shard::columns(&plan)), "").unwrap();
        assert!(html.contains("0 of 1 flights are there"), "{html}");
    }
}
