//! One flight and its verdict, as the cells of a row. With `[limit]` a row is one search: the limit, with verdict and
//! figures of the flight at the limit, or at the safe end if the flight fails there.
//!
//! | verdict | the flight |
//! |---|---|
//! | passed | is one for which `trefoil fly` ends with 0: flown, inside its bounds, no node lost for good |
//! | failed | is any other that was flown |
//! | invalid | could not be flown: its settings contradict each other, or the program panicked. It counts as neither passed nor failed |

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use anyhow::Context;
use contract::message::Sample;
use flight::event::TimedEvent;
use flight::log::Record;
use flight::programs::hex;
use flight::{guarded, scenario};
use outcome::happenings::Happenings;
use outcome::judge::Verdict;
use outcome::metrics::Metrics;
use outcome::run_record::phases;
use outcome::summary::Summary;
use runtime::error::words_of_panic;
use serde_json::Value;
use settings::Scenario;
use sha2::{Digest, Sha256};

use crate::columns::measured;
use crate::limit::{self, FoundLimit, Limit};
use crate::plan::{Plan, PlannedFlight};
use crate::table::{Cell, FlightTable};

/// Standing of a flight: passed, failed or invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    Passed,
    Failed,
    Invalid,
}

impl Standing {
    pub const ALL: [Self; 3] = [Self::Passed, Self::Failed, Self::Invalid];

    pub fn name(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::Invalid => "invalid",
        }
    }
}

/// Standing and cells of a flight; an invalid one has fewer cells.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightRow {
    pub standing: Standing,
    pub cells: Vec<Cell>,
    /// Faults, events and phases of the flight, for its picture.
    pub happened: Happenings,
}

/// Flies entry `number` of a plan, and returns its row: cells of the plan, of the search if there is a `[limit]`, and
/// of the outcome. `None` if `go_on` returned `false` before the end.
pub fn of(plan: &Plan, number: u64, go_on: impl Fn() -> bool) -> Option<FlightRow> {
    let flight = plan.flight(number);
    let (of_search, outcome) = match plan.campaign.limit() {
        None => (vec![], fly(&flight, go_on, |_| {})?),
        Some(limit) => {
            let (found, outcome) = search(plan, limit, number, go_on)?;
            (found.map_or(vec![Cell::None; limit::columns().len()], |found| limit.cells(&found)), outcome)
        }
    };
    Some(FlightRow { cells: [plan.cells(&flight), of_search, outcome.cells].concat(), ..outcome })
}

/// Returns the flight of row `number`. With `[limit]` the limit is searched again, and the flight is the one at the
/// limit, or at the safe end if no value passes.
pub fn told_of(plan: &Plan, number: u64) -> PlannedFlight {
    let found = plan.campaign.limit().and_then(|limit| Some((limit, search(plan, limit, number, || true)?.0?.limit?)));
    found.map_or_else(|| plan.flight(number), |(limit, step)| plan.flight_with(number, &[limit.setting(step)]))
}

/// Searches the limit of entry `number`; returns it with the row of the flight at the limit, or at the safe end if no
/// value passes. An invalid flight ends the search; its row is returned without a limit. `None` if `go_on` returned
/// `false` before the end.
fn search(
    plan: &Plan,
    limit: &Limit,
    number: u64,
    go_on: impl Fn() -> bool,
) -> Option<(Option<FoundLimit>, FlightRow)> {
    let mut flown = BTreeMap::new();
    let found = limit.search(|step| {
        let row = fly(&plan.flight_with(number, &[limit.setting(step)]), &go_on, |_| {})?;
        let standing = row.standing;
        flown.insert(step, row);
        (standing != Standing::Invalid).then_some(standing == Standing::Passed)
    });
    let row = match &found {
        Some(found) => flown.remove(&found.limit.unwrap_or(0)),
        None => flown.into_values().find(|row| row.standing == Standing::Invalid),
    };
    Some((found, row?))
}

/// Flies one flight; `None` if `go_on` returned `false` before the end. `watch` gets every message.
pub fn fly(flight: &PlannedFlight, go_on: impl Fn() -> bool, watch: impl FnMut(&Record)) -> Option<FlightRow> {
    let Ok(scenario) = &flight.scenario else { return flight.refusal().as_deref().map(FlightRow::invalid) };
    match catch_unwind(AssertUnwindSafe(|| try_to_fly(scenario, &go_on, watch))) {
        Ok(Ok(outcome)) => outcome,
        Ok(Err(error)) => Some(FlightRow::invalid(&format!("{error:#}"))),
        Err(panic) => {
            let said = words_of_panic(&*panic);
            Some(FlightRow::invalid(&format!("the program has a bug and panicked: {said}")))
        }
    }
}

/// Flies a flight again, and returns its happenings; `row` is the row of the flight in the table `flights`.
///
/// # Errors
/// The hash of the flight differs from the one in the table: the program, the machine or the table has changed.
pub fn fly_again(
    flight: &PlannedFlight,
    flights: &FlightTable,
    row: usize,
    watch: impl FnMut(&Record),
) -> anyhow::Result<Happenings> {
    let again = fly(flight, || true, watch);
    let known = flights.column("hash").map_or("", |all| all.text(row));
    let same = again.filter(|again| again.hash() == known).with_context(|| {
        format!(
            "flight {} differs from the one in the table when it is flown again; fly the campaign on machines of one \
             kind, or report this difference",
            flight.number
        )
    })?;
    Ok(same.happened)
}

fn try_to_fly(
    scenario: &Scenario,
    go_on: &impl Fn() -> bool,
    mut watch: impl FnMut(&Record),
) -> anyhow::Result<Option<FlightRow>> {
    if !scenario.swap.is_empty() {
        scenario::check(scenario)?;
    }
    let mut summary = Summary::unlogged(scenario);
    let mut was_stopped = false;
    let watch = |record: &Record| {
        summary.observe(record);
        watch(record);
        was_stopped = !go_on();
        !was_stopped
    };
    let how = guarded::fly(scenario, guarded::changes_messages(scenario), watch, |_| {})?.into();
    if was_stopped {
        return Ok(None);
    }
    let verdict = Verdict::of(&summary, scenario, &how);
    let standing = if verdict.passed() { Standing::Passed } else { Standing::Failed };
    let metrics = summary.metrics();
    let mut cells = vec![
        Cell::Text(standing.name().into()),
        Cell::Text(verdict.cause.clone()),
        Cell::Text(verdict.describe()),
        verdict.failed_at_s.map_or(Cell::None, Cell::Real),
        Cell::Real(summary.time_s()),
    ];
    cells.extend(measured(&metrics, &summary.solver()).into_iter().map(|(_, value)| match value {
        Value::Number(number) if number.is_u64() => Cell::Int(number.as_u64().unwrap_or_default() as i64),
        value => value.as_f64().map_or(Cell::None, Cell::Real),
    }));
    cells.push(Cell::Text(hash(&summary.last, &metrics)));
    let events = TimedEvent::all(&how.events, scenario.run.rate_hz);
    let happened = Happenings::new(&summary.faults.records(&how.events), &events)
        .with_phases(&phases(scenario, &summary).unwrap_or_default());
    Ok(Some(FlightRow { standing, cells, happened }))
}

impl FlightRow {
    fn invalid(why: &str) -> Self {
        let cells = vec![
            Cell::Text(Standing::Invalid.name().into()),
            Cell::Text("could not be flown".into()),
            Cell::Text(why.into()),
        ];
        Self { standing: Standing::Invalid, cells, happened: Happenings::default() }
    }

    /// Returns the hash of the flight; empty if it could not be flown.
    pub fn hash(&self) -> &str {
        match self.cells.last() {
            Some(Cell::Text(hash)) if self.standing != Standing::Invalid => hash,
            _ => "",
        }
    }
}

/// Identifies a flight: the first half of the SHA-256 of its last sample and all metrics. A deviation during the flight
/// still shows in both, so a campaign needs no hash over all samples.
fn hash(last: &Sample, metrics: &Metrics) -> String {
    let mut hash = Sha256::new();
    last.payload(|bytes| hash.update(bytes));
    hash.update(serde_json::to_vec(metrics).expect("metrics are numbers"));
    hex(&hash.finalize()[..16])
}

#[cfg(test)]
mod tests {
    use std::cell::Cell as Flag;
    use std::path::Path;

    use super::*;
    use crate::{Campaign, columns};
    use flight::log::Samples;

    fn flown(settings: &str) -> FlightRow {
        let text = format!("[settings]\nrun.duration_s = 1.0\n{settings}");
        let plan = Plan::new(Campaign::read(&text, "x.toml", "x", Path::new("")).unwrap()).unwrap();
        fly(&plan.flight(0), || true, |_| {}).unwrap()
    }

    fn text(outcome: &FlightRow, column: usize) -> &str {
        match &outcome.cells[column] {
            Cell::Text(text) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_verdict_is_that_of_trefoil_fly() {
        let passed = flown("");
        assert_eq!(
            (passed.standing, text(&passed, 1), text(&passed, 2)),
            (Standing::Passed, "", "flown to the end, 1.00 s, inside its bounds")
        );
        let columns = columns::of_the_outcome();
        assert_eq!(passed.cells.len(), columns.len());
        assert!(columns.iter().zip(&passed.cells).all(|((name, kind), cell)| cell.is(*kind) || panic!("{name}")));
        let failed = flown("bounds.max_position_error_m = 1e-9");
        assert_eq!((failed.standing, text(&failed, 1)), (Standing::Failed, "position error"));
        assert!(text(&failed, 2).contains("position error") && failed.cells[3] != Cell::None, "{:?}", failed.cells);
        let lost = flown("[[settings.fault]]\nat_s = 0.5\ntarget = 'plant'\nkind = 'kill'");
        assert_eq!((lost.standing, text(&lost, 1)), (Standing::Failed, "lost plant"));
        assert!(text(&lost, 2).contains("lost plant at 0.49 s"), "{}", text(&lost, 2));
    }

    #[test]
    fn a_flight_that_cannot_be_flown_is_neither_passed_nor_failed() {
        let outcome = flown("attitude.mpc.prediction_horizon_s = 0.03\nattitude.mpc.control_horizon_s = 0.1");
        assert_eq!(outcome.standing, Standing::Invalid);
        assert!(text(&outcome, 2).contains("`attitude.mpc.control_horizon_s` = 0.1 "), "{}", text(&outcome, 2));
        let no_controller = "attitude.mpc.q = [0, 0, 0, 1e12, 0, 0, 0]\nattitude.mpc.r = [1e-12, 1e-12, 1e-12, 1e-12]";
        assert_eq!(flown(no_controller).standing, Standing::Invalid);
    }

    #[test]
    fn equal_flights_have_equal_hashes_and_others_differ() {
        let [one, again, other] = ["", "", "plant.airframe.mass_kg = 1.1000001"].map(flown);
        assert_eq!(one, again);
        assert_ne!(one.hash(), other.hash());
    }

    #[test]
    fn a_flight_of_a_campaign_is_the_one_that_fly_flies_bit_for_bit() {
        let states = |flight: &PlannedFlight, is_unlogged: bool| {
            let scenario = flight.scenario.as_ref().unwrap();
            let (mut hash, mut samples) = (Sha256::new(), Samples::default());
            let mut watch = |record: &Record| {
                if let Some(sample) = samples.join(record) {
                    sample.payload(|bytes| hash.update(bytes));
                }
            };
            if is_unlogged {
                fly(flight, || true, &mut watch).unwrap();
            } else {
                let watch = |record: &Record| {
                    watch(record);
                    true
                };
                guarded::fly(scenario, true, watch, |_| {}).unwrap();
            }
            hash.finalize()
        };
        let text = "seeds = 2\n[settings]\nrun.duration_s = 2.0\n[vary]\nfault = [[], [{ at_s = 0.5, for_s = 1.0, target = 'controls', \
                    kind = 'corrupt', count = 3 }], [{ at_s = 0.5, target = 'mixer', kind = 'kill' }]]";
        let plan = Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap();
        for number in 0..plan.flights() {
            let flight = plan.flight(number);
            assert_eq!(states(&flight, true), states(&flight, false), "{:?}", flight.values);
        }
    }

    #[test]
    fn a_flight_that_is_stopped_has_no_row() {
        let plan = Plan::new(Campaign::read("", "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let seen = Flag::new(0);
        let stopped = fly(&plan.flight(0), || seen.get() < 10, |_| seen.set(seen.get() + 1));
        assert_eq!((stopped, seen.get() < 20), (None, true));
    }
}
