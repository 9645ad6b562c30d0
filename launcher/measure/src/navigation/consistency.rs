//! Consistency of the filter over ten minutes: whether it errs as it says.
//!
//! ```text
//! NEES = e' P^-1 e      of the error e of position, velocity and attitude, and of each alone
//! NIS  = y' S^-1 y      of the last innovation y of each source
//! ```
//!
//! Both are chi-square if the filter is consistent: Bar-Shalom, Li and Kirubarajan, *Estimation with applications to
//! tracking and navigation* (2001), section 5.4. One number of each seed counts, because those of a flight go together.

use contract::message::{Kinematics, State, Truth};
use contract::topic::Topic;
use flight::nodes;
use nalgebra::{DVector, UnitQuaternion, Vector3};
use navigation::state::{ATTITUDE, POSITION, VELOCITY};
use navigation::{Covariance, Source};
use outcome::target::Target;
use rayon::prelude::*;
use serde::Serialize;
use settings::{SensorPreset, Sensors};
use view::table::Table;

/// Sensors with a navigation unit, whose filter is looked at; ideal ones are compared with them.
pub const WITH_FILTER: [(&str, SensorPreset); 2] = [("typical", SensorPreset::Typical), ("good", SensorPreset::Good)];

/// Times at which the errors are weighed \[s\]; the last one ends the flight.
const CHECKS_S: [u64; 4] = [30, 60, 300, 600];
/// Parts of the error, each with its first state and the number of its states.
const PARTS: [(&str, usize, usize); 4] =
    [("all", 0, 9), ("position", POSITION, 3), ("velocity", VELOCITY, 3), ("attitude", ATTITUDE, 3)];
/// Standard deviations of a mean that a consistent filter stays within.
const WITHIN: f64 = 4.0;
/// Most resets in ten minutes.
const MOST_RESETS: f64 = 1.0;

/// Gusts of scenarios/dryden.toml.
const HOVER: &str = r#"
run.mode = "inprocess"
run.duration_s = 600.0
mission.trajectory = "hover"
guidance.disturbance_observer_radps = 5.0

[plant]
drag_linear_nspm = [0.2, 0.2, 0.1]
drag_quadratic_ns2pm2 = 0.02
wind_ned_mps = [[0.0, [6.0, 0.0, 0.0]]]
wind_roughness_m = 0.03
turbulence = { wind_at_6m_mps = 6.0, airspeed_mps = 6.0 }
"#;

/// Normalised squares of one flight.
struct Seed {
    /// NEES of each part, at each check.
    nees: [[f64; PARTS.len()]; CHECKS_S.len()],
    nis: [f64; Source::ALL.len()],
    resets: f64,
    refused: f64,
}

/// Mean over the seeds of one normalised square, which has `expected` if the filter is consistent.
#[derive(Debug, Serialize)]
pub struct Row {
    preset: &'static str,
    what: String,
    mean: f64,
    expected: f64,
    bound: f64,
}

/// Flies `seeds` of each preset, and adds the targets.
pub fn measure(seeds: u64, targets: &mut Vec<Target>) -> anyhow::Result<Vec<Row>> {
    let mut rows = vec![];
    for (preset, sensors) in WITH_FILTER.into_iter().filter(|_| seeds > 0) {
        let flown = (1..=seeds).into_par_iter().map(|seed| fly(seed, &Sensors::from(sensors)));
        let flown: Vec<Seed> = flown.collect::<anyhow::Result<_>>()?;
        let mut add = |what: String, freedom: usize, of: &dyn Fn(&Seed) -> f64| {
            let (n, expected) = (seeds as f64, freedom as f64);
            let mean = flown.iter().map(of).sum::<f64>() / n;
            let bound = WITHIN * (2.0 * expected / n).sqrt();
            let off = format!("{preset}: {what}, off its mean");
            targets.push(Target::at_most(off, Some((mean - expected).abs()), bound, ""));
            rows.push(Row { preset, what, mean, expected, bound });
        };
        for (check, at_s) in CHECKS_S.iter().enumerate() {
            for (part, (name, _, states)) in PARTS.iter().enumerate() {
                add(format!("NEES, {name}, {at_s} s"), *states, &|seed| seed.nees[check][part]);
            }
        }
        for source in Source::ALL {
            let i = source as usize;
            if flown.iter().any(|seed| seed.nis[i] > 0.0) {
                add(format!("NIS, {source:?}"), source.components(), &|seed| seed.nis[i]);
            }
        }
        let most = |of: fn(&Seed) -> f64| flown.iter().map(of).fold(0.0, f64::max);
        targets.push(Target::at_most(
            format!("{preset}: resets, most of a seed ({:.0} refused)", most(|seed| seed.refused)),
            Some(most(|seed| seed.resets)),
            MOST_RESETS,
            "",
        ));
    }
    Ok(rows)
}

/// Table of the means.
pub fn table(rows: &[Row]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let cells = |row: &Row| {
        let numbers = [row.mean, row.expected, row.bound].map(|number| format!("{number:.2}"));
        [row.preset.to_owned(), row.what.clone()].into_iter().chain(numbers).collect()
    };
    let columns = ["preset", "normalised square", "mean", "expected", "+-"];
    Table::new("Errors and innovations of ten minutes", &columns, rows.iter().map(cells).collect()).text()
}

/// Flies ten minutes of hover in gusts.
fn fly(seed: u64, sensors: &Sensors) -> anyhow::Result<Seed> {
    let mut scenario = settings::load_text(HOVER, "a hover in gusts", &[])?;
    scenario.run.seed = seed;
    scenario.plant.sensors = sensors.clone();
    let mut ring = nodes::ring(&scenario, false)?;
    let mut found = Seed { nees: Default::default(), nis: Default::default(), resets: 0.0, refused: 0.0 };
    while ring.begin()? {
        ring.answer(&Topic::OF_CONTROLLERS);
        let now_ns = ring.sample().stamp.tick * scenario.sample_ns();
        if let Some(check) = CHECKS_S.iter().position(|at_s| at_s * 1_000_000_000 == now_ns) {
            let unit = ring.plant().navigation().expect("the presets have the EKF");
            found.nees[check] = nees(ring.sample(), &ring.plant().truth(), &unit.covariance(now_ns));
            let records = Source::ALL.map(|source| unit.navigation().filter().record(source));
            found.nis = records.map(|record| record.nis);
            found.resets = records.iter().map(|record| record.resets).sum();
            found.refused = records.iter().map(|record| record.refused).sum();
        }
        ring.end(|_| true);
    }
    Ok(found)
}

/// Normalised square of the error of each part.
fn nees(state: &State, truth: &Truth, covariance: &Covariance) -> [f64; PARTS.len()] {
    let parts = |motion: &Kinematics| {
        let [roll, pitch, yaw] = motion.attitude_rad;
        let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        (Vector3::from(motion.position_m), attitude * Vector3::from(motion.velocity_mps), attitude)
    };
    let (estimated, actual) = (parts(&state.measured), parts(&truth.actual));
    let off = [actual.0 - estimated.0, actual.1 - estimated.1, (estimated.2.inverse() * actual.2).scaled_axis()];
    let off = DVector::from_iterator(9, off.iter().flat_map(|part| part.iter().copied()));
    PARTS.map(|(_, from, states)| {
        let covariance = covariance.view((from, from), (states, states)).into_owned();
        let off = off.rows(from, states).into_owned();
        covariance.cholesky().map_or(f64::INFINITY, |covariance| off.dot(&covariance.solve(&off)))
    })
}
