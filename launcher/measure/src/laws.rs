//! `measure laws`: the same aggressive flights under every inner loop, side by side.
//!
//! Every flight is flown in process, so that the table is the same on every machine. Between the rows only the inner
//! loop changes: law, constraints and solver of attitude-mpc, and the mixer's safety net, which is off in all rows but
//! the last. A flight survives when the vehicle did not diverge and is back at its reference in the end.

use std::path::PathBuf;

use contract::Scenario;
use contract::scenario::{self, Constraints, Law, Mode, Solver};
use serde::Serialize;
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum InnerLoop {
    /// MPC on the exact actuator set, by Clarabel: what ships.
    Cone,
    /// The same by the active-set solver.
    ConeActiveSet,
    /// MPC on the smallest box around the set.
    Box,
    /// MPC without constraints; the mixer clamps.
    Clamp,
    /// LQR; the mixer clamps.
    Lqr,
    /// PID; the mixer clamps.
    Pid,
    /// MPC without constraints; the mixer projects onto the exact set.
    Projection,
}

impl InnerLoop {
    const ALL: [Self; 7] =
        [Self::Cone, Self::ConeActiveSet, Self::Box, Self::Clamp, Self::Lqr, Self::Pid, Self::Projection];

    fn name(self) -> &'static str {
        match self {
            Self::Cone => "cone",
            Self::ConeActiveSet => "cone, active-set",
            Self::Box => "box",
            Self::Clamp => "clamp",
            Self::Lqr => "lqr",
            Self::Pid => "pid",
            Self::Projection => "projection",
        }
    }

    /// `scenario` with this inner loop, in process.
    fn put_into(self, scenario: &Scenario) -> Scenario {
        let mut flown = scenario.clone();
        flown.run.mode = Mode::Inprocess;
        let mpc = &mut flown.mpc;
        mpc.law = match self {
            Self::Lqr => Law::Lqr,
            Self::Pid => Law::Pid,
            _ => Law::Mpc,
        };
        mpc.constraints = match self {
            Self::Cone | Self::ConeActiveSet => Constraints::Cone,
            Self::Box => Constraints::Box,
            Self::Clamp | Self::Lqr | Self::Pid | Self::Projection => Constraints::None,
        };
        mpc.solver = if self == Self::ConeActiveSet { Solver::ActiveSet } else { Solver::Clarabel };
        flown.mixer.projection = self == Self::Projection;
        flown
    }
}

#[derive(Serialize)]
struct LawFlight {
    inner_loop: InnerLoop,
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
    let rows: Vec<Vec<LawFlight>> = InnerLoop::ALL
        .iter()
        .map(|inner_loop| scenarios.iter().map(|scenario| fly(*inner_loop, scenario)).collect())
        .collect();

    let flights: Vec<&LawFlight> = rows.iter().flatten().collect();
    let results = json!({ "survived_within_m": SURVIVED_M, "flights": flights });
    let found = Findings::new(results, targets(&rows), false)?;
    let path = args.out.as_ref().map(|out| out.join("table.json"));
    found.conclude(path.as_deref(), args.json, &table(&scenarios, &rows))
}

fn fly(inner_loop: InnerLoop, scenario: &Scenario) -> LawFlight {
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
        let name = shipped[0].inner_loop.name();
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
    let is_cone = |row: &&Vec<LawFlight>| matches!(row[0].inner_loop, InnerLoop::Cone | InnerLoop::ConeActiveSet);
    rows.iter().filter(is_cone).flat_map(of_row).collect()
}

fn table(scenarios: &[Scenario], rows: &[Vec<LawFlight>]) -> String {
    let names = scenarios.iter().map(|scenario| scenario.name.clone());
    let headings = [String::new()].into_iter().chain(names).chain(["survived".into()]).collect();
    let cells = |row: &Vec<LawFlight>| {
        let survived = row.iter().filter(|flight| flight.survived).count();
        let name = row[0].inner_loop.name().to_owned();
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

#[cfg(test)]
mod tests;
