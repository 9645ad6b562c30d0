//! `measure navigation`: how long the navigation unit takes, and the tick of a plant with and without it.
//!
//! The vehicle hovers for 20 s, in process. The work of a call is the same in every round, so its time is the median
//! over the rounds. The calls follow each other without a pause: caches are warm, unlike in a flight at 100 Hz.
//!
//! With `--seeds` it flies ten minutes of hover in gusts with each, and says whether the filter errs as it says.

mod consistency;

use std::hint::black_box;
use std::path::PathBuf;

use contract::message::{Actuators, Stamp};
use outcome::percentiles::{Percentiles, median_ns};
use outcome::target::Target;
use plant::Plant;
use plant::faults::sensors::SensorFaults;
use plant::navigation_unit::NavigationUnit;
use plant::tricopter::Tricopter;
use plant::vehicle::{Vehicle, start};
use runtime::timed;
use serde::Serialize;
use serde_json::json;
use settings::{Scenario, SensorPreset, Sensors};
use view::table::Table;

use self::consistency::WITH_FILTER;
use crate::findings::Findings;

/// Duration of the hover \[s\].
const DURATION_S: f64 = 20.0;
/// Largest share of a core that the unit may take.
const MAX_SHARE: f64 = 0.02;

#[derive(clap::Args)]
pub struct NavigationArgs {
    /// Rounds over the flight: the time of a call is its median over them
    #[arg(long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
    /// Seeds of hovers of ten minutes over which the errors of the filter are compared with what it says of them
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=10_000))]
    pub seeds: u64,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as navigation.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Times of one call in a flight.
#[derive(Debug, Serialize)]
struct Row {
    preset: &'static str,
    call: &'static str,
    time: Percentiles,
    /// Time in this call per second of the flight.
    share: f64,
}

/// Returns the exit code.
pub fn measure(args: &NavigationArgs) -> anyhow::Result<u8> {
    let mut rows = vec![];
    for (preset, sensors) in [("ideal", SensorPreset::Ideal)].into_iter().chain(WITH_FILTER) {
        let mut scenario = Scenario::default();
        scenario.run.duration_s = DURATION_S;
        scenario.plant.sensors = Sensors::from(sensors);
        let mut add = |call, rounds: Vec<Vec<u64>>| rows.extend(Row::of(preset, call, &rounds));
        let units: Option<Vec<_>> = (0..args.rounds).map(|_| unit_times_ns(&scenario)).collect();
        if let Some(units) = units {
            let (samples, estimates) = units.into_iter().unzip();
            add("sample of the IMU", samples);
            add("estimate", estimates);
        }
        add("tick of the plant", (0..args.rounds).map(|_| tick_times_ns(&scenario)).collect());
    }
    let cells = |row: &Row| {
        let time = &row.time;
        let times = [time.p50_us, time.p90_us, time.p99_us, time.max_us].map(|us| format!("{us:.2}"));
        let named = [row.preset.to_owned(), row.call.to_owned(), time.n.to_string()];
        named.into_iter().chain(times).chain([format!("{:.2} %", row.share * 100.0)]).collect()
    };
    let table = Table::new(
        &format!("A call [us], median of {} rounds, calls back to back", args.rounds),
        &["preset", "call", "n", "p50", "p90", "p99", "max", "of a core"],
        rows.iter().map(cells).collect(),
    )
    .text();
    let targets = WITH_FILTER.iter().map(|(preset, _)| {
        let of_unit = |row: &&Row| row.preset == *preset && row.call != "tick of the plant";
        let share: f64 = rows.iter().filter(of_unit).map(|row| row.share).sum();
        Target::at_most(format!("{preset}: share of a core"), Some(share * 100.0), MAX_SHARE * 100.0, "%")
    });
    let mut targets: Vec<Target> = targets.collect();
    let checked = consistency::measure(args.seeds, &mut targets)?;
    let results = json!({ "rounds": args.rounds, "rows": rows, "seeds": args.seeds, "consistency": checked });
    let tables = table + &consistency::table(&checked);
    Findings::new(results, targets, false)?.conclude(args.out.as_deref(), "navigation.json", args.json, &tables)
}

impl Row {
    /// Makes the row of a call; `rounds` has the times of each round \[ns\], which all have the same number of calls.
    fn of(preset: &'static str, call: &'static str, rounds: &[Vec<u64>]) -> Option<Self> {
        let calls = rounds.first().map_or(0, Vec::len);
        let times_ns: Vec<u64> = (0..calls).map(|i| median_ns(rounds.iter().map(|round| round[i]))).collect();
        let share = times_ns.iter().sum::<u64>() as f64 / 1e9 / DURATION_S;
        Some(Self { preset, call, time: Percentiles::of(times_ns)?, share })
    }
}

/// Times of every sample of the IMU and of the estimate of every tick \[ns\]; `None` if `scenario` has no unit.
fn unit_times_ns(scenario: &Scenario) -> Option<(Vec<u64>, Vec<u64>)> {
    let mut vehicle = Tricopter::new(scenario);
    let (_, command) = start(scenario);
    let mut unit = NavigationUnit::new(scenario, &vehicle.motion())?;
    let mut faults = SensorFaults::new(scenario);
    let (mut samples, mut estimates) = (vec![], vec![]);
    let mut now_ns = 0;
    for tick in 1..=scenario.ticks() {
        let until_ns = tick * scenario.sample_ns();
        while unit.due_ns() <= until_ns {
            let due_ns = unit.due_ns();
            vehicle.advance(now_ns, due_ns, &command).expect("the tricopter never fails");
            now_ns = due_ns;
            let (motion, actuators) = (vehicle.motion(), vehicle.actuators());
            samples.push(timed(|| unit.measure(black_box(&motion), &actuators, &[0.0; 3], &mut faults)).1);
        }
        estimates.push(timed(|| black_box(unit.estimate(until_ns))).1);
    }
    Some((samples, estimates))
}

/// Times of every tick of a plant whose command holds the hover \[ns\].
fn tick_times_ns(scenario: &Scenario) -> Vec<u64> {
    let mut plant = Plant::new(scenario);
    let command = plant.sample().command_in_force;
    let mut tick = |sequence| {
        let actuators = Actuators { stamp: Stamp { sequence, ..Stamp::default() }, command, flags: 0 };
        plant.command(&actuators, 0);
        plant.advance(1).expect("the tricopter never fails");
        black_box(plant.sample());
    };
    (1..=scenario.ticks()).map(|sequence| timed(|| tick(sequence)).1).collect()
}
