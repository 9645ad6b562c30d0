//! Times of the navigation unit, and of the tick of a plant with and without it.
//!
//! The vehicle hovers for 5 s, in process. As with the controller's steps, the time of a call is its median over the
//! rounds, and the calls follow each other without a pause.

use std::hint::black_box;

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
use settings::{Scenario, SensorPreset, SensorsSettings};
use view::table::Table;

/// Sensors of the measured plants; a plant with ideal sensors has no navigation unit.
const SENSORS: [(&str, SensorPreset); 3] =
    [("ideal", SensorPreset::Ideal), ("typical", SensorPreset::Typical), ("good", SensorPreset::Good)];
/// Name of the call that measures the whole plant instead of the navigation unit alone.
const TICK: &str = "tick of the plant";
/// Duration of the hover \[s\].
const DURATION_S: f64 = 5.0;
/// Largest share of a core that the unit may take \[%\].
const MAX_SHARE_PERCENT: f64 = 2.0;

/// Times of one call in a flight.
#[derive(Debug, Clone, Serialize)]
pub struct CallTimes {
    preset: &'static str,
    call: &'static str,
    time: Percentiles,
    /// Time in this call per time of the flight \[%\].
    share_percent: f64,
}

/// Times every call with each kind of sensors, `rounds` times.
pub fn times(rounds: u32) -> Vec<CallTimes> {
    let of_preset = |(preset, sensors)| {
        let mut scenario = Scenario::default();
        scenario.run.duration_s = DURATION_S;
        scenario.plant.sensors = SensorsSettings::from(sensors);
        let units: Option<Vec<_>> = (0..rounds).map(|_| unit_times_ns(&scenario)).collect();
        let (samples, estimates): (Vec<_>, Vec<_>) = units.unwrap_or_default().into_iter().unzip();
        let ticks = (0..rounds).map(|_| tick_times_ns(&scenario)).collect();
        [("sample of the IMU", samples), ("estimate", estimates), (TICK, ticks)]
            .map(|(call, rounds): (_, Vec<Vec<u64>>)| CallTimes::of(preset, call, &rounds))
    };
    SENSORS.into_iter().flat_map(of_preset).flatten().collect()
}

/// Returns the times as a table.
pub fn table(rows: &[CallTimes], rounds: u32) -> Table {
    let cells = |row: &CallTimes| {
        let time = &row.time;
        let times = [time.p50_us, time.p90_us, time.p99_us, time.max_us].map(|us| format!("{us:.2}"));
        let named = [row.preset.to_owned(), row.call.to_owned(), time.n.to_string()];
        named.into_iter().chain(times).chain([format!("{:.2} %", row.share_percent)]).collect()
    };
    Table::new(
        &format!("A call of the navigation unit, and a tick of the plant [us], median of {rounds} rounds"),
        &["sensors", "call", "n", "p50", "p90", "p99", "max", "of a core"],
        rows.iter().map(cells).collect(),
    )
}

/// Returns the targets for the share of a core that each unit takes.
pub fn targets(rows: &[CallTimes]) -> impl Iterator<Item = Target> {
    SENSORS[1..].iter().map(|(preset, _)| {
        let of_unit = rows.iter().filter(|row| row.preset == *preset && row.call != TICK);
        let share_percent = of_unit.map(|row| row.share_percent).sum();
        let figure = format!("navigation, {preset}: share of one core");
        Target::at_most(figure, Some(share_percent), MAX_SHARE_PERCENT, "%")
    })
}

impl CallTimes {
    /// Makes the row of a call; `rounds` has the times of each round \[ns\], which all have the same number of calls.
    fn of(preset: &'static str, call: &'static str, rounds: &[Vec<u64>]) -> Option<Self> {
        let calls = rounds.first()?.len();
        let times_ns: Vec<u64> = (0..calls).map(|i| median_ns(rounds.iter().map(|round| round[i]))).collect();
        let share_percent = times_ns.iter().sum::<u64>() as f64 / 1e7 / DURATION_S;
        Some(Self { preset, call, time: Percentiles::of(times_ns)?, share_percent })
    }
}

/// Returns the times of every sample of the IMU and of the estimate of every tick \[ns\]; `None` if the plant of
/// `scenario` has no navigation unit.
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

/// Returns the times of every tick of a plant whose command holds the hover \[ns\].
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
