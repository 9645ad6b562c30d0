//! `campaign.html`: how often, where the border is, and which are the worst.
//!
//! | module | holds |
//! |---|---|
//! | `bins` | the values of a factor, few enough to stand on an axis |
//! | `worst` | the flights that went worst, flown again for the page |

mod bins;
mod worst;

use view::draw::{self, STYLE, ShareCell, escape, list, share_map};

use crate::outcome::Verdict;
use crate::plan::Plan;
use crate::rate::Rate;
use crate::table::Table;
use bins::Binned;

const OWN_STYLE: &str = include_str!("../../assets/campaign.css");
/// Dots of a scatter plot.
const DOTS: usize = 2000;
/// Factors of which every pair has a map: those that matter most.
const MAPPED: usize = 6;

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
    let names: Vec<&str> = plan.campaign.controllers.iter().map(|(name, _)| name.as_str()).collect();
    let factors: Vec<Binned> = plan
        .columns()
        .iter()
        .filter(|(name, _)| !["flight", "controller", "run.seed", "random_faults"].contains(&name.as_str()))
        .filter_map(|(name, _)| Binned::of(flights, name))
        .collect();
    let all = Page { plan, flights, names, factors };
    let worst = worst::section(plan, flights, again)?;
    let title = format!("Campaign {}", plan.campaign.name());
    let body = all.head() + &all.controllers() + &all.marginals() + &all.maps() + &worst;
    Ok(draw::page(&title, &format!("{STYLE}{OWN_STYLE}"), &body))
}

/// The rows that are drawn as dots: all, or as many as are clear, whatever the pattern in which the rows stand.
fn chosen(rows: usize) -> impl Iterator<Item = usize> {
    // Multiples of the golden ratio leave no gap and keep no step.
    let place = |row: usize| (row as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) as f64 / u64::MAX as f64;
    (0..rows).filter(move |row| rows <= DOTS || place(*row) * (rows as f64) < DOTS as f64)
}

struct Page<'a> {
    plan: &'a Plan,
    flights: &'a Table,
    /// Of the controllers.
    names: Vec<&'a str>,
    factors: Vec<Binned>,
}

impl Page<'_> {
    fn head(&self) -> String {
        let (there, planned) = (self.flights.rows() as u64, self.plan.flights());
        let all = rate(self.flights, |_| true);
        let invalid = self.flights.rows() - all.flights;
        let share =
            if all.flights == 0 { "-".to_owned() } else { format!("{:.1} <small>%</small>", 100.0 * all.share()) };
        let partial = if there < planned {
            format!("<p class=\"warn\">{there} of {planned} flights are there: the same command flies the others.</p>")
        } else {
            String::new()
        };
        let tiles = list([
            ("passed".into(), share),
            ("exact 95 % interval".into(), all.interval()),
            ("failed".into(), (all.flights - all.survived).to_string()),
            ("invalid: could not be flown, and counted as neither".into(), invalid.to_string()),
        ]);
        format!(
            "<p class=\"kind\">Campaign</p><h1>{}</h1><p class=\"facts\"><span><b>{there}</b> flights</span>\
             <span>seed <b>{}</b></span><span>campaign <b>{}</b></span></p>{partial}<div class=\"tiles\">{tiles}</div>",
            escape(self.plan.campaign.name()),
            self.plan.campaign.seed(),
            &self.plan.campaign.hash()[..12],
        )
    }

    /// Whether a flight is of a controller.
    fn is_of(&self, name: &str, row: usize) -> bool {
        self.flights.column("controller").is_some_and(|all| all.text(row) == name)
    }

    fn controllers(&self) -> String {
        let row = |name: &&str| {
            let rate = rate(self.flights, |row| self.is_of(name, row));
            let share = if rate.flights == 0 { "-".into() } else { format!("{:.1} %", 100.0 * rate.share()) };
            vec![escape(name), rate.survived.to_string(), rate.flights.to_string(), share, rate.interval()]
        };
        let headings = ["controller", "passed", "of", "share", "exact 95 % interval"];
        let table = draw::table(&headings, self.names.iter().map(row));
        format!(
            "<section id=\"controllers\"><h2>Controllers</h2><p>The share of flights passed, with the interval of Clopper and \
             Pearson. A flight is passed when <code>launcher fly</code> would end with 0.</p>{table}</section>"
        )
    }

    /// Each factor by itself.
    fn marginals(&self) -> String {
        if self.factors.is_empty() {
            return String::new();
        }
        let legend = draw::legend(&self.names);
        let plots: String = self.factors.iter().map(|factor| self.marginal(factor)).collect();
        let dots = chosen(self.flights.rows()).count();
        format!(
            "<section id=\"factors\"><h2>Factors</h2><p>Left: the share passed over one factor, whatever the others were, with \
             exact 95 % intervals. Right: the largest position error [m] of {dots} flights; those that were not \
             passed are orange.</p>{legend}{plots}</section>"
        )
    }

    fn marginal(&self, factor: &Binned) -> String {
        let of_bin = |name: &str, bin: usize| {
            let rate = rate(self.flights, |row| factor.bin(row) == Some(bin) && self.is_of(name, row));
            (rate.flights > 0).then(|| draw::Share { share: rate.share(), low: rate.low, high: rate.high })
        };
        let bins = 0..factor.labels.len();
        let series: Vec<(&str, Vec<_>)> =
            self.names.iter().map(|name| (*name, bins.clone().map(|bin| of_bin(name, bin)).collect())).collect();
        let shares = draw::shares(&factor.name, &factor.labels, &series);
        format!("<h3>{}</h3><div class=\"plots\">{shares}{}</div>", escape(&factor.name), self.scatter(factor))
    }

    fn scatter(&self, factor: &Binned) -> String {
        let (Some(errors), Some(verdicts), Some(values)) = (
            self.flights.column("max_position_error_m"),
            self.flights.column("verdict"),
            self.flights.column(&factor.name),
        ) else {
            return String::new();
        };
        let point =
            |row: usize| Some((values.number(row)?, errors.number(row)?, verdicts.text(row) != Verdict::Passed.name()));
        let points: Vec<_> = chosen(self.flights.rows()).filter_map(point).collect();
        draw::scatter([&factor.name, "largest error [m]"], &points)
    }

    /// Every two factors together.
    fn maps(&self) -> String {
        let mut by_effect: Vec<(f64, &Binned)> =
            self.factors.iter().map(|factor| (self.effect(factor), factor)).collect();
        by_effect.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mapped: Vec<&Binned> = by_effect.iter().take(MAPPED).map(|(_, factor)| *factor).collect();
        let mut maps = String::new();
        for (i, across) in mapped.iter().enumerate() {
            for up in &mapped[i + 1..] {
                let together = self.map("", across, up, |_| true);
                let own = |name: &&str| self.map(name, across, up, |row| self.is_of(name, row));
                let apart = match self.names.len() {
                    1 => String::new(),
                    _ => format!(
                        "<details><summary>by controller</summary><div class=\"plots\">{}</div></details>",
                        self.names.iter().map(own).collect::<String>()
                    ),
                };
                maps += "<h3>";
                maps += &[escape(&across.name), escape(&up.name)].join(" and ");
                maps.extend(["</h3>", &together, &apart]);
            }
        }
        if maps.is_empty() {
            return String::new();
        }
        let chosen = if self.factors.len() > MAPPED {
            format!(" Of {} factors these are the {MAPPED} over which the share changes most.", self.factors.len())
        } else {
            String::new()
        };
        format!(
            "<section id=\"maps\"><h2>Two factors</h2><p>Percent passed over two factors, whatever the others were, from dark (0) \
             to bright (100). The orange line is the border: on one side less than half is passed. Where no cell is, no flight \
             was.{chosen}</p>{maps}</section>"
        )
    }

    /// How far apart the shares of the values of a factor are.
    fn effect(&self, factor: &Binned) -> f64 {
        let shares = (0..factor.labels.len()).map(|bin| rate(self.flights, |row| factor.bin(row) == Some(bin)));
        let shares: Vec<f64> = shares.filter(|rate| rate.flights > 0).map(|rate| rate.share()).collect();
        shares.iter().copied().fold(0.0, f64::max) - shares.iter().copied().fold(1.0, f64::min)
    }

    fn map(&self, title: &str, across: &Binned, up: &Binned, meant: impl Fn(usize) -> bool) -> String {
        let (columns, rows) = (across.labels.len(), up.labels.len());
        let mut counts = vec![vec![(0_usize, 0_usize); columns]; rows];
        let verdicts = self.flights.column("verdict");
        for row in (0..self.flights.rows()).filter(|row| meant(*row)) {
            let verdict = verdicts.map_or("", |all| all.text(row));
            let (Some(column), Some(line)) = (across.bin(row), up.bin(row)) else { continue };
            if verdict != Verdict::Invalid.name() {
                counts[line][column].1 += 1;
                counts[line][column].0 += usize::from(verdict == Verdict::Passed.name());
            }
        }
        let cell = |(line, column): (usize, usize)| {
            let (passed, flown) = counts[line][column];
            let title = format!("{}, {}: {passed} of {flown} passed", across.labels[column], up.labels[line]);
            (flown > 0).then(|| ShareCell { share: passed as f64 / flown as f64, title })
        };
        let cells: Vec<Vec<_>> =
            (0..rows).map(|line| (0..columns).map(|column| cell((line, column))).collect()).collect();
        share_map(title, [&across.name, &up.name], [&across.labels, &up.labels], &cells)
    }
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
    fn the_dots_are_of_all_controllers_alike() {
        assert_eq!(chosen(5).count(), 5);
        let rows: Vec<usize> = chosen(12_000).collect();
        assert!(rows.len().abs_diff(DOTS) < 5, "{}", rows.len());
        for controller in 0..12 {
            let share = rows.iter().filter(|row| *row % 12 == controller).count();
            assert!(share.abs_diff(DOTS / 12) < 10, "{share} of controller {controller}");
        }
    }

    #[test]
    fn a_page_of_no_flights_is_a_page() {
        let plan = Plan::new(Campaign::read("", "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let html = page(&plan, &Table::new(&shard::columns(&plan)), "").unwrap();
        assert!(html.contains("0 of 1 flights are there"), "{html}");
    }
}
