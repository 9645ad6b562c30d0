//! The tables: loops and rings, a hop's parts, what their calls cost, flights.

use super::costs::Costs;
use super::raw::policy_name;
use super::results::{Hop, Ring, TimingResults};
use super::timed_flights::TimedFlights;
use crate::table::{Table, cell};
use view::percentiles::Percentiles;

/// All results as tables.
pub fn tables(results: &TimingResults) -> Vec<Table> {
    vec![times(results), hops(results), calls(&results.costs), flights(results)]
}

fn times(results: &TimingResults) -> Table {
    let mut rows: Vec<Vec<String>> =
        results.series.iter().filter(|(name, _)| !name.starts_with("age")).map(|(name, d)| spread(name, d)).collect();
    let canary = &results.canary;
    rows.extend(canary.noted.iter().map(|d| spread("canary, wake-ups", d)));
    rows.extend(canary.covered.iter().map(|d| spread("canary, every slot covered", d)));
    Table::new(
        "Loops, rings and hops [us], all rounds; rings: from the release to the token's return, \
         stack: age at the actuator without execution",
        &["", "n", "p50", "p90", "p99", "p99.9", "max"],
        rows,
    )
}

fn spread(name: &str, d: &Percentiles) -> Vec<String> {
    let times = [d.p50_us, d.p90_us, d.p99_us, d.p999_us, d.max_us].map(|us| format!("{us:.1}"));
    [name.to_owned(), d.n.to_string()].into_iter().chain(times).collect()
}

fn hops(results: &TimingResults) -> Table {
    let row = |ring: &Ring| {
        let Hop { all_ns, kernel_ns, clock_ns, send_ns, receive_ns, rest_ns } = ring.hop?;
        let parts = [all_ns, kernel_ns, clock_ns, send_ns, receive_ns, rest_ns].map(|ns| format!("{ns:.0}"));
        Some([ring.placement.name().to_owned()].into_iter().chain(parts).collect())
    };
    Table::new(
        "Where a quarter of the ring's time goes [ns], without execution",
        &["", "all", "kernel", "clock", "send", "receive", "rest"],
        results.rings.iter().filter_map(row).collect(),
    )
}

fn calls(costs: &Costs) -> Table {
    let row = |name: &str, send_ns: f64, receive_ns: f64| {
        [name.to_owned()].into_iter().chain([send_ns, receive_ns].map(|ns| format!("{ns:.0}"))).collect()
    };
    Table::new(
        "What one call costs a thread [ns]",
        &["", "send", "receive"],
        vec![
            row("one after the other", costs.send_ns, costs.receive_ns),
            row("after 10 ms asleep", costs.cold_send_ns, costs.cold_receive_ns),
        ],
    )
}

fn flights(results: &TimingResults) -> Table {
    let row = |f: &TimedFlights| {
        let age = |of: fn(&Percentiles) -> f64| cell(f.age.as_ref().map(of), 0);
        let load = if f.loaded { "stress-ng --cpu 4" } else { "idle" };
        let refused = if f.as_asked { "" } else { " (refused)" };
        vec![
            f.name.clone(),
            format!("{} Hz, {}, {load}{refused}", f.rate_hz, policy_name(f.policy)),
            f.slots.to_string(),
            f.misses.to_string(),
            f.explained.to_string(),
            f.longest_run.to_string(),
            age(|d| d.p50_us),
            age(|d| d.p99_us),
            age(|d| d.max_us),
            cell(f.cpu_percent, 1),
            if f.inside { "yes" } else { "no" }.to_owned(),
        ]
    };
    Table::new(
        "The stack's flights: misses, those of them that the canary explains, the longest run; age at the actuator [us]; CPU [%]",
        &["", "how", "slots", "misses", "explained", "run", "age p50", "p99", "max", "CPU", "inside"],
        results.flights.iter().map(row).collect(),
    )
}
