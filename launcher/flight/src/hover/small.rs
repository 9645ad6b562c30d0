//! Flights in process in small motions about the hover.

use airframe::Trim;
use contract::message::{Kinematics, Truth};
use nalgebra::{Matrix3, Rotation3, Vector3};
use plant::dynamics::{Dynamics, Surroundings, assemble};
use plant::rotors::Condition;
use plant::tricopter::Tricopter;
use ring::ended::Ended;
use ring::stepped::Stepped;
use runtime::node::Open;
use settings::{
    BatterySettings, GroundSettings, GuidanceSettings, Initial, Mission, Noise, PlantSettings, RollReference, Run,
    Scenario, SensorsSettings, TrajectoryKind, TurbulenceSettings,
};

/// Size of perturbations and steps \[m\], \[m/s\], \[rad\].
pub const SMALL: f64 = 1e-3;

/// Returns `scenario` for small motions: a hover at the origin with heading north, without wind, ground, battery,
/// sensor errors, faults and swaps. The vehicle is at rest there by [`balance`], the controllers by the roll of their
/// trim as reference.
pub fn scenario(scenario: &Scenario) -> Scenario {
    let [known, flown] = [scenario.mixer.tilt_reaction, scenario.plant.tilt_reaction]
        .map(|tilt_reaction| Trim::solve(&scenario.airframe, tilt_reaction));
    let mut hover = Scenario {
        run: Run { command_jitter_ms: 0.0, command_drop_probability: 0.0, ..scenario.run.clone() },
        mission: Mission { trajectory: TrajectoryKind::Hover, heading_deg: 0.0, ..scenario.mission.clone() },
        initial: Initial {
            attitude_deg: [(known.roll_rad - flown.roll_rad).to_degrees(), 0.0, 0.0],
            ..Initial::default()
        },
        plant: PlantSettings {
            wind_ned_mps: vec![],
            disturbance: vec![],
            noise: Noise::default(),
            sensors: SensorsSettings::default(),
            battery: BatterySettings::default(),
            ground: GroundSettings::default(),
            wind_roughness_m: 0.0,
            turbulence: TurbulenceSettings::default(),
            ..scenario.plant.clone()
        },
        guidance: GuidanceSettings { roll_reference: RollReference::Trim, ..scenario.guidance.clone() },
        fault: vec![],
        swap: vec![],
        ..scenario.clone()
    };
    hover.plant.disturbance = vec![balance(&hover, &known)];
    hover
}

/// Computes the disturbance that holds the flown vehicle at `trim`, the hover of the vehicle that the controllers
/// assume: start \[s\], NED force \[N\], moment about the body axes \[N m\].
fn balance(scenario: &Scenario, trim: &Trim) -> (f64, [f64; 3], [f64; 3]) {
    let motion = Kinematics { attitude_rad: [trim.roll_rad, 0.0, 0.0], ..Kinematics::default() };
    let x = assemble(&motion, &trim.actuation);
    let outside = Surroundings::default();
    let rate = Dynamics::new(scenario).derivative(&x, &trim.actuation, &Condition::default(), &outside);
    let [acceleration, turn] = [3, 10].map(|first| Vector3::new(rate[first], rate[first + 1], rate[first + 2]));
    let force_n =
        Rotation3::from_euler_angles(trim.roll_rad, 0.0, 0.0) * acceleration * -scenario.flown_airframe().mass_kg;
    let moment_nm = Matrix3::from(scenario.flown_inertia_kgm2()) * -turn;
    (0.0, force_n.into(), moment_nm.into())
}

/// Flies `scenario` for `flight_s` seconds with the vehicle of the scenario `vehicle` and the node that `guidance`
/// opens, or until `watch`, which gets every TRUTH, returns false; returns whether the flight was flown to its end.
pub fn fly(
    scenario: &Scenario,
    vehicle: &Scenario,
    guidance: Open,
    flight_s: f64,
    mut watch: impl FnMut(&Truth) -> bool,
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

#[cfg(test)]
mod tests {
    use super::*;
    use settings::load;

    #[test]
    fn a_vehicle_that_the_controllers_do_not_know_rests_at_their_hover() {
        let unknown = [
            "profile=paper",
            "plant.airframe.mass_kg=1.4",
            "plant.airframe.ixz_kgm2=0.001",
            "plant.airframe.centre_of_mass_m=[0.01, 0.005, 0.0]",
            "plant.rotor_effectiveness=[0.9, 1.0, 0.95]",
            "plant.drag_linear_nspm=[0.2, 0.2, 0.1]",
        ];
        let small = scenario(&load(None, &unknown.map(str::to_owned)).unwrap());
        let mut farthest = 0.0_f64;
        let flew = fly(&small, &small, ring::nodes::open, 5.0, |truth| {
            let numbers = truth.actual.position_m.into_iter().chain(truth.actual.rates_radps);
            farthest = numbers.map(f64::abs).fold(farthest, f64::max);
            true
        });
        assert!(flew && farthest < 1e-9, "{farthest:e}");
    }
}
