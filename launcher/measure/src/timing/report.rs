//! Report of the results: tables and targets.

use outcome::percentiles::Percentiles;

use super::raw::policy_name;
use super::results::{RingTimes, TimingResults};
use super::series::Ratio;
use super::timed_flights::TimedFlights;
use outcome::target::Target;
use view::table::{Table, cell};

/// Note on targets if the machine does not give the privilege.
const NO_FIFO: &str = "without the privilege for SCHED_FIFO";

/// Returns all results as tables.
pub fn tables(results: &TimingResults) -> Vec<Table> {
    vec![times(results), flown(results)]
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

fn flown(results: &TimingResults) -> Table {
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

pub fn targets(results: &TimingResults) -> Vec<Target> {
    let mut targets = vec![];
    for ((name, limit), ratio) in
        [("p50", 1.3), ("p99", 1.3), ("max", 1.2)].into_iter().zip(results.loop_over_cyclictest)
    {
        let figure = format!("1 kHz loop over cyclictest, {name}");
        targets.push(ratio_at_most(figure, ratio, limit, "cyclictest is not installed"));
    }
    for ring in &results.rings {
        for (name, ratio, limit) in [("p50", ring.p50_over_raw, 1.5), ("p99", ring.p99_over_raw, 2.0)] {
            let figure = format!("ring over raw futex ring, {}, {name}", ring.placement.name());
            targets.push(ratio_at_most(figure, ratio, limit, "no command took effect"));
        }
    }
    targets.extend(flights(results));
    targets.push(stress(results));
    let speeds =
        [("lockstep through four processes", results.lockstep, 40.0), ("in process", results.in_process, 300.0)];
    targets.extend(speeds.map(|(name, ratio, limit)| {
        let note = ratio.map_or(String::new(), |ratio| format!("rounds {:.0} to {:.0}", ratio.min, ratio.max));
        let figure = format!("{name}, times real time");
        Target::at_least(figure, ratio.map(|ratio| ratio.median), limit).noting(note)
    }));
    targets.extend(results.rings.iter().map(overhead));
    // If a canary was delayed, times cannot be judged.
    match results.canary.doubt.clone().or((!results.fifo).then(|| NO_FIFO.to_owned())) {
        Some(why) => targets.into_iter().map(|target| target.in_doubt(why.clone())).collect(),
        None => targets,
    }
}

fn flights(results: &TimingResults) -> [Target; 4] {
    let paper = results.flights("paper survey");
    let age = paper.and_then(|flights| flights.age);
    let inside = paper.is_some_and(|flights| flights.inside);
    let quiet = || results.flights.iter().filter(|f| f.name == "paper survey" || f.name == "SCHED_FIFO idle");
    let sum = |of: fn(&TimedFlights) -> usize| quiet().map(of).sum::<usize>();
    let note = format!("{} slots; the canary explains {} more", sum(|f| f.slots), sum(|f| f.explained));
    let misses = sum(TimedFlights::unexplained);
    [
        Target::at_most("age at the actuator, 100 Hz, p50", age.map(|d| d.p50_us), 1000.0, "us"),
        Target::at_most("age at the actuator, 100 Hz, p99", age.map(|d| d.p99_us), 2000.0, "us"),
        Target::when("profile paper in real time", Some(f64::from(inside)), "inside its bounds", |is| is > 0.0),
        Target::none("idle, SCHED_FIFO, 100 Hz: misses not explained", misses).noting(note),
    ]
}

fn stress(results: &TimingResults) -> Target {
    let figure = "misses under stress-ng --cpu 4, SCHED_FIFO over SCHED_OTHER";
    let flights = ["SCHED_FIFO under load", "SCHED_OTHER under load"].map(|name| results.flights(name));
    let [Some(fifo), Some(other)] = flights else {
        return Target::at_most(figure, None, 0.05, "").noting("stress-ng is not installed");
    };
    let [ours, theirs] = [fifo, other].map(|flights| flights.unexplained() as f64 / flights.slots as f64);
    let [of_fifo, of_other] = [fifo, other].map(|flights| format!("{} of {}", flights.unexplained(), flights.slots));
    let note = format!(
        "{of_fifo} slots against {of_other}; explained by the canary and left out: {} and {}",
        fifo.explained, other.explained
    );
    Target::at_most(figure, (theirs > 0.0).then(|| ours / theirs), 0.05, "").noting(note)
}

fn overhead(ring: &RingTimes) -> Target {
    let figure = format!("stamping over the ring's time, {}", ring.placement.name());
    Target::at_most(figure, ring.stamps_percent, 2.0, "%").noting("readings of the clock, counted")
}

fn ratio_at_most(figure: String, ratio: Option<Ratio>, limit: f64, missing: &str) -> Target {
    let note = ratio.map_or(missing.to_owned(), |ratio| format!("rounds {}", ratio.spread()));
    Target::at_most(figure, ratio.map(|ratio| ratio.median), limit, "").noting(note)
}
