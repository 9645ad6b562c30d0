//! `measure conditions`: the campaigns `conditions.toml` and `conditions-estimated.toml` as one table, with the time of
//! a step under each model.
//!
//! The flights are the same on every machine. The times are those of the controller's steps on the messages of a
//! flight, in a row.

use std::hint::black_box;
use std::path::PathBuf;

use attitude_mpc::AttitudeMpc;
use contract::Scenario;
use contract::message::{Reference, State};
use flight::log::Record;
use outcome::percentiles::Percentiles;
use runtime::timed;
use serde_json::json;
use view::table::{Table, cell};

use crate::findings::Findings;
use crate::flights::in_process;
use crate::shipped::{self, Flown};

/// Campaigns of the table, and what is added to the names of their missions.
const CAMPAIGNS: [(&str, &str); 2] = [("conditions", ""), ("conditions-estimated", ", estimated")];

#[derive(clap::Args)]
pub struct ConditionsArgs {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as conditions.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Returns the exit code.
pub fn measure(args: &ConditionsArgs) -> anyhow::Result<u8> {
    let (mut rows, mut targets, mut results) = (vec![], vec![], vec![]);
    for (name, suffix) in CAMPAIGNS {
        let flown = shipped::fly(name, Ok)?;
        let mut flights = flown.flights.to_json();
        for row in 0..flown.flights.rows() {
            let step = Percentiles::of(step_times_ns(&flown.plan.flight(row as u64).scenario?));
            rows.push(cells(&flown, row, suffix, step.as_ref()));
            flights[row]["step"] = json!(step);
        }
        results.push(json!({ "campaign": name, "flights": flights }));
        targets.extend(flown.targets());
    }
    let headings =
        ["mission", "controller", "RMS m", "max m", "altitude m", "effort", "active", "p50 us", "p99 us", "survived"];
    let title = "position error, largest altitude error, mean of u'Ru, samples with an active limit, time of a step; \
                 survived: within 1 m of the reference in the end";
    let table = Table::new(title, &headings, rows).text();
    let found = Findings::new(json!({ "campaigns": results }), targets, false)?;
    found.conclude(args.out.as_deref(), "conditions.json", args.json, &table)
}

/// Makes the cells of one flight.
fn cells(flown: &Flown, row: usize, suffix: &str, step: Option<&Percentiles>) -> Vec<String> {
    let number = |column| flown.number(row, column);
    let errors_m = ["rms_position_error_m", "max_position_error_m", "max_altitude_error_m"].map(number);
    let mut cells = vec![flown.text(row, "case").to_owned() + suffix, flown.text(row, "controller").to_owned()];
    cells.extend(errors_m.into_iter().chain([number("demand_effort")]).map(|value| format!("{value:.4}")));
    cells.push(format!("{:.0}", number("solver_ticks_with_active_constraints")));
    cells.extend([step.map(|step| step.p50_us), step.map(|step| step.p99_us)].map(|us| cell(us, 1)));
    cells.push(if flown.text(row, "verdict") == "passed" { "yes".into() } else { "no".into() });
    cells
}

/// Flies a scenario, and times the step of a new controller on each of its samples \[ns\].
fn step_times_ns(scenario: &Scenario) -> Vec<u64> {
    let (mut states, mut references) = (vec![], vec![]);
    in_process(scenario, |record| match record {
        Record::State(state) => states.push(*state),
        Record::Reference(reference) => references.push(*reference),
        Record::Controls(_) | Record::Actuators(_) => {}
    });
    let mut mpc = AttitudeMpc::new(scenario);
    let step = |(state, reference)| time_step(&mut mpc, state, reference);
    states.iter().zip(&references).map(step).collect()
}

fn time_step(mpc: &mut AttitudeMpc, state: &State, reference: &Reference) -> u64 {
    timed(|| black_box(mpc.step(state.stamp.tick, black_box(state), black_box(reference)))).1
}
