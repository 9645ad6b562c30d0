//! The tables: loops and rings, a hop's parts, what their calls cost, flights.

use super::costs::Costs;
use super::results::{Flights, Hop, Results, Ring};
use crate::mpc::distribution::Distribution;

/// A table with a title: a heading for each column, and rows of as many cells.
pub struct Table {
    /// What it shows.
    pub title: &'static str,
    /// The columns; the first names the row.
    pub headings: Vec<&'static str>,
    /// The cells.
    pub rows: Vec<Vec<String>>,
}

/// All results as tables.
pub fn tables(results: &Results) -> Vec<Table> {
    vec![times(results), hops(results), calls(&results.costs), flights(results)]
}

/// Tables as text.
pub fn text(tables: &[Table]) -> String {
    tables.iter().map(Table::text).collect::<Vec<_>>().join("\n")
}

fn times(results: &Results) -> Table {
    let mut rows: Vec<Vec<String>> =
        results.series.iter().filter(|(name, _)| !name.starts_with("age")).map(|(name, d)| spread(name, d)).collect();
    let canary = &results.canary;
    rows.extend(canary.noted.iter().map(|d| spread("canary, wake-ups", d)));
    rows.extend(canary.covered.iter().map(|d| spread("canary, every slot covered", d)));
    Table {
        title: "Loops, rings and hops [us], all rounds; rings: from the release to the token's return, \
                stack: age at the actuator without execution",
        headings: vec!["", "n", "p50", "p90", "p99", "p99.9", "max"],
        rows,
    }
}

fn spread(name: &str, d: &Distribution) -> Vec<String> {
    let times = [d.p50_us, d.p90_us, d.p99_us, d.p999_us, d.max_us].map(|us| format!("{us:.1}"));
    [name.to_owned(), d.n.to_string()].into_iter().chain(times).collect()
}

fn hops(results: &Results) -> Table {
    let row = |ring: &Ring| {
        let Hop { all_ns, kernel_ns, clock_ns, send_ns, receive_ns, rest_ns } = ring.hop?;
        let parts = [all_ns, kernel_ns, clock_ns, send_ns, receive_ns, rest_ns].map(|ns| format!("{ns:.0}"));
        Some([ring.placement.name().to_owned()].into_iter().chain(parts).collect())
    };
    Table {
        title: "Where a quarter of the ring's time goes [ns], without execution",
        headings: vec!["", "all", "kernel", "clock", "send", "receive", "rest"],
        rows: results.rings.iter().filter_map(row).collect(),
    }
}

fn calls(costs: &Costs) -> Table {
    let row = |name: &str, send_ns: f64, receive_ns: f64| {
        [name.to_owned()].into_iter().chain([send_ns, receive_ns].map(|ns| format!("{ns:.0}"))).collect()
    };
    Table {
        title: "What one call costs a thread [ns]",
        headings: vec!["", "send", "receive"],
        rows: vec![
            row("one after the other", costs.send_ns, costs.receive_ns),
            row("after 10 ms asleep", costs.cold_send_ns, costs.cold_receive_ns),
        ],
    }
}

fn flights(results: &Results) -> Table {
    let row = |f: &Flights| {
        let age = |of: fn(&Distribution) -> f64| f.age.as_ref().map_or("-".to_owned(), |d| format!("{:.0}", of(d)));
        vec![
            f.name.clone(),
            f.circumstances() + if f.as_asked { "" } else { " (refused)" },
            f.slots.to_string(),
            f.misses.to_string(),
            f.explained.to_string(),
            f.longest_run.to_string(),
            age(|d| d.p50_us),
            age(|d| d.p99_us),
            age(|d| d.max_us),
            f.cpu_percent.map_or("-".to_owned(), |percent| format!("{percent:.1}")),
            if f.inside { "yes" } else { "no" }.to_owned(),
        ]
    };
    Table {
        title: "The stack's flights: misses, those of them that the canary explains, the longest run; age at the actuator [us]; CPU [%]",
        headings: vec!["", "how", "slots", "misses", "explained", "run", "age p50", "p99", "max", "CPU", "inside"],
        rows: results.flights.iter().map(row).collect(),
    }
}

impl Table {
    fn text(&self) -> String {
        let lines =
            || std::iter::once(self.headings.iter().map(|h| (*h).to_owned()).collect()).chain(self.rows.clone());
        let width = |column: usize| lines().map(|row: Vec<String>| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.headings.len()).map(width).collect();
        let mut text = format!("{}\n", self.title);
        for row in lines() {
            let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, &width))| match cell.parse::<f64>() {
                Err(_) if i == 0 || self.rows.iter().all(|r| r[i].parse::<f64>().is_err()) => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            });
            text += cells.collect::<Vec<_>>().join("  ").trim_end();
            text.push('\n');
        }
        text
    }
}
