//! The promises about time, and whether they are kept.

use super::results::{Ring, TimingResults};
use super::series::Ratio;
use super::timed_flights::TimedFlights;
use crate::findings::Target;

/// What a machine without the privilege cannot show.
const NO_FIFO: &str = "without the privilege for SCHED_FIFO";

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
    // A canary that was kept waiting leaves no verdict on time.
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

fn overhead(ring: &Ring) -> Target {
    let figure = format!("stamping over the ring's time, {}", ring.placement.name());
    let spread = ring.stamps_percent.map(|ratio| format!("rounds {}", ratio.spread()));
    let counted = ring.stamps_counted_percent.map(|percent| format!("{percent:.2} % by counting calls"));
    let note = spread.into_iter().chain(counted).collect::<Vec<_>>().join("; ");
    Target::at_most(figure, ring.stamps_percent.map(|ratio| ratio.median), 2.0, "%").noting(note)
}

fn ratio_at_most(figure: String, ratio: Option<Ratio>, limit: f64, missing: &str) -> Target {
    let note = ratio.map_or(missing.to_owned(), |ratio| format!("rounds {}", ratio.spread()));
    Target::at_most(figure, ratio.map(|ratio| ratio.median), limit, "").noting(note)
}
