//! The promises about time, and what became of them.

use super::machine::Placement;
use super::results::{FlightFigures, TimingResults};
use super::series::Ratio;
use crate::findings::Target;

/// What a machine without the privilege cannot show.
const NO_FIFO: &str = "without the privilege for SCHED_FIFO";

pub fn targets(results: &TimingResults) -> Vec<Target> {
    let mut targets = loops(results);
    targets.extend(rings(results));
    targets.extend(flights(results));
    targets.push(stress(results));
    // The rest is judged by what the machine gave: a canary that was kept waiting leaves no verdict on time.
    let doubt = results.canary.doubt.clone().or((!results.fifo).then(|| NO_FIFO.to_owned()));
    targets.push(at_least("lockstep through four processes, times real time", results.lockstep, 40.0));
    targets.push(at_least("in process, times real time", results.in_process, 300.0));
    targets.extend(overhead(results));
    match doubt {
        Some(why) => targets.into_iter().map(|target| target.in_doubt(why.clone())).collect(),
        None => targets,
    }
}

fn loops(results: &TimingResults) -> Vec<Target> {
    [("p50", 1.3), ("p99", 1.3), ("max", 1.2)]
        .into_iter()
        .zip(results.loop_over_cyclictest)
        .map(|((name, limit), ratio)| {
            ratio_at_most(format!("1 kHz loop over cyclictest, {name}"), ratio, limit, "cyclictest is not installed")
        })
        .collect()
}

fn rings(results: &TimingResults) -> Vec<Target> {
    let line = |placement: Placement, name: &str, ratio: Option<Ratio>, limit| {
        let figure = format!("ring over raw futex ring, {}, {name}", placement.name());
        ratio_at_most(figure, ratio, limit, "no command took effect")
    };
    let both = |ring: &super::results::Ring| {
        [line(ring.placement, "p50", ring.p50_over_raw, 1.5), line(ring.placement, "p99", ring.p99_over_raw, 2.0)]
    };
    results.rings.iter().flat_map(both).collect()
}

fn flights(results: &TimingResults) -> Vec<Target> {
    let paper = results.flights("paper survey");
    let age = paper.and_then(|flights| flights.age);
    let quiet: Vec<&FlightFigures> = results.flights.iter().filter(|f| is_quiet(f)).collect();
    let sum = |of: fn(&FlightFigures) -> usize| quiet.iter().map(|f| of(f)).sum::<usize>();
    let note = format!("{} slots; the canary explains {} more", sum(|f| f.slots), sum(|f| f.explained));
    let inside = paper.is_some_and(|flights| flights.inside);
    vec![
        Target::at_most("age at the actuator, 100 Hz, p50", age.map(|d| d.p50_us), 1000.0, "us"),
        Target::at_most("age at the actuator, 100 Hz, p99", age.map(|d| d.p99_us), 2000.0, "us"),
        Target::when("profile paper in real time", Some(f64::from(u8::from(inside))), "inside its bounds", |is| {
            is > 0.0
        }),
        Target::at_most(
            "idle, SCHED_FIFO, 100 Hz: misses not explained",
            Some(sum(FlightFigures::unexplained) as f64),
            0.0,
            "",
        )
        .noting(note),
    ]
}

fn is_quiet(flights: &FlightFigures) -> bool {
    flights.name == "paper survey" || flights.name == "SCHED_FIFO idle"
}

fn stress(results: &TimingResults) -> Target {
    let figure = "misses under stress-ng --cpu 4, SCHED_FIFO over SCHED_OTHER";
    let (fifo, other) = (results.flights("SCHED_FIFO under load"), results.flights("SCHED_OTHER under load"));
    let (Some(fifo), Some(other)) = (fifo, other) else {
        return Target::at_most(figure, None, 0.05, "").noting("stress-ng is not installed");
    };
    let (ours, theirs) =
        (fifo.unexplained() as f64 / fifo.slots as f64, other.unexplained() as f64 / other.slots as f64);
    let ratio = (theirs > 0.0).then(|| ours / theirs);
    let note = format!(
        "{} of {} slots against {} of {}; explained by the canary and left out: {} and {}",
        fifo.unexplained(),
        fifo.slots,
        other.unexplained(),
        other.slots,
        fifo.explained,
        other.explained
    );
    Target::at_most(figure, ratio, 0.05, "").noting(note)
}

fn overhead(results: &TimingResults) -> Vec<Target> {
    let line = |ring: &super::results::Ring| {
        let figure = format!("stamping over the ring's time, {}", ring.placement.name());
        let counted = ring.stamps_counted_percent.map(|percent| format!("{percent:.2} % by counting calls"));
        let spread = ring.stamps_percent.map(|ratio| format!("rounds {}", ratio.spread()));
        let note = [spread, counted].into_iter().flatten().collect::<Vec<_>>().join("; ");
        Target::at_most(figure, ring.stamps_percent.map(|ratio| ratio.median), 2.0, "%").noting(note)
    };
    results.rings.iter().map(line).collect()
}

fn ratio_at_most(figure: String, ratio: Option<Ratio>, limit: f64, missing: &str) -> Target {
    let note = ratio.map_or(missing.to_owned(), |ratio| format!("rounds {}", ratio.spread()));
    Target::at_most(figure, ratio.map(|ratio| ratio.median), limit, "").noting(note)
}

fn at_least(figure: &str, ratio: Option<Ratio>, limit: f64) -> Target {
    let note = ratio.map_or(String::new(), |ratio| format!("rounds {:.0} to {:.0}", ratio.min, ratio.max));
    Target::at_least(figure, ratio.map(|ratio| ratio.median), limit).noting(note)
}
