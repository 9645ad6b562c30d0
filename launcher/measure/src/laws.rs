//! `measure laws`: the same aggressive flights under every inner loop, side by side.
//!
//! Every flight is flown in process, so that the table is the same on every machine. Between the rows only the inner
//! loop changes: law, constraints and solver of attitude-mpc, and the mixer's projection, which is off in all rows but
//! the last. A flight survives when the vehicle did not diverge and is back at its reference in the end.

use std::path::PathBuf;

use contract::Scenario;
use contract::scenario::{self, Constraints, Law, Mode, Solver};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::findings::{Findings, Target};
use crate::flights::{SURVIVED_M, failed_at_s, in_process};
use crate::table::Table;
use flight::settings;
use view::summary::Metrics;

/// The shipped scenarios, compiled in so that the command works in any folder.
const AGGRESSIVE: [(&str, &str); 5] = [
    ("scenarios/aggressive/step.toml", include_str!("../../../scenarios/aggressive/step.toml")),
    ("scenarios/aggressive/upset.toml", include_str!("../../../scenarios/aggressive/upset.toml")),
    ("scenarios/aggressive/yaw.toml", include_str!("../../../scenarios/aggressive/yaw.toml")),
    ("scenarios/aggressive/weak-step.toml", include_str!("../../../scenarios/aggressive/weak-step.toml")),
    ("scenarios/aggressive/weak-yaw.toml", include_str!("../../../scenarios/aggressive/weak-yaw.toml")),
];

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

/// One row of the table.
#[derive(Debug)]
struct InnerLoop {
    name: &'static str,
    law: Law,
    /// `Cone` is the exact actuator set, `Box` the smallest box around it.
    constraints: Constraints,
    solver: Solver,
    /// Whether the mixer projects onto the exact set; elsewhere it clamps.
    projection: bool,
}

/// MPC without constraints; the mixer clamps.
const CLAMP: InnerLoop = InnerLoop {
    name: "clamp",
    law: Law::Mpc,
    constraints: Constraints::None,
    solver: Solver::Clarabel,
    projection: false,
};

/// The rows of the table. The first is what ships.
const INNER_LOOPS: [InnerLoop; 7] = [
    InnerLoop { name: "cone", constraints: Constraints::Cone, ..CLAMP },
    InnerLoop { name: "cone, active-set", constraints: Constraints::Cone, solver: Solver::ActiveSet, ..CLAMP },
    InnerLoop { name: "box", constraints: Constraints::Box, ..CLAMP },
    CLAMP,
    InnerLoop { name: "lqr", law: Law::Lqr, ..CLAMP },
    InnerLoop { name: "pid", law: Law::Pid, ..CLAMP },
    InnerLoop { name: "projection", projection: true, ..CLAMP },
];

impl InnerLoop {
    /// `scenario` with this inner loop, in process.
    fn put_into(&self, scenario: &Scenario) -> Scenario {
        let mut flown = scenario.clone();
        flown.run.mode = Mode::Inprocess;
        flown.mpc.law = self.law;
        flown.mpc.constraints = self.constraints;
        flown.mpc.solver = self.solver;
        flown.mixer.projection = self.projection;
        flown
    }
}

#[derive(Serialize)]
struct LawFlight {
    #[serde(serialize_with = "hyphenated")]
    inner_loop: &'static InnerLoop,
    scenario: String,
    /// Whether it did not diverge and was back in the end.
    survived: bool,
    diverged_at_s: Option<f64>,
    #[serde(flatten)]
    metrics: Metrics,
    solver: Value,
    state_hash: Option<String>,
}

/// Returns the exit code.
pub fn measure(args: &LawsArgs) -> anyhow::Result<u8> {
    let shipped = AGGRESSIVE.iter().map(|(path, text)| scenario::from_merged(text, path));
    let more = args.scenario.iter().map(|path| settings::load(Some(path), &[]));
    let scenarios: Vec<Scenario> = shipped.chain(more).collect::<Result<_, _>>()?;
    let row = |inner_loop| scenarios.iter().map(|scenario| fly(inner_loop, scenario)).collect();
    let rows: Vec<Vec<LawFlight>> = INNER_LOOPS.iter().map(row).collect();

    let flights: Vec<&LawFlight> = rows.iter().flatten().collect();
    let results = json!({ "survived_within_m": SURVIVED_M, "flights": flights });
    let found = Findings::new(results, targets(&rows), false)?;
    found.conclude(args.out.as_deref(), "table.json", args.json, &table(&scenarios, &rows))
}

fn fly(inner_loop: &'static InnerLoop, scenario: &Scenario) -> LawFlight {
    let flown = inner_loop.put_into(scenario);
    let (summary, _) = in_process(&flown, |_| {});
    let diverged = summary.status().diverged();
    LawFlight {
        inner_loop,
        scenario: scenario.name.clone(),
        survived: failed_at_s(&summary).is_none(),
        diverged_at_s: diverged.then(|| summary.time_s()),
        metrics: summary.metrics(),
        solver: summary.solves.to_json(),
        state_hash: summary.state_hash(),
    }
}

/// Of the shipped scenarios, for both solvers.
fn targets(rows: &[Vec<LawFlight>]) -> Vec<Target> {
    let of_row = |row: &Vec<LawFlight>| {
        let shipped = &row[..AGGRESSIVE.len()];
        let name = shipped[0].inner_loop.name;
        let survived = shipped.iter().filter(|flight| flight.survived).count();
        let negative = shipped.iter().map(|flight| flight.metrics.negative_squares).sum::<u64>();
        let clamped = shipped.iter().map(|flight| flight.metrics.commands_saturated).max();
        let (all, survived) = (shipped.len(), Some(survived as f64));
        [
            Target::when(format!("{name}: aggressive flights survived"), survived, format!("all {all}"), |survived| {
                survived == all as f64
            }),
            Target::at_most(format!("{name}: negative squares in all of them"), Some(negative as f64), 0.0, ""),
            Target::at_most(format!("{name}: commands clamped in the worst"), clamped.map(|n| n as f64), 1.0, ""),
        ]
    };
    let is_cone = |row: &&Vec<LawFlight>| row[0].inner_loop.constraints == Constraints::Cone;
    rows.iter().filter(is_cone).flat_map(of_row).collect()
}

fn table(scenarios: &[Scenario], rows: &[Vec<LawFlight>]) -> String {
    let names = scenarios.iter().map(|scenario| scenario.name.clone());
    let headings = [String::new()].into_iter().chain(names).chain(["survived".into()]).collect();
    let cells = |row: &Vec<LawFlight>| {
        let survived = row.iter().filter(|flight| flight.survived).count();
        let name = row[0].inner_loop.name.to_owned();
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

/// The name of an inner loop as one word.
fn hyphenated<S: Serializer>(inner_loop: &InnerLoop, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&inner_loop.name.replace(", ", "-"))
}

#[cfg(test)]
mod tests;
