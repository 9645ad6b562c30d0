//! `measure conditions`: one fast mission after the other under each model of the MPC, side by side.
//!
//! Every mission reaches 10 to 15 m/s with drag, in process, so that all but the times is the same on every machine. Between
//! the rows only `mpc.model` changes. The times are those of the controller's steps, replayed one after another.

use std::hint::black_box;
use std::path::PathBuf;

use attitude_mpc::AttitudeMpc;
use contract::Scenario;
use contract::message::{Controls, Reference, State};
use contract::scenario::{self, Mode, Model};
use flight::log::Record;
use runtime::timed;
use serde::Serialize;
use serde_json::json;
use view::metrics::Metrics;
use view::percentiles::Percentiles;

use crate::findings::{Findings, Target};
use crate::flights::{SURVIVED_M, failed_at_s, in_process};
use view::table::Table;

/// 80 m legs in 10 s: the shipped scenario, and the vehicle and guidance of the other missions.
const LEGS: (&str, &str) = ("scenarios/fast-legs.toml", include_str!("../../../scenarios/fast-legs.toml"));
/// Radius of the circle \[m\], height of all missions \[m\].
const RADIUS_M: f64 = 40.0;
const HEIGHT_M: f64 = 20.0;
/// The lap begins, and takes this long: 14.7 m/s at its middle \[s\].
const LAP_AT_S: f64 = 10.0;
const LAP_S: f64 = 32.0;
/// Between two points of the circle \[s\].
const POINT_S: f64 = 0.1;
/// Mean wind of the gusts \[m/s\].
const WIND_MPS: f64 = 6.0;

/// `mpc.disturbance_gain` of the missions where the input disturbance is estimated.
const GAIN: f64 = 0.1;

/// The rows of the table.
const MODELS: [(Model, &str); 3] = [(Model::Hover, "hover"), (Model::Scheduled, "scheduled"), (Model::Ltv, "ltv")];

#[derive(clap::Args)]
pub struct ConditionsArgs {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as conditions.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// One row of the table.
#[derive(Debug, Serialize)]
struct ConditionFlight {
    mission: String,
    /// Whether the input disturbance is estimated.
    estimated: bool,
    model: &'static str,
    /// Whether it did not diverge and was back in the end.
    survived: bool,
    #[serde(flatten)]
    metrics: Metrics,
    max_altitude_error_m: f64,
    /// Mean of the demand's part of the cost (4), `u'Ru`.
    effort: f64,
    /// Samples at which the plan touched a limit of the actuators.
    active: u64,
    /// A step of the controller.
    step: Option<Percentiles>,
    state_hash: Option<String>,
}

/// Returns the exit code.
pub fn measure(args: &ConditionsArgs) -> anyhow::Result<u8> {
    let missions = missions()?;
    let each = missions.iter().flat_map(|mission| MODELS.map(|model| (mission, model)));
    let flights: Vec<ConditionFlight> = each.map(|(mission, model)| fly(mission, model)).collect();
    let table = table(&flights);
    let found = Findings::new(json!({ "flights": flights }), targets(&flights), false)?;
    found.conclude(args.out.as_deref(), "conditions.json", args.json, &table)
}

/// The missions, each a variant of the legs.
fn missions() -> anyhow::Result<Vec<Scenario>> {
    let (path, text) = LEGS;
    let legs = scenario::from_merged(text, path)?;
    let named = |name: &str, disturbance_gain: f64| {
        let mut mission = Scenario { name: name.into(), ..legs.clone() };
        mission.mpc.disturbance_gain = disturbance_gain;
        mission
    };

    let mut circle = named("circle", 0.0);
    let lap = (0..=(LAP_S / POINT_S) as u32).map(|i| {
        let x = f64::from(i) * POINT_S / LAP_S;
        let turns = x * x * x * (10.0 + x * (-15.0 + x * 6.0)); // min-jerk
        let (sin, cos) = libm::sincos(turns * std::f64::consts::TAU);
        (LAP_AT_S + f64::from(i) * POINT_S, [RADIUS_M * sin, RADIUS_M * (1.0 - cos), -HEIGHT_M])
    });
    // The climb in steps as short as those of the lap: between points the velocity is constant.
    let climb = (0..(LAP_AT_S / POINT_S) as u32).map(|i| {
        let x = f64::from(i) * POINT_S / LAP_AT_S;
        (f64::from(i) * POINT_S, [0.0, 0.0, -HEIGHT_M * x * x * x * (10.0 + x * (-15.0 + x * 6.0))])
    });
    (circle.mission.times_s, circle.mission.waypoints_m) = climb.chain(lap).unzip();
    circle.mission.ramp_s = scenario::Ramp::Seconds(0.0);

    let mut lawnmower = named("lawnmower", 0.0);
    let mut times_s = vec![0.0, 10.0];
    let mut waypoints_m = vec![[0.0; 3], [0.0, 0.0, -HEIGHT_M]];
    for pass in 0..4_i32 {
        let end = if pass % 2 == 0 { 80.0 } else { 0.0 };
        let last_s = times_s[times_s.len() - 1];
        let east = 10.0 * f64::from(pass);
        times_s.extend([last_s + 10.0, last_s + 14.0]); // 80 m with ramps of 2 s: 10 m/s
        waypoints_m.extend([[end, east, -HEIGHT_M], [end, east + 10.0, -HEIGHT_M]]);
    }
    (lawnmower.mission.times_s, lawnmower.mission.waypoints_m) = (times_s, waypoints_m);
    lawnmower.mission.ramp_s = scenario::Ramp::Seconds(2.0);
    lawnmower.run.duration_s = 70.0;

    let mut gusts = named("gusts", 0.0);
    gusts.plant.wind_ned_mps = vec![(0.0, [WIND_MPS, 0.0, 0.0])];
    gusts.plant.turbulence.wind_at_6m_mps = WIND_MPS;
    gusts.plant.turbulence.airspeed_mps = 10.0;
    let mut estimated = Scenario { name: "gusts, estimated".into(), ..gusts.clone() };
    estimated.mpc.disturbance_gain = GAIN;
    Ok(vec![named("legs", 0.0), named("legs, estimated", GAIN), circle, lawnmower, gusts, estimated])
}

fn fly(mission: &Scenario, (model, name): (Model, &'static str)) -> ConditionFlight {
    let mut scenario = mission.clone();
    scenario.run.mode = Mode::Inprocess;
    scenario.mpc.model = model;
    let (mut states, mut references, mut max_altitude_error_m) = (vec![], vec![], 0.0_f64);
    let (mut effort, mut active, mut demands) = (0.0, 0, 0_u32);
    let (summary, _) = in_process(&scenario, |record| match record {
        Record::State(state) => states.push(*state),
        Record::Reference(reference) => references.push(*reference),
        Record::Controls(Controls { demand, active_constraints, .. }) => {
            effort += demand.iter().zip(scenario.mpc.r).map(|(u, r)| u * u * r).sum::<f64>();
            active += u64::from(*active_constraints > 0);
            demands += 1;
        }
        Record::Actuators(_) => {}
    });
    for (state, reference) in states.iter().zip(&references) {
        let miss = state.actual.position_m[2] - reference.position_m[2];
        max_altitude_error_m = max_altitude_error_m.max(miss.abs());
    }
    ConditionFlight {
        mission: scenario.name.clone(),
        estimated: scenario.mpc.disturbance_gain > 0.0,
        model: name,
        survived: failed_at_s(&summary).is_none(),
        metrics: summary.metrics(),
        max_altitude_error_m,
        effort: effort / f64::from(demands),
        active,
        step: Percentiles::of(step_times_ns(&scenario, &states, &references)),
        state_hash: summary.state_hash(),
    }
}

/// How long a new controller takes for each sample \[ns\].
fn step_times_ns(scenario: &Scenario, states: &[State], references: &[Reference]) -> Vec<u64> {
    let mut mpc = AttitudeMpc::new(scenario);
    let step = |(state, reference): (&State, &Reference)| {
        timed(|| black_box(mpc.step(state.stamp.tick, black_box(state), black_box(reference)))).1
    };
    states.iter().zip(references).map(step).collect()
}

fn targets(flights: &[ConditionFlight]) -> Vec<Target> {
    let lost = flights.iter().filter(|flight| !flight.survived).count();
    let missions = flights.chunks(MODELS.len());
    let shares = missions.flat_map(|rows| {
        let best = rows.iter().map(|row| row.metrics.rms_position_error_m).fold(f64::INFINITY, f64::min);
        // The default estimates nothing. Where something is estimated, the claim is that the schedule pays.
        rows.iter().take(2).map(move |row| {
            let (figure, share) = (
                format!("{}: error of {} over the best", row.mission, row.model),
                Some(row.metrics.rms_position_error_m / best),
            );
            if row.estimated && row.model == MODELS[0].1 {
                Target::at_least(figure, share, 2.0)
            } else {
                Target::at_most(figure, share, 1.1, "")
            }
        })
    });
    [Target::none("flights lost", lost)].into_iter().chain(shares).collect()
}

fn table(flights: &[ConditionFlight]) -> String {
    let headings =
        ["mission", "model", "RMS m", "max m", "altitude m", "effort", "active", "p50 us", "p99 us", "survived"];
    let cells = |flight: &ConditionFlight| {
        let ConditionFlight { metrics, step, .. } = flight;
        vec![
            flight.mission.clone(),
            flight.model.to_owned(),
            format!("{:.4}", metrics.rms_position_error_m),
            format!("{:.4}", metrics.max_position_error_m),
            format!("{:.4}", flight.max_altitude_error_m),
            format!("{:.4}", flight.effort),
            flight.active.to_string(),
            step.map_or("-".into(), |step| format!("{:.1}", step.p50_us)),
            step.map_or("-".into(), |step| format!("{:.1}", step.p99_us)),
            if flight.survived { "yes".into() } else { "no".into() },
        ]
    };
    let title = format!(
        "position error, largest altitude error, mean of u'Ru, samples with an active limit, time of a step; survived: within \
         {SURVIVED_M} m of the reference in the end"
    );
    Table::new(&title, &headings, flights.iter().map(cells).collect()).text()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_missions_are_valid_under_every_model_and_reach_their_speed() {
        for mission in missions().unwrap() {
            for (model, _) in MODELS {
                let mut flown = mission.clone();
                flown.mpc.model = model;
                scenario::from_merged(&scenario::to_toml(&flown), "mission").unwrap();
            }
            let legs = mission.mission.waypoints_m.windows(2).zip(mission.mission.times_s.windows(2));
            let fastest = legs.map(|(leg, times)| {
                let way: f64 = (0..3).map(|i| (leg[1][i] - leg[0][i]).powi(2)).sum();
                way.sqrt() / (times[1] - times[0])
            });
            assert!(fastest.fold(0.0, f64::max) >= 8.0, "{}", mission.name);
        }
    }

    #[test]
    fn the_first_row_is_what_ships() {
        assert_eq!(MODELS[0].0, Scenario::default().mpc.model);
    }
}
