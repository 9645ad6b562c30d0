//! Flights in process in small motions about the hover.

use contract::message::State;
use contract::scenario::{Guidance, Heading, Initial, Mission, Plant, Run, Scenario, Sensors, TrajectoryKind};
use plant::tricopter::Tricopter;
use ring::ended::Ended;
use ring::stepped::Stepped;
use runtime::node::Open;

/// Size of perturbations and steps \[m\], \[m/s\], \[rad\].
pub const SMALL: f64 = 1e-3;

/// Limit of the error integrals that small motions do not reach \[m s\].
const NO_LIMIT_MS: f64 = 1e9;

/// Returns `scenario` for small motions: a hover at the origin to the north, alone with the vehicle and its controllers.
/// The integrals have no limit, which they would reach if the vehicle is not the one that the controllers know.
pub fn scenario(scenario: &Scenario) -> Scenario {
    Scenario {
        run: Run { command_jitter_ms: 0.0, command_drop_probability: 0.0, ..scenario.run.clone() },
        mission: Mission {
            trajectory: TrajectoryKind::Hover,
            heading_deg: Heading::Constant(0.0),
            ..scenario.mission.clone()
        },
        initial: Initial::default(),
        plant: Plant {
            wind_ned_mps: vec![],
            disturbance: vec![],
            noise: Default::default(),
            sensors: Sensors::default(),
            battery: Default::default(),
            ground: Default::default(),
            wind_roughness_m: 0.0,
            turbulence: Default::default(),
            ..scenario.plant.clone()
        },
        guidance: Guidance { integral_limit: NO_LIMIT_MS, ..scenario.guidance.clone() },
        fault: vec![],
        swap: vec![],
        ..scenario.clone()
    }
}

/// Flies `scenario` for `flight_s` seconds with the vehicle of the scenario `vehicle` and the node that `guidance`
/// opens, or until `watch`, which gets every sample, returns false; returns whether it flew to its end.
pub fn fly(
    scenario: &Scenario,
    vehicle: &Scenario,
    guidance: Open,
    flight_s: f64,
    mut watch: impl FnMut(&State) -> bool,
) -> bool {
    let open = [guidance, ring::nodes::open, ring::nodes::open];
    let scenario = Scenario { run: Run { duration_s: flight_s, ..scenario.run.clone() }, ..scenario.clone() };
    let ring = Stepped::new(&scenario, Box::new(Tricopter::new(vehicle)), false, open);
    let mut goes_on = true;
    let flown = ring.and_then(|ring| {
        ring.fly(
            |record| {
                goes_on &= record.message().is_none_or(&mut watch);
                goes_on
            },
            |_| {},
        )
    });
    let flown = flown.unwrap_or_else(|error| panic!("cannot fly a checked scenario in process: {error}"));
    goes_on && matches!(flown.ended, Ended::Flown) && flown.failures.is_empty()
}
