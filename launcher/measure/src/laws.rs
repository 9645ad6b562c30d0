//! `measure laws`: flies the same scenarios under every inner loop and compares them in a table.
//!
//! Every flight is flown in process, so that the table is the same on every machine. The rows differ only in the inner
//! loop. Each inner loop is a controller of `campaigns/laws.toml`, whose random flights show how often it survives. A
//! flight survives if the vehicle did not diverge and is within 1 m of its reference in the end.

use std::path::{Path, PathBuf};

use campaign::Campaign;
use contract::Scenario;
use contract::scenario::{self, Constraints, Mixer, Mode, Mpc};
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use serde_json::json;

use crate::findings::{Findings, Target};
use crate::flights::{SURVIVED_M, in_process, survival};
use flight::settings;
use outcome::metrics::Metrics;
use outcome::solves::SolverRecord;
use view::table::Table;

/// Shipped scenarios, compiled in so that the command works in any folder.
const AGGRESSIVE: [(&str, &str); 5] = [
    ("scenarios/aggressive/step.toml", include_str!("../../../scenarios/aggressive/step.toml")),
    ("scenarios/aggressive/upset.toml", include_str!("../../../scenarios/aggressive/upset.toml")),
    ("scenarios/aggressive/yaw.toml", include_str!("../../../scenarios/aggressive/yaw.toml")),
    ("scenarios/aggressive/weak-step.toml", include_str!("../../../scenarios/aggressive/weak-step.toml")),
    ("scenarios/aggressive/weak-yaw.toml", include_str!("../../../scenarios/aggressive/weak-yaw.toml")),
];

/// Campaign whose controllers are the inner loops.
const CAMPAIGN: (&str, &str) = ("campaigns/laws.toml", include_str!("../../../campaigns/laws.toml"));

#[derive(clap::Args)]
pub struct LawsArgs {
    /// Scenario files to fly besides the five aggressive ones
    pub scenario: Vec<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as table.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Inner loop of a row of the table: a controller of the campaign.
#[derive(Debug, Clone, PartialEq)]
struct InnerLoop {
    name: String,
    mpc: Mpc,
    mixer: Mixer,
}

/// Returns the inner loops of the campaign's controllers.
fn inner_loops(campaign: &Campaign) -> anyhow::Result<Vec<InnerLoop>> {
    let all = campaign.controllers.iter().map(|(name, given)| Ok(InnerLoop::of(name, given.scenario(&[])?)));
    all.collect()
}

impl InnerLoop {
    fn of(name: &str, scenario: Scenario) -> Self {
        Self { name: name.to_owned(), mpc: scenario.mpc, mixer: scenario.mixer }
    }

    /// Returns `scenario` with this inner loop, in process.
    fn put_into(&self, scenario: &Scenario) -> Scenario {
        let mut flown = scenario.clone();
        flown.run.mode = Mode::Inprocess;
        (flown.mpc, flown.mixer) = (self.mpc.clone(), self.mixer.clone());
        flown
    }

    fn is_cone(&self) -> bool {
        self.mpc.constraints == Constraints::Cone
    }
}

#[derive(Serialize)]
struct LawFlight {
    #[serde(serialize_with = "by_name")]
    inner_loop: InnerLoop,
    scenario: String,
    /// `true` if the vehicle did not diverge and was back in the end.
    survived: bool,
    diverged_at_s: Option<f64>,
    #[serde(flatten)]
    metrics: Metrics,
    solver: SolverRecord,
    state_hash: Option<String>,
}

/// Returns the exit code.
pub fn measure(args: &LawsArgs) -> anyhow::Result<u8> {
    let shipped = AGGRESSIVE.iter().map(|(path, text)| scenario::from_merged(text, path));
    let more = args.scenario.iter().map(|path| settings::load(Some(path), &[]));
    let scenarios: Vec<Scenario> = shipped.chain(more).collect::<Result<_, _>>()?;
    let loops = inner_loops(&Campaign::read(CAMPAIGN.1, CAMPAIGN.0, "laws", Path::new(""))?)?;
    let rows = fly_all(&loops, &scenarios);
    let flights: Vec<&LawFlight> = rows.iter().flatten().collect();
    let results = json!({ "survived_within_m": SURVIVED_M, "flights": flights });
    let found = Findings::new(results, targets(&rows), false)?;
    found.conclude(args.out.as_deref(), "table.json", args.json, &table(&scenarios, &rows))
}

/// Flies every scenario under every inner loop on all cores; returns a row for each inner loop.
fn fly_all(loops: &[InnerLoop], scenarios: &[Scenario]) -> Vec<Vec<LawFlight>> {
    let pairs: Vec<_> = loops.iter().flat_map(|one| scenarios.iter().map(move |scenario| (one, scenario))).collect();
    let mut flights = pairs.par_iter().map(|(one, scenario)| fly(one, scenario)).collect::<Vec<_>>().into_iter();
    loops.iter().map(|_| flights.by_ref().take(scenarios.len()).collect()).collect()
}

fn fly(inner_loop: &InnerLoop, scenario: &Scenario) -> LawFlight {
    let flown = Scenario { bounds: survival(), ..inner_loop.put_into(scenario) };
    let (summary, verdict) = in_process(&flown, |_| {});
    let diverged = summary.status().diverged();
    LawFlight {
        inner_loop: inner_loop.clone(),
        scenario: scenario.name.clone(),
        survived: verdict.passed(),
        diverged_at_s: diverged.then(|| summary.time_s()),
        metrics: summary.metrics(),
        solver: summary.solves.record(),
        state_hash: summary.state_hash(),
    }
}

/// Targets for the shipped scenarios, for each inner loop with the constraint cone.
fn targets(rows: &[Vec<LawFlight>]) -> Vec<Target> {
    let of_row = |row: &Vec<LawFlight>| {
        let shipped = &row[..AGGRESSIVE.len()];
        let name = &shipped[0].inner_loop.name;
        let survived = shipped.iter().filter(|flight| flight.survived).count();
        let negative = shipped.iter().map(|flight| flight.metrics.negative_squares).sum::<u64>();
        let clamped = shipped.iter().map(|flight| flight.metrics.commands_saturated).max();
        let (all, survived) = (shipped.len(), Some(survived as f64));
        [
            Target::when(format!("{name}: aggressive flights survived"), survived, format!("all {all}"), |survived| {
                survived == all as f64
            }),
            Target::at_most(format!("{name}: negative squares in all of them"), Some(negative as f64), 0.0, ""),
            Target::at_most(format!("{name}: commands clamped in the worst"), clamped.map(|n| n as f64), 0.0, ""),
        ]
    };
    rows.iter().filter(|row| row[0].inner_loop.is_cone()).flat_map(of_row).collect()
}

fn table(scenarios: &[Scenario], rows: &[Vec<LawFlight>]) -> String {
    let names = scenarios.iter().map(|scenario| scenario.name.clone());
    let headings = [String::new()].into_iter().chain(names).chain(["survived".into()]).collect();
    let cells = |row: &Vec<LawFlight>| {
        let survived = row.iter().filter(|flight| flight.survived).count();
        let name = row[0].inner_loop.name.clone();
        let flights = row.iter().map(LawFlight::cell);
        [name].into_iter().chain(flights).chain([format!("{survived}/{}", row.len())]).collect()
    };
    let title = format!(
        "ok: integral of the position error, commands clamped; out of bounds: over {SURVIVED_M} m from the reference in the end"
    );
    Table { title, headings, rows: rows.iter().map(cells).collect() }.text()
}

impl LawFlight {
    fn cell(&self) -> String {
        let m = &self.metrics;
        match self.diverged_at_s {
            Some(t) => format!("diverged at {t:.2} s"),
            None if self.survived => format!("ok {:.1} m s, {}", m.position_error_integral_ms, m.commands_saturated),
            None => format!("out of bounds, {:.1} m", m.final_position_error_m),
        }
    }
}

fn by_name<S: Serializer>(inner_loop: &InnerLoop, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&inner_loop.name)
}

#[cfg(test)]
mod tests;
