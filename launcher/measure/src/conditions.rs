//! `measure conditions`: flies fast missions under each model of the MPC and compares them in a table.
//!
//! Every mission reaches 10 to 15 m/s with drag, in process: everything but the times is the same on every machine. The
//! rows differ only in `mpc.model` and `mpc.law`. The times are those of the controller's steps, replayed in a row.

use std::hint::black_box;
use std::path::PathBuf;

use attitude_mpc::AttitudeMpc;
use contract::Scenario;
use contract::message::{Controls, Reference, State};
use contract::scenario::{self, Law, Mode, Model, TrajectoryKind};
use flight::log::Record;
use outcome::metrics::Metrics;
use outcome::percentiles::Percentiles;
use runtime::timed;
use serde::Serialize;
use serde_json::json;

use crate::findings::{Findings, Target};
use crate::flights::{SURVIVED_M, in_process, survival};
use view::table::Table;

/// Shipped scenario with 80 m legs in 10 s; also the vehicle and the guidance of the other missions.
const LEGS: (&str, &str) = ("scenarios/fast-legs.toml", include_str!("../../../scenarios/fast-legs.toml"));
/// Radius of the circle \[m\], height of all missions \[m\].
const RADIUS_M: f64 = 40.0;
const HEIGHT_M: f64 = 20.0;
/// Duration of a lap, which reaches 14.7 m/s at its middle \[s\].
const LAP_S: f64 = 32.0;
/// Mean wind of the gusts \[m/s\].
const WIND_MPS: f64 = 6.0;

/// Value of `mpc.disturbance_gain` in the missions that estimate the input disturbance.
const GAIN: f64 = 0.1;

/// Controller of a row of the table: a law with its model.
struct Controller {
    name: &'static str,
    law: Law,
    model: Model,
}

const fn controller(name: &'static str, law: Law, model: Model) -> Controller {
    Controller { name, law, model }
}

/// Controllers of the table.
const CONTROLLERS: [Controller; 6] = [
    controller("hover", Law::Mpc, Model::Hover),
    controller("coupled", Law::Mpc, Model::Coupled),
    controller("scheduled", Law::Mpc, Model::Scheduled),
    controller("ltv", Law::Mpc, Model::Ltv),
    controller("lqr hover", Law::Lqr, Model::Hover),
    controller("lqr coupled", Law::Lqr, Model::Coupled),
];

/// Controllers that have targets, hover first.
const CLAIMED: [&str; 3] = ["hover", "coupled", "scheduled"];

#[derive(clap::Args)]
pub struct ConditionsArgs {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as conditions.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// One flight: a row of the table.
#[derive(Debug, Serialize)]
struct ConditionFlight {
    mission: String,
    /// `true` if the input disturbance is estimated.
    estimated: bool,
    controller: &'static str,
    /// `true` if the vehicle did not diverge and was back in the end.
    survived: bool,
    #[serde(flatten)]
    metrics: Metrics,
    max_altitude_error_m: f64,
    /// Mean of the demand's part of the cost (4), `u'Ru`.
    effort: f64,
    /// Number of samples at which the plan touched a limit of the actuators.
    active: u64,
    /// Time of a step of the controller.
    step: Option<Percentiles>,
    state_hash: Option<String>,
}

/// Returns the exit code.
pub fn measure(args: &ConditionsArgs) -> anyhow::Result<u8> {
    let missions = missions()?;
    let each = missions.iter().flat_map(|mission| controllers(mission).map(move |controller| (mission, controller)));
    let flights: Vec<ConditionFlight> = each.map(|(mission, controller)| fly(mission, controller)).collect();
    let table = table(&flights);
    let found = Findings::new(json!({ "flights": flights }), targets(&flights), false)?;
    found.conclude(args.out.as_deref(), "conditions.json", args.json, &table)
}

/// Returns the missions, each a variant of the legs.
fn missions() -> anyhow::Result<Vec<Scenario>> {
    let (path, text) = LEGS;
    let legs = scenario::from_merged(text, path)?;
    let named = |name: &str, disturbance_gain: f64| {
        let mut mission = Scenario { name: name.into(), ..legs.clone() };
        mission.mpc.disturbance_gain = disturbance_gain;
        mission
    };

    let circle = |name: &str, disturbance_gain: f64| {
        let mut circle = named(name, disturbance_gain);
        circle.mission = scenario::Mission {
            trajectory: TrajectoryKind::Circle,
            radius_m: RADIUS_M,
            height_m: HEIGHT_M,
            period_s: LAP_S,
            ..scenario::Mission::default()
        };
        circle
    };

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
    Ok(vec![
        named("legs", 0.0),
        named("legs, estimated", GAIN),
        circle("circle", 0.0),
        circle("circle, estimated", GAIN),
        lawnmower,
        gusts,
        estimated,
    ])
}

/// Controllers that can fly a mission; the coupled models need the estimate, because the coupling is a term of it.
fn controllers(mission: &Scenario) -> impl Iterator<Item = &'static Controller> {
    let estimated = mission.mpc.disturbance_gain > 0.0;
    CONTROLLERS.iter().filter(move |controller| estimated || controller.model != Model::Coupled)
}

fn fly(mission: &Scenario, controller: &Controller) -> ConditionFlight {
    let mut scenario = Scenario { bounds: survival(), ..mission.clone() };
    scenario.run.mode = Mode::Inprocess;
    (scenario.mpc.law, scenario.mpc.model) = (controller.law, controller.model);
    let (mut states, mut references, mut max_altitude_error_m) = (vec![], vec![], 0.0_f64);
    let (mut effort, mut active, mut demands) = (0.0, 0, 0_u32);
    let (summary, verdict) = in_process(&scenario, |record| match record {
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
        controller: controller.name,
        survived: verdict.passed(),
        metrics: summary.metrics(),
        max_altitude_error_m,
        effort: effort / f64::from(demands),
        active,
        step: Percentiles::of(step_times_ns(&scenario, &states, &references)),
        state_hash: summary.state_hash(),
    }
}

/// Times the step of a new controller on each sample \[ns\].
fn step_times_ns(scenario: &Scenario, states: &[State], references: &[Reference]) -> Vec<u64> {
    let mut mpc = AttitudeMpc::new(scenario);
    let step = |(state, reference): (&State, &Reference)| {
        timed(|| black_box(mpc.step(state.stamp.tick, black_box(state), black_box(reference)))).1
    };
    states.iter().zip(references).map(step).collect()
}

fn targets(flights: &[ConditionFlight]) -> Vec<Target> {
    let claimed = |flight: &&ConditionFlight| CLAIMED.contains(&flight.controller);
    let lost = flights.iter().filter(claimed).filter(|flight| !flight.survived).count();
    let missions = flights.chunk_by(|a, b| a.mission == b.mission);
    let shares = missions.flat_map(|rows| {
        let best = rows.iter().map(|row| row.metrics.rms_position_error_m).fold(f64::INFINITY, f64::min);
        // Hover lacks the coupling: in missions that estimate (not the default) its error must be twice the best.
        rows.iter().filter(claimed).map(move |row| {
            let (figure, share) = (
                format!("{}: error of {} over the best", row.mission, row.controller),
                Some(row.metrics.rms_position_error_m / best),
            );
            if row.estimated && row.controller == CLAIMED[0] {
                Target::at_least(figure, share, 2.0)
            } else {
                Target::at_most(figure, share, 1.1, "")
            }
        })
    });
    [Target::none("flights lost of hover, coupled and scheduled", lost)].into_iter().chain(shares).collect()
}

fn table(flights: &[ConditionFlight]) -> String {
    let headings =
        ["mission", "controller", "RMS m", "max m", "altitude m", "effort", "active", "p50 us", "p99 us", "survived"];
    let cells = |flight: &ConditionFlight| {
        let ConditionFlight { metrics, step, .. } = flight;
        vec![
            flight.mission.clone(),
            flight.controller.to_owned(),
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
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_missions_are_valid_under_every_model_and_reach_their_speed() {
        for mission in missions().unwrap() {
            for controller in controllers(&mission) {
                let mut flown = mission.clone();
                (flown.mpc.law, flown.mpc.model) = (controller.law, controller.model);
                scenario::from_merged(&scenario::to_toml(&flown), "mission").unwrap();
            }
            let trajectory = guidance::Trajectory::new(&mission.mission);
            let fastest_mps = (0..600).map(|i| Vector3::from(trajectory.at(0.1 * f64::from(i)).velocity_mps).norm());
            assert!(fastest_mps.fold(0.0, f64::max) >= 10.0, "{}", mission.name);
        }
    }

    #[test]
    fn the_first_row_is_the_default_controller() {
        let Controller { law, model, .. } = CONTROLLERS[0];
        let shipped = Scenario::default().mpc;
        assert_eq!((law, model), (shipped.law, shipped.model));
    }
}
