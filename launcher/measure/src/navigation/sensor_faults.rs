//! Faults of the sensors of the navigation unit: every kind at every sensor, for a second, for ten, and for good.
//!
//! The vehicle hovers in gusts, each fault with a seed of its own. What its largest distance from where it shall be has
//! more than without the fault is what the fault costs. A fault is silent if it costs more than `SILENT_M` and the unit
//! has said nothing of it: no more was refused, nothing was reset, no other IMU took over, one is sound, and the error
//! of the position is beyond `TOLD` of the deviations that it tells.

use anyhow::ensure;
use contract::Scenario;
use contract::scenario::{Fault, FaultKind, FaultTarget, SensorPreset, Sensors};
use flight::inprocess;
use outcome::target::Target;
use rayon::prelude::*;
use serde::Serialize;
use view::table::Table;

/// Sensors that have the faults, and the name of those.
const PRESETS: [(&str, SensorPreset); 2] = [("typical", SensorPreset::Typical), ("good", SensorPreset::Good)];
/// Sensors, and the IMU that has the fault; none for every one.
const SENSORS: [(FaultTarget, Option<u64>); 8] = [
    (FaultTarget::Rates, Some(1)),
    (FaultTarget::Acceleration, Some(1)),
    (FaultTarget::Position, None),
    (FaultTarget::Velocity, None),
    (FaultTarget::Height, None),
    (FaultTarget::Field, None),
    (FaultTarget::Rates, None),
    (FaultTarget::Acceleration, None),
];
/// Sensors of [`SENSORS`] whose faults the vehicle has to survive, whatever they are: there is another one.
const SPARED: std::ops::Range<usize> = 0..2;
/// Kinds, each with its name.
const KINDS: [(FaultKind, &str); 8] = [
    (FaultKind::Off, "off"),
    (FaultKind::Stuck, "stuck"),
    (FaultKind::Garbage, "garbage"),
    (FaultKind::Wrong, "wrong"),
    (FaultKind::Slow, "slow"),
    (FaultKind::Delayed, "delayed"),
    (FaultKind::Intermittent, "intermittent"),
    (FaultKind::Noise, "noise"),
];
/// Begin of a fault, its durations, and the end of the flight \[s\].
const AT_S: f64 = 10.0;
const FOR_S: [Option<f64>; 3] = [Some(1.0), Some(10.0), None];
const END_S: f64 = 60.0;
/// Headings of the worlds that are compared \[deg\].
const HEADINGS_DEG: [f64; 5] = [0.0, 37.0, 90.0, 179.999, -90.0];
/// Largest cost of a fault of an IMU that has a fellow, and of one that is silent \[m\].
const SPARED_M: f64 = 0.3;
const SILENT_M: f64 = 1.0;
/// Refused measurements more that tell nothing, and deviations that an error may have.
const FEW: u64 = 5;
const TOLD: f64 = 4.0;
/// Most silent faults: garbage may look right.
const MOST_SILENT: f64 = 1.0;
/// Largest distance of two distributions of as many errors, by Kolmogorov and Smirnov at 1 %, times the root of n / 2.
const KOLMOGOROV: f64 = 1.63;

/// Outcome of one flight.
#[derive(Debug, Clone, Copy, Default, Serialize)]
struct Flown {
    /// Largest and last distance from where the vehicle shall be \[m\]; infinite if it was lost.
    most_m: f64,
    last_m: f64,
    refused: u64,
    resets: u64,
    /// IMU whose filter flew last.
    imu: u64,
    /// Least IMUs that were sound.
    sound: u64,
    /// Largest error of the estimated position by its deviation.
    told: f64,
}

/// One fault at one heading, and what became of the flights.
#[derive(Debug, Serialize)]
pub struct Row {
    preset: &'static str,
    sensor: String,
    kind: &'static str,
    heading_deg: f64,
    without: Flown,
    /// One flight for each duration.
    flown: [Flown; FOR_S.len()],
}

impl Flown {
    /// Returns whether a fault has cost much, against the flight `without` it, and nothing tells of it.
    fn is_silent(&self, without: &Self) -> bool {
        let says = self.refused > without.refused + FEW
            || self.resets > without.resets
            || self.imu != without.imu
            || self.sound == 0 && without.sound > 0
            || self.told < TOLD;
        self.most_m - without.most_m > SILENT_M && !says
    }
}

/// Flies every fault in every world, and adds the targets.
///
/// # Errors
/// A flight cannot begin.
pub fn measure(targets: &mut Vec<Target>) -> anyhow::Result<Vec<Row>> {
    let mut rows = vec![];
    for (preset, sensors) in PRESETS {
        let mut worlds = vec![];
        let (mut spared, mut silent) = (0_f64, 0);
        for heading_deg in HEADINGS_DEG {
            let cases = 0..SENSORS.len() * KINDS.len();
            let of_case = |case: usize| {
                let (i, (kind, name)) = (case / KINDS.len(), KINDS[case % KINDS.len()]);
                let (target, imu) = SENSORS[i];
                let seed = case as u64 + 1;
                let without = fly(&hover(heading_deg, seed, sensors)?)?;
                ensure!(without.most_m.is_finite(), "the flight of {preset} without a fault is lost, seed {seed}");
                let mut flown = [Flown::default(); FOR_S.len()];
                for (flown, for_s) in flown.iter_mut().zip(FOR_S) {
                    let mut scenario = hover(heading_deg, seed, sensors)?;
                    scenario.fault = vec![Fault { imu, ..Fault::new(target, kind, AT_S, for_s) }];
                    *flown = fly(&scenario)?;
                }
                let every =
                    if matches!(target, FaultTarget::Rates | FaultTarget::Acceleration) { ", all IMUs" } else { "" };
                let of_imu = imu.map_or(every.to_owned(), |imu| format!(", IMU {imu}"));
                let sensor = format!("{}{of_imu}", target.name());
                Ok((i, Row { preset, sensor, kind: name, heading_deg, without, flown }))
            };
            let flown: Vec<(usize, Row)> = cases.into_par_iter().map(of_case).collect::<anyhow::Result<_>>()?;
            for (i, row) in &flown {
                let costs_m = row.flown.map(|flown| flown.most_m - row.without.most_m);
                silent += row.flown.iter().filter(|flown| flown.is_silent(&row.without)).count();
                spared = costs_m.into_iter().filter(|_| SPARED.contains(i)).fold(spared, f64::max);
            }
            worlds.push(flown.iter().flat_map(|(_, row)| row.flown.map(|flown| flown.most_m)).collect::<Vec<f64>>());
            rows.extend(flown.into_iter().map(|(_, row)| row));
        }
        let apart = worlds[1..].iter().map(|world| distance(&worlds[0], world)).fold(0.0, f64::max);
        let draws = SENSORS.len() * KINDS.len(); // the flights of a fault have one seed
        let bound = KOLMOGOROV * (2.0 / draws as f64).sqrt();
        targets.push(Target::at_most(format!("{preset}: cost of a fault of one IMU"), Some(spared), SPARED_M, "m"));
        targets.push(Target::at_most(format!("{preset}: silent faults"), Some(silent as f64), MOST_SILENT, ""));
        targets.push(Target::at_most(format!("{preset}: errors in turned worlds, apart"), Some(apart), bound, ""));
    }
    Ok(rows)
}

/// Table of the faults in the world that is not turned.
pub fn table(rows: &[Row]) -> String {
    let of_each = |row: &Row, cell: &dyn Fn(&Flown) -> String| row.flown.iter().map(cell).collect::<Vec<_>>().join(" ");
    let metres = |m: f64| if m.is_finite() { format!("{m:.2}") } else { "lost".to_owned() };
    let cells = |row: &Row| {
        vec![
            row.preset.to_owned(),
            row.sensor.clone(),
            row.kind.to_owned(),
            metres(row.without.most_m),
            of_each(row, &|flown| metres(flown.most_m)),
            of_each(row, &|flown| metres(flown.last_m)),
            of_each(row, &|flown| flown.refused.to_string()),
            of_each(row, &|flown| flown.resets.to_string()),
        ]
    };
    let shown = rows.iter().filter(|row| row.heading_deg == 0.0).map(cells).collect();
    let columns =
        ["preset", "sensor", "fault", "without [m]", "largest error [m]", "after 60 s [m]", "refused", "resets"];
    Table::new("Faults for 1 s, for 10 s, and for good", &columns, shown).text()
}

/// Hover in the gusts of scenarios/dryden.toml, turned to a heading: vehicle, mean wind and gusts.
fn hover(heading_deg: f64, seed: u64, sensors: SensorPreset) -> anyhow::Result<Scenario> {
    let (sin, cos) = libm::sincos(heading_deg.to_radians());
    let wind = format!("[[0.0, [{:?}, {:?}, 0.0]]]", 6.0 * cos, 6.0 * sin);
    let text = super::consistency::HOVER.replace("[[0.0, [6.0, 0.0, 0.0]]]", &wind);
    let set = [
        format!("mission.heading_deg={heading_deg:?}"),
        format!("initial.attitude_deg=[0.0, 0.0, {heading_deg:?}]"),
        format!("plant.turbulence.direction_deg={heading_deg:?}"),
        format!("run.duration_s={END_S:?}"),
    ];
    let mut scenario = contract::scenario::load_text(&text, "a hover in gusts", &set)?;
    scenario.run.seed = seed;
    scenario.plant.sensors = Sensors::from(sensors);
    Ok(scenario)
}

fn fly(scenario: &Scenario) -> anyhow::Result<Flown> {
    let mut ring = inprocess::ring(scenario, false)?;
    let (mut flown, mut start_m) = (Flown { sound: u64::MAX, ..Flown::default() }, None);
    let last = scenario.ticks();
    while ring.begin()? {
        for topic in inprocess::stepped::TOPICS {
            ring.answer(topic);
        }
        let (state, truth) = (ring.sample(), ring.plant().truth());
        let place_m = nalgebra::Vector3::from(truth.actual.position_m);
        let off_m = (place_m - *start_m.get_or_insert(place_m)).norm();
        let navigation = state.navigation;
        let off = std::array::from_fn::<f64, 3, _>(|i| state.measured.position_m[i] - truth.actual.position_m[i]);
        let told = off.iter().zip(navigation.position_m).map(|(off, deviation)| off.abs() / deviation);
        flown = Flown {
            most_m: flown.most_m.max(off_m),
            last_m: off_m,
            refused: navigation.refused.iter().sum(),
            resets: navigation.resets,
            imu: navigation.imu,
            sound: flown.sound.min(navigation.imus_sound),
            told: told.fold(flown.told, f64::max),
        };
        let tick = state.stamp.tick;
        if ring.end(|_| true).is_some() {
            let is_whole = tick >= last;
            let lost = |m: f64| if is_whole { m } else { f64::INFINITY };
            return Ok(Flown { most_m: lost(flown.most_m), last_m: lost(flown.last_m), ..flown });
        }
    }
    Ok(Flown { most_m: f64::INFINITY, last_m: f64::INFINITY, ..flown })
}

/// Largest distance between the distributions of two samples.
fn distance(one: &[f64], other: &[f64]) -> f64 {
    let share = |of: &[f64], at: f64| of.iter().filter(|value| **value <= at).count() as f64 / of.len() as f64;
    one.iter().chain(other).map(|at| (share(one, *at) - share(other, *at)).abs()).fold(0.0, f64::max)
}
