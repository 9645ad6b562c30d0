//! `measure laws`: the same flights under every inner loop, side by side.
//!
//! Every flight is flown in process, so that the tables are the same on every machine. Between the rows only the inner
//! loop changes: law, constraints and solver of attitude-mpc, each without and with the mixer's projection. A flight survives
//! when the vehicle did not diverge and is back at its reference in the end. The five aggressive flights show how, and the
//! random ones of `campaigns/laws.toml`, which has the inner loops too, how often.

use std::path::{Path, PathBuf};

use campaign::outcome::{self, Verdict};
use campaign::{Campaign, Plan, Rate};
use contract::Scenario;
use contract::scenario::{self, Constraints, Law, Mode, Solver};
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::findings::{Findings, Target};
use crate::flights::{SURVIVED_M, failed_at_s, in_process};
use flight::settings;
use view::metrics::Metrics;
use view::table::Table;

/// The shipped scenarios, compiled in so that the command works in any folder.
const AGGRESSIVE: [(&str, &str); 5] = [
    ("scenarios/aggressive/step.toml", include_str!("../../../scenarios/aggressive/step.toml")),
    ("scenarios/aggressive/upset.toml", include_str!("../../../scenarios/aggressive/upset.toml")),
    ("scenarios/aggressive/yaw.toml", include_str!("../../../scenarios/aggressive/yaw.toml")),
    ("scenarios/aggressive/weak-step.toml", include_str!("../../../scenarios/aggressive/weak-step.toml")),
    ("scenarios/aggressive/weak-yaw.toml", include_str!("../../../scenarios/aggressive/weak-yaw.toml")),
];

/// The random flights, and the inner loops.
const RANDOM: (&str, &str) = ("campaigns/laws.toml", include_str!("../../../campaigns/laws.toml"));

#[derive(clap::Args)]
pub struct LawsArgs {
    /// Scenario files to fly besides the five aggressive ones
    pub scenario: Vec<PathBuf>,
    /// Random flights
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub flights: u64,
    /// What the random flights are drawn from
    #[arg(long, default_value_t = 1)]
    pub seed: u32,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as table.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// One row of the table.
#[derive(Debug, Clone, PartialEq)]
struct InnerLoop {
    name: String,
    law: Law,
    /// `Cone` is the exact actuator set, `Box` the smallest box around it.
    constraints: Constraints,
    solver: Solver,
    /// Whether the mixer projects onto the exact set; elsewhere it clamps.
    projection: bool,
}

/// Those of the random flights' controllers.
fn inner_loops(random: &Campaign) -> anyhow::Result<Vec<InnerLoop>> {
    let all = random.controllers.iter().map(|(name, given)| Ok(InnerLoop::of(name, &given.scenario(&[])?)));
    all.collect()
}

impl InnerLoop {
    fn of(name: &str, scenario: &Scenario) -> Self {
        let contract::scenario::Mpc { law, constraints, solver, .. } = scenario.mpc;
        Self { name: name.to_owned(), law, constraints, solver, projection: scenario.mixer.projection }
    }

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

    fn is_cone(&self) -> bool {
        self.constraints == Constraints::Cone
    }

    /// Whether it is the same law under the same constraints: solver and projection may differ.
    fn is_akin(&self, other: &Self) -> bool {
        (self.law, self.constraints) == (other.law, other.constraints)
    }
}

#[derive(Serialize)]
struct LawFlight {
    #[serde(serialize_with = "by_name")]
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

/// The random flights under one inner loop.
#[derive(Debug, Serialize)]
struct RandomRow {
    #[serde(serialize_with = "by_name")]
    inner_loop: InnerLoop,
    rate: Rate,
    /// Flight by flight.
    survived: Vec<bool>,
}

/// Returns the exit code.
pub fn measure(args: &LawsArgs) -> anyhow::Result<u8> {
    let shipped = AGGRESSIVE.iter().map(|(path, text)| scenario::from_merged(text, path));
    let more = args.scenario.iter().map(|path| settings::load(Some(path), &[]));
    let scenarios: Vec<Scenario> = shipped.chain(more).collect::<Result<_, _>>()?;
    let drawn = Campaign::read(RANDOM.1, RANDOM.0, "laws", Path::new(""))?.drawn_anew(args.seed, args.flights);
    let loops = inner_loops(&drawn)?;
    let rows = fly_all(&loops, &scenarios);
    let random = fly_random(&loops, &Plan::new(drawn)?);

    let flights: Vec<&LawFlight> = rows.iter().flatten().collect();
    let results = json!({
        "survived_within_m": SURVIVED_M,
        "flights": flights,
        "random": { "seed": args.seed, "flights": args.flights, "rows": random },
    });
    let targets = targets(&rows).into_iter().chain(of_random(&random)).collect();
    let found = Findings::new(results, targets, false)?;
    let text = table(&scenarios, &rows) + "\n" + &random_table(args.seed, &random);
    found.conclude(args.out.as_deref(), "table.json", args.json, &text)
}

/// Every scenario under every inner loop, on as many cores as there are: a row for each inner loop.
fn fly_all(loops: &[InnerLoop], scenarios: &[Scenario]) -> Vec<Vec<LawFlight>> {
    let pairs: Vec<_> = loops.iter().flat_map(|one| scenarios.iter().map(move |scenario| (one, scenario))).collect();
    let mut flights = pairs.par_iter().map(|(one, scenario)| fly(one, scenario)).collect::<Vec<_>>().into_iter();
    loops.iter().map(|_| flights.by_ref().take(scenarios.len()).collect()).collect()
}

/// Every flight of the plan, whose controllers the loops are: a row for each.
fn fly_random(loops: &[InnerLoop], plan: &Plan) -> Vec<RandomRow> {
    let fly = |number| outcome::fly(&plan.flight(number), || true, |_| {});
    let passed = |number| fly(number).is_some_and(|outcome| outcome.verdict == Verdict::Passed);
    let passed: Vec<bool> = (0..plan.flights()).into_par_iter().map(passed).collect();
    // The controllers of a sample stand together.
    let of_loop = |i: usize| passed.iter().skip(i).step_by(loops.len()).copied().collect();
    loops.iter().enumerate().map(|(i, one)| RandomRow::of(one, of_loop(i))).collect()
}

fn fly(inner_loop: &InnerLoop, scenario: &Scenario) -> LawFlight {
    let flown = inner_loop.put_into(scenario);
    let (summary, _) = in_process(&flown, |_| {});
    let diverged = summary.status().diverged();
    LawFlight {
        inner_loop: inner_loop.clone(),
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

/// The row that survives most of those with another law or other constraints than `row`; the first of several.
fn best_other<'a>(rows: &'a [RandomRow], row: &RandomRow) -> Option<&'a RandomRow> {
    let others = rows.iter().rev().filter(|other| !other.inner_loop.is_akin(&row.inner_loop));
    others.max_by_key(|other| other.rate.survived)
}

/// The cone survives at least as many random flights as every other, within its interval.
fn of_random(rows: &[RandomRow]) -> Vec<Target> {
    let of_row = |row: &RandomRow| {
        let best = best_other(rows, row)?;
        let Rate { survived, flights, high, .. } = row.rate;
        let figure = format!("{}: share of random flights, upper end", row.inner_loop.name);
        let note = format!("{survived} of {flights}; the best other, {}, {}", best.inner_loop.name, best.rate.survived);
        Some(Target::at_least(figure, Some(high), best.rate.share()).noting(note))
    };
    rows.iter().filter(|row| row.inner_loop.is_cone()).filter_map(of_row).collect()
}

impl RandomRow {
    fn of(inner_loop: &InnerLoop, survived: Vec<bool>) -> Self {
        let rate = Rate::of(survived.iter().filter(|survived| **survived).count(), survived.len());
        Self { inner_loop: inner_loop.clone(), rate, survived }
    }

    /// How many flights it survives that `other` does not.
    fn more_than(&self, other: &Self) -> usize {
        self.survived.iter().zip(&other.survived).filter(|(mine, theirs)| **mine && !**theirs).count()
    }
}

fn random_table(seed: u32, rows: &[RandomRow]) -> String {
    let cells = |row: &RandomRow| {
        let Rate { survived, .. } = row.rate;
        let [best, only, lost] = match best_other(rows, row) {
            Some(best) => {
                [best.inner_loop.name.clone(), row.more_than(best).to_string(), best.more_than(row).to_string()]
            }
            None => ["-", "-", "-"].map(str::to_owned),
        };
        vec![row.inner_loop.name.clone(), survived.to_string(), row.rate.interval(), best, only, lost]
    };
    let flights = rows.first().map_or(0, |row| row.rate.flights);
    let title = format!(
        "{flights} random flights, seed {seed}: survived, the exact 95 % interval, the best law of another kind, and how many \
         flights only the one survives and only the other"
    );
    let headings = ["", "survived", "interval", "best other", "only it", "only the other"];
    Table::new(&title, &headings, rows.iter().map(cells).collect()).text()
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
