//! Checks of a whole scenario: ranges of single numbers, and rules between settings.

pub mod faults;
pub mod found;
pub mod idle;
pub mod parts;
mod programs;
pub mod ranges;
pub mod swaps;
#[cfg(test)]
mod tests;

use std::ops::RangeBounds;

use airframe::{Trim, inertia};
use contract::topic::Topic;
use curves::named::SURVEY_LEG_S;
use toml::{Table, Value};

use self::found::{Found, Violation};
use self::ranges::{MAX_HORIZON, range_of};
use self::swaps::LoadCandidate;
use crate::table::control::{Law, Model, StateConstraints};
use crate::table::mission::{Mission, Ramp};
use crate::table::run::Scenario;
use crate::table::sensors::SensorSettings;
use crate::table::timing::Late;
use crate::table::vehicle::{PlantSettings, TurbulenceSettings};

/// Returns every rule that `scenario` breaks. `merged` is its table: the settings `given` on top of `defaults`.
pub fn violations(
    scenario: &Scenario,
    given: &Table,
    mut merged: Table,
    defaults: &Scenario,
    candidate: LoadCandidate,
) -> Vec<Violation> {
    for (_, node) in merged.get_mut("node").and_then(Value::as_table_mut).into_iter().flatten() {
        node.as_table_mut().map(|node| node.remove("settings")); // a node's program checks these
    }
    merged.retain(|table, _| !["fault", "swap"].contains(&table)); // faults and swaps are checked one by one below
    let settings = ranges::collect("", Value::Table(merged));
    let mut found = Found::default();
    for (key, numbers) in &settings {
        let lifted = |x: f64| key.starts_with("bounds.") && x == f64::INFINITY;
        if let Some(x) = numbers.iter().find(|x| !x.is_finite() && !lifted(**x)) {
            found.require(false, &[key], format!("`{}` = {x:?} is not finite", ranges::shown(key)), "finite numbers");
        }
    }
    if found.0.is_empty() {
        ranges::check(&settings, &mut found);
        check_vehicle(scenario, &mut found);
        check_mission(&scenario.mission, &mut found);
        parts::check(scenario, &mut found);
        check_controller(scenario, &mut found);
        check_deadlines(scenario, &mut found);
        programs::check(scenario, &mut found);
        idle::check(scenario, given, defaults, &mut found);
        if check_counts(scenario, &mut found) {
            for fault in &scenario.fault {
                faults::check(scenario, fault, &mut found);
            }
            swaps::check(scenario, candidate, &mut found);
        }
    }
    found.0
}

/// Largest number of faults of one scenario, which bounds the time of the check.
const MAX_FAULTS: usize = 1000;
/// Largest number of swaps of one scenario: each is checked by loading its candidate's settings.
const MAX_SWAPS: usize = 100;

/// Requires at most [`MAX_FAULTS`] faults and [`MAX_SWAPS`] swaps; returns whether the scenario has no more.
fn check_counts(scenario: &Scenario, found: &mut Found) -> bool {
    let counts = [("fault", scenario.fault.len(), MAX_FAULTS), ("swap", scenario.swap.len(), MAX_SWAPS)];
    for (key, count, most) in counts {
        found.require(count <= most, &[key], format!("{count} of `{key}`"), &format!("at most {most}"));
    }
    counts.iter().all(|(_, count, most)| count <= most)
}

/// Largest inclination of the magnetic field at which a magnetometer tells the heading of a standing vehicle \[deg\].
const MAX_INCLINATION_DEG: f64 = 80.0;

fn check_vehicle(scenario: &Scenario, found: &mut Found) {
    let plant = &scenario.plant;
    for (key, lag_s) in [("plant.rotor_lag_s", plant.rotor_lag_s), ("plant.servo_lag_s", plant.servo_lag_s)] {
        found.require(
            lag_s >= plant.substep_s / 2.0,
            &[key, "plant.substep_s"],
            format!("`{key}` = {lag_s:?} is too short for `plant.substep_s` = {:?}", plant.substep_s),
            "at least half a substep: below, the integration (RK4) is not stable",
        );
    }

    check_hover(scenario, found);
    check_inertia(scenario, found);
    found.require(
        !scenario.initial.standing || plant.ground.present,
        &["initial.standing", "plant.ground.present"],
        "`initial.standing` where there is no ground".into(),
        "`plant.ground.present` = true with it",
    );
    let (alignment, magnetometer) = (&plant.sensors.alignment, &plant.sensors.magnetometer);
    let stands = alignment.standing_s > 0.0;
    let moves = scenario.initial.velocity_mps != [0.0; 3] || scenario.initial.rates_radps != [0.0; 3];
    found.require(
        !stands || !moves,
        &["plant.sensors.alignment.standing_s", "initial.velocity_mps", "initial.rates_radps"],
        "`plant.sensors.alignment.standing_s` with a vehicle that starts in motion".into(),
        "`initial.velocity_mps` and `initial.rates_radps` = [0, 0, 0] with it",
    );
    found.require(
        !stands || magnetometer.rate_hz > 0.0 && magnetometer.inclination_deg.abs() <= MAX_INCLINATION_DEG,
        &["plant.sensors.alignment.standing_s", "plant.sensors.magnetometer"],
        "`plant.sensors.alignment.standing_s` without a magnetometer that tells the heading".into(),
        "`plant.sensors.magnetometer.rate_hz` above 0, and an `inclination_deg` of at most 80 with it",
    );
    let SensorSettings { bias, bias_walk, bias_s, .. } = &plant.sensors.position;
    found.require(
        *bias_s == 0.0 || [bias, bias_walk].into_iter().flatten().any(|bias| *bias > 0.0),
        &["plant.sensors.position.bias_s"],
        "`plant.sensors.position.bias_s` of a sensor without a bias".into(),
        "`bias` or `bias_walk` with it, or 0",
    );
    let steps = plant.wind_ned_mps.iter().any(|(_, wind)| *wind != [0.0; 3]);
    let blows = steps || plant.turbulence.is_on();
    faults::check_air(
        blows,
        &["plant.wind_ned_mps", "plant.turbulence.wind_at_6m_mps", "plant.drag_linear_nspm"],
        plant,
        found,
    );
    check_turbulence(plant, found);

    let [north, east, down] = scenario.initial.position_m;
    found.require(
        libm::hypot(libm::hypot(north, east), down) < 500.0,
        &["initial.position_m"],
        "`initial.position_m` is too far out".into(),
        "within 500 m of the origin: beyond, a run counts as diverged",
    );
    found.require(
        scenario.initial.attitude_deg[1].abs() < 88.0,
        &["initial.attitude_deg"],
        format!("`initial.attitude_deg` has a pitch of {:?}", scenario.initial.attitude_deg[1]),
        "a pitch between -88 and 88: Euler angles end at 90",
    );
    let wind: Vec<f64> = plant.wind_ned_mps.iter().map(|step| step.0).collect();
    let disturbance: Vec<f64> = plant.disturbance.iter().map(|step| step.0).collect();
    check_steps("plant.wind_ned_mps", &wind, found);
    check_steps("plant.disturbance", &disturbance, found);
}

/// With `from_wind`, requires a horizontal wind and no other setting of `plant.turbulence`.
fn check_turbulence(plant: &PlantSettings, found: &mut Found) {
    let turbulence = &plant.turbulence;
    let horizontal = plant.wind_ned_mps.iter().any(|(_, [north, east, _])| [*north, *east] != [0.0; 2]);
    found.require(
        !turbulence.from_wind || horizontal,
        &["plant.turbulence.from_wind", "plant.wind_ned_mps"],
        "`plant.turbulence.from_wind` where no wind blows along the ground".into(),
        "a wind with it, for instance `plant.wind_ned_mps` = [[0.0, [6.0, 0.0, 0.0]]]",
    );
    let unused = TurbulenceSettings { from_wind: true, ..TurbulenceSettings::default() };
    found.require(
        !turbulence.from_wind || *turbulence == unused,
        &["plant.turbulence", "plant.turbulence.from_wind"],
        "`plant.turbulence` has a wind, height, airspeed or direction of its own beside `from_wind`".into(),
        "`from_wind` = true alone, which takes those of the moment, or the others without it",
    );
}

/// Requires that both inertias are physically possible: that of `[airframe]`, and that of the flown vehicle.
fn check_inertia(scenario: &Scenario, found: &mut Found) {
    let known = &scenario.airframe;
    let model = [[known.ixx_kgm2, 0.0, 0.0], [0.0, known.iyy_kgm2, 0.0], [0.0, 0.0, known.izz_kgm2]];
    for (table, tensor) in [("airframe", model), ("plant.airframe", scenario.flown_inertia_kgm2())] {
        let keys = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"].map(|element| format!("{table}.{element}_kgm2"));
        let possible = inertia::is_possible(tensor);
        found.require(
            possible,
            &keys.each_ref().map(String::as_str),
            format!("`{table}` has moments of inertia that no body has"),
            "no principal moment above the sum of the other two, and a tensor that is positive definite: the mass of a \
             body is nowhere negative",
        );
        if !possible {
            break; // the flown inertia is made from `[airframe]`: one message is enough
        }
    }
}

/// Requires that the models of plant and mixer both have a hover, inside the limits of the actuators.
fn check_hover(scenario: &Scenario, found: &mut Found) {
    let plant = &scenario.plant;
    for (reaction, key) in
        [(plant.tilt_reaction, "plant.tilt_reaction"), (scenario.mixer.tilt_reaction, "mixer.tilt_reaction")]
    {
        let trim = Trim::solve(&scenario.airframe, reaction);
        let (slowest, trim) = (trim.slowest(), trim.actuation);
        found.require(
            slowest > 0.0 && trim.rotor_speed.iter().chain([&trim.tilt_rad]).all(|x| x.is_finite()),
            &["airframe", key],
            "`airframe` has no hover".into(),
            "arms, mass and rotor constants of a vehicle that can hover",
        );
        found.require(
            plant.rotor_speed_min < slowest,
            &["plant.rotor_speed_min", "airframe", key],
            format!("`plant.rotor_speed_min` = {:?} leaves no hover", plant.rotor_speed_min),
            &format!("below the slowest rotor at trim, {slowest:.1}"),
        );
        let highest = scenario.limits().rotor_speed_max;
        found.require(
            trim.rotor_speed.iter().zip(highest).all(|(speed, highest)| *speed < highest),
            &["plant.rotor_speed_max_ratio", "airframe", key],
            format!("`plant.rotor_speed_max_ratio` = {:?} leaves no hover", plant.rotor_speed_max_ratio),
            "so much that every rotor's highest speed is above its trim speed",
        );
        let tilt_deg = trim.tilt_rad.to_degrees();
        found.require(
            plant.tilt_max_deg > tilt_deg,
            &["plant.tilt_max_deg", "airframe"],
            format!("`plant.tilt_max_deg` = {:?} leaves no hover", plant.tilt_max_deg),
            &format!("above the tilt at trim, {tilt_deg:.2}, and at most 90"),
        );
        if plant.tilt_reaction == scenario.mixer.tilt_reaction {
            break;
        }
    }
}

fn check_mission(mission: &Mission, found: &mut Found) {
    let Ramp::Seconds(ramp_s) = mission.ramp_s else { return };
    let most_s = SURVEY_LEG_S / 2.0;
    found.require(
        ramp_s <= most_s,
        &["mission.ramp_s"],
        format!("`mission.ramp_s` = {ramp_s:?} does not fit the legs of {SURVEY_LEG_S:?} s"),
        &format!("at most half of them, {most_s:?}"),
    );
}

fn check_controller(scenario: &Scenario, found: &mut Found) {
    let (attitude, mpc) = (&scenario.attitude, &scenario.attitude.mpc);
    let rate_hz = scenario.run.rate_hz;
    found.require(
        1_000_000_000_u32.checked_rem(rate_hz) == Some(0),
        &["run.rate_hz"],
        format!("`run.rate_hz` = {rate_hz} has no sample time in whole nanoseconds"),
        "50, 64, 80, 100, 125, 160, 200, 250, 320, 400, 500, 625, 800, 1000, 1250, 1600, 2000",
    );
    let bandwidth_radps = scenario.guidance.disturbance_observer_radps;
    found.require(
        bandwidth_radps < f64::from(rate_hz),
        &["guidance.disturbance_observer_radps", "run.rate_hz"],
        format!("`guidance.disturbance_observer_radps` = {bandwidth_radps:?} is out of range"),
        &format!("at least 0, below {rate_hz}: beyond the sample rate it is no filter"),
    );
    if range_of("run.rate_hz").contains(&f64::from(rate_hz)) {
        check_horizons(scenario, found);
    }
    found.require(
        attitude.law != Law::Lqr || mpc.model != Model::Scheduled,
        &["attitude.mpc.model", "attitude.law"],
        "`attitude.mpc.model` = \"scheduled\" with the regulator, which has one gain".into(),
        "`attitude.law` = \"mpc\" with it, or \"hover\" or \"coupled\"",
    );
    found.require(
        mpc.model != Model::Coupled || attitude.disturbance_gain > 0.0,
        &["attitude.mpc.model", "attitude.disturbance_gain"],
        "`attitude.mpc.model` = \"coupled\" without an estimate, which alone uses the term".into(),
        "`attitude.disturbance_gain` above 0 with it, for instance 0.1",
    );
    found.require(
        mpc.state_constraints == StateConstraints::None || matches!(mpc.model, Model::Hover | Model::Coupled),
        &["attitude.mpc.model", "attitude.mpc.state_constraints"],
        "`attitude.mpc.state_constraints` with a model at speed, where that of hover predicts them".into(),
        "`attitude.mpc.model` = \"hover\" or \"coupled\" with them",
    );
    found.require(
        !attitude.delay_compensation.is_measured() || matches!(mpc.model, Model::Hover | Model::Coupled),
        &["attitude.mpc.model", "attitude.delay_compensation"],
        "`attitude.delay_compensation` = \"measured\" with a model at speed, which predicts whole samples only".into(),
        "`attitude.mpc.model` = \"hover\" or \"coupled\" with it, or `attitude.delay_compensation` = true",
    );
    found.require(
        attitude.actuator_lag_model_s <= 0.0 || attitude.actuator_lag_model_s >= 0.001,
        &["attitude.actuator_lag_model_s"],
        format!("`attitude.actuator_lag_model_s` = {:?} is too short to model", attitude.actuator_lag_model_s),
        "0 for no lag, or at least 0.001",
    );
    found.require(
        attitude.servo_lag_model_s.is_none() || attitude.actuator_lag_model_s > 0.0,
        &["attitude.servo_lag_model_s", "attitude.actuator_lag_model_s"],
        "`attitude.servo_lag_model_s` without a lag of the rotors in the model".into(),
        "`attitude.actuator_lag_model_s`, the lag of the rotors, at least 0.001",
    );
    let preview_s = scenario.guidance.preview_s;
    found.require(
        preview_s <= 0.0 || preview_s >= 0.01,
        &["guidance.preview_s"],
        format!("`guidance.preview_s` = {preview_s:?} is too short to look ahead"),
        "0 for no preview, or at least 0.01",
    );
    found.require(!scenario.name.trim().is_empty(), &["name"], "`name` is empty".into(), "what the run is called");
}

/// Requires 1 <= Nu <= Np <= 200, in samples at the rate of `scenario`.
fn check_horizons(scenario: &Scenario, found: &mut Found) {
    let (mpc, rate_hz) = (&scenario.attitude.mpc, scenario.run.rate_hz);
    let seconds = |samples: usize| samples as f64 / f64::from(rate_hz);
    let horizons = [
        ("attitude.mpc.prediction_horizon_s", mpc.prediction_horizon_s, scenario.np()),
        ("attitude.mpc.control_horizon_s", mpc.control_horizon_s, scenario.nu()),
    ];
    let are_possible = horizons.map(|(key, time_s, samples)| {
        let is_possible = (1..=MAX_HORIZON).contains(&samples);
        if !is_possible {
            found.0.retain(|other| other.keys != [key]); // the message of the range for all rates says less
        }
        found.require(
            is_possible,
            &[key],
            format!("`{key}` = {time_s:?} is {samples} samples at {rate_hz} Hz"),
            &format!("{} to {} at this rate, 1 to {MAX_HORIZON} samples", seconds(1), seconds(MAX_HORIZON)),
        );
        is_possible
    });
    let [(prediction, prediction_s, np), (control, control_s, nu)] = horizons;
    found.require(
        nu <= np || are_possible != [true; 2],
        &[control, prediction],
        format!(
            "`{control}` = {control_s:?} is longer than `{prediction}` = {prediction_s:?}: {nu} and {np} samples at \
             {rate_hz} Hz"
        ),
        &format!(
            "`{control}` of {} to {}, or `{prediction}` of {} to {}",
            seconds(1),
            seconds(np),
            seconds(nu),
            seconds(MAX_HORIZON)
        ),
    );
}

fn check_deadlines(scenario: &Scenario, found: &mut Found) {
    for topic in Topic::ALL {
        let late = scenario.deadline_of(topic as usize).late;
        let (refused, allowed) = match (topic, late) {
            (Topic::State, Late::Hold | Late::Degrade) => {
                (true, "\"send\", \"skip\" or \"stop\": a sample is what was measured, now")
            }
            (Topic::Reference | Topic::Actuators, Late::Degrade) => {
                (true, "\"send\", \"skip\", \"hold\" or \"stop\": it has nothing cheaper to do")
            }
            _ => (false, ""),
        };
        let key = format!("node.{}.late", topic.publisher());
        found.require(
            !refused,
            &[&key, "deadline.late"],
            format!("`{key}` cannot be {late:?}").to_lowercase(),
            allowed,
        );
    }
}

/// Requires that `times_s`, the times of the steps under `key`, are at least 0 and sorted.
fn check_steps(key: &str, times_s: &[f64], found: &mut Found) {
    found.require(
        times_s.first().is_none_or(|first| *first >= 0.0) && times_s.is_sorted(),
        &[key],
        format!("the steps of `{key}` are out of order"),
        "times of 0 or later, sorted",
    );
}
