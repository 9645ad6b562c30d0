//! Judge of a flight: its verdict, the cause of a failure, and reservations for the reader. Every command uses it.

use contract::exit;
use contract::guard::Refusal;
use contract::message::PlantStatus;
pub use flight::circumstances::Circumstances;
use flight::event::{Event, What};
use flight::stack::Ended;
use flight::swap_story::{FailedSwap, of_candidates};
use runtime::port::PortFailure;
use settings::{Nodes, Scenario};

use crate::bounds::{self, BoundCheck};
use crate::summary::Summary;

/// Verdict on a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Exit code of `trefoil fly`, by the gravest failure.
    pub exit_code: u8,
    /// Cause of the failure, in words that do not depend on sizes and times; empty for a pass.
    pub cause: String,
    /// Time at which the flight left a bound for the first time, or else ended \[s\]; `None` for a pass.
    pub failed_at_s: Option<f64>,
    /// End of the flight, for people.
    pub end: String,
    /// Reservations that a reader must know, the gravest first; empty when all went well.
    pub reservations: Vec<String>,
    /// Bounds of the scenario, each compared with the flight.
    pub bounds: Vec<BoundCheck>,
    /// Words between the end and the reservations in one line.
    joint: &'static str,
}

impl Verdict {
    /// Judges a flight of `scenario` by its `summary` and circumstances.
    pub fn of(summary: &Summary, scenario: &Scenario, how: &Circumstances) -> Self {
        let bounds = bounds::check(scenario, &summary.metrics());
        let swaps = FailedSwap::all(scenario, &how.events);
        let (exit_code, cause) = pass_or_cause(summary, how, &bounds, &swaps);
        let reservations = reservations(summary, scenario, how, &bounds, &swaps);
        let is_flown = matches!(how.ended, Ended::Flown) && !summary.status().diverged();
        let joint = match (is_flown, reservations.is_empty()) {
            (true, true) => ", inside its bounds",
            (true, false) => ", but ",
            (false, true) => "",
            (false, false) => "; ",
        };
        let failed_at_s = summary.outside_since_s().unwrap_or(summary.time_s());
        Self {
            exit_code,
            cause,
            failed_at_s: (exit_code != exit::FLOWN).then_some(failed_at_s),
            end: end(summary, &how.ended),
            reservations,
            bounds,
            joint,
        }
    }

    /// Returns whether `trefoil fly` ends such a flight with exit code 0.
    pub fn passed(&self) -> bool {
        self.exit_code == exit::FLOWN
    }

    /// Describes the end and the reservations in one line for people.
    pub fn describe(&self) -> String {
        format!("{}{}{}", self.end, self.joint, self.reservations.join("; "))
    }
}

/// Exit code and cause.
fn pass_or_cause(summary: &Summary, how: &Circumstances, bounds: &[BoundCheck], swaps: &[FailedSwap]) -> (u8, String) {
    let status = summary.status();
    let outside = bounds.iter().find(|bound| !bound.ok).map(|bound| bound.words[0].to_owned());
    let swap = swaps.iter().find(|failed| !failed.swap.may_fail).map(|failed| format!("a swap {}", failed.name()));
    let log_lost = how.log.as_ref().is_some_and(|log| log.error.is_some());
    match &how.ended {
        Ended::Interrupted => (exit::INTERRUPTED, "interrupted".into()),
        Ended::Lost(name) => (exit::PROCESS_LOST, format!("lost {name}")),
        Ended::Unseen(_) => (exit::PROCESS_LOST, "not seen whole".into()),
        Ended::Late(name) => (exit::BUDGET_BROKEN, format!("late {name}")),
        Ended::Flown if log_lost => (exit::PROCESS_LOST, "the log was lost".into()),
        Ended::Flown if status.failed() => (exit::OUT_OF_BOUNDS, status.describe().into()),
        Ended::Flown => match outside.or(swap) {
            Some(cause) => (exit::OUT_OF_BOUNDS, cause),
            None => (exit::FLOWN, String::new()),
        },
    }
}

fn end(summary: &Summary, ended: &Ended) -> String {
    let (t, status) = (summary.time_s(), summary.status());
    match ended {
        Ended::Interrupted => format!("interrupted at {t:.2} s"),
        Ended::Lost(name) => format!("lost {name} at {t:.2} s"),
        Ended::Late(name) => format!("stopped at {t:.2} s: {name} missed its deadline"),
        Ended::Unseen(what) => format!("flown, but not seen whole: {what}"),
        Ended::Flown if matches!(status, PlantStatus::Crashed | PlantStatus::TippedOver) => {
            format!("{} at {t:.2} s", status.describe())
        }
        Ended::Flown if status.diverged() => format!("diverged at {t:.2} s: {}", status.describe()),
        Ended::Flown if status == PlantStatus::Landed => format!("flown to the end, {t:.2} s, and landed"),
        Ended::Flown => format!("flown to the end, {t:.2} s"),
    }
}

fn reservations(
    summary: &Summary,
    scenario: &Scenario,
    how: &Circumstances,
    bounds: &[BoundCheck],
    swaps: &[FailedSwap],
) -> Vec<String> {
    let fallback_s = summary.metrics().fallback_s;
    let outside = || bounds.iter().filter(|bound| !bound.ok);
    let describe = |BoundCheck { words: [what, unit], measured, limit, .. }: &BoundCheck| {
        format!("{what} {measured:.3} {unit} (bound {limit} {unit})")
    };
    let mut told: Vec<String> = match summary.status() {
        PlantStatus::Slid => vec!["slid over the ground instead of landing".into()],
        PlantStatus::NotLanded => vec!["on the ground and not landed".into()],
        _ => vec![],
    };
    told.extend(outside().map(describe));
    if fallback_s > 0.0 && !outside().any(|bound| bound.metric == "max_fallback_s") {
        told.push(format!("mixer on its fallback for {fallback_s:.2} s"));
    }
    told.extend(swaps.iter().map(FailedSwap::describe));
    let failed = |event: &Event| matches!(event.what, What::Died | What::Hung | What::GivenUp);
    let events = how.events.iter().zip(of_candidates(&how.events));
    let failed = events.filter(|(event, is_of_candidate)| failed(event) && !is_of_candidate);
    let mut nodes: Vec<&str> = failed.map(|(event, _)| event.node.as_str()).collect();
    nodes.sort_unstable();
    nodes.dedup();
    if !nodes.is_empty() {
        told.push(format!("{} failed in flight", nodes.join(" and ")));
    }
    told.extend(summary.cold_starts.describe(&how.events));
    if scenario.node != Nodes::default() || scenario.swap.iter().any(|swap| swap.exec.is_some()) {
        let refused = how.refused.iter().map(|(node, counts)| (node, counts[Refusal::Range as usize]));
        let refused = refused.filter(|(_, count)| *count > 0);
        told.extend(refused.map(|(node, count)| {
            format!("{node} refused {count} messages with numbers that are not finite or out of range")
        }));
    }
    if let Some(log) = &how.log {
        told.extend((log.dropped > 0).then(|| format!("{} records are missing in the log", log.dropped)));
        told.extend(log.error.is_some().then(|| "the log is not whole".to_owned()));
    }
    let copies = how.port_failures.iter().map(|(node, counts)| (node, counts[PortFailure::Copy as usize]));
    told.extend(
        copies
            .filter(|(_, n)| *n > 0)
            .map(|(node, n)| format!("{node} was copied {n} times in flight (fork, daemon), and each copy was ended")),
    );
    let of_ports = |counts: &[u32]| counts[..PortFailure::Copy as usize].iter().copied().map(u64::from).sum();
    let failures = how.port_failures.iter().map(|(node, counts)| (node, of_ports(counts)));
    told.extend(
        failures.filter(|(_, n): &(_, u64)| *n > 0).map(|(node, n)| format!("ports of {node} failed {n} times")),
    );
    told.extend((summary.missed > 0).then(|| format!("{} messages were not seen", summary.missed)));
    told.extend(how.observers.iter().cloned());
    told
}
