//! Laws against other code: the geometric law inverts the plant's own dynamics, and INDI equals a second
//! implementation.

use std::process::Command;

use airframe::{MixingMatrix, Trim};
use attitude_mpc::AttitudeMpc;
use contract::actuation::Actuation;
use contract::message::{Kinematics, Reference, Stamp, State};
use plant::dynamics::{Dynamics, Surroundings, assemble};
use plant::rotors::Condition;
use proptest::prelude::*;
use settings::{Law, PidGains, Profile, Scenario};

use crate::harness::{fly, launcher, python_with, top};

/// Gains on w and on the rates, the only errors of the test.
const GAINS: PidGains = PidGains { kp: [4.0, 48.0, 48.0, 48.0], ki: [0.0; 4], kd: [12.0; 3] };

proptest! {
    #[test]
    fn the_geometric_demand_gives_the_wanted_acceleration_in_the_plant(
        [roll, pitch, heading] in prop::array::uniform3(-0.8..0.8_f64), rates in prop::array::uniform3(-2.0..2.0_f64),
        slower in prop::array::uniform3(-0.1..0.1_f64), w_mps in -0.5..0.5_f64, tilt_reaction in prop::bool::ANY,
    ) {
        let mut scenario = Scenario::from(Profile::Paper);
        (scenario.attitude.law, scenario.attitude.geometric) = (Law::Geometric, GAINS);
        (scenario.plant.tilt_reaction, scenario.mixer.tilt_reaction) = (tilt_reaction, tilt_reaction);
        let trim = Trim::solve(&scenario.airframe, tilt_reaction);
        let stamp = Stamp { tick: 0, sequence: 1, ..Stamp::default() };
        let attitude_rad = [trim.roll_rad + roll, pitch, heading];
        let measured = Kinematics { attitude_rad, rates_radps: rates, ..Kinematics::default() };
        let state = State { stamp, measured, command_in_force: trim.actuation.into(), ..State::default() };
        let wanted = [0, 1, 2].map(|i| rates[i] + slower[i]);
        let reference = Reference { stamp, w_mps, attitude_rad, rates_radps: wanted, ..Reference::default() };
        let demand = AttitudeMpc::new(&scenario).step(0, &state, &reference).demand;

        let mixing = MixingMatrix::new(&scenario.airframe, tilt_reaction);
        let square = |i: usize| mixing.trim[i] + (0..4).map(|j| mixing.inverse[(i, j)] * demand[j]).sum::<f64>();
        prop_assume!(square(2) > 0.0 && square(3) > 0.0);
        let actuation = Actuation {
            rotor_speed: [square(0).hypot(square(1)).sqrt(), square(2).sqrt(), square(3).sqrt()],
            tilt_rad: square(0).atan2(square(1)),
        };
        let x = assemble(&measured, &actuation);
        let rate = Dynamics::new(&scenario).derivative(&x, &actuation, &Condition::default(), &Surroundings::default());
        for i in 0..3 {
            let miss = rate[10 + i] - GAINS.kd[i] * slower[i];
            prop_assert!(miss.abs() < 1e-9, "about axis {i}: {miss:e} rad/s2");
        }
        let ((sin_phi, cos_phi), (sin_theta, cos_theta)) = (attitude_rad[0].sin_cos(), pitch.sin_cos());
        let down = -sin_theta * rate[3] + cos_theta * (sin_phi * rate[4] + cos_phi * rate[5]);
        let miss = down - GAINS.kp[0] * cos_phi * cos_theta * w_mps;
        prop_assert!(miss.abs() < 1e-9, "down: {miss:e} m/s2");
    }
}

#[test]
fn a_second_implementation_of_indi_demands_the_same() {
    let Some(python) = python_with(&["numpy"]) else { return };
    let settings = [
        "run.duration_s=4.0",
        "attitude.law=indi",
        "attitude.actuator_lag_model_s=0.03",
        "attitude.delay_compensation=false",
        "mission.trajectory=hover",
        "initial.attitude_deg=[20.0, -25.0, 40.0]",
        "plant.airframe.mass_kg=1.15",
        "plant.noise.rates_dps=1.0",
        "bounds.max_position_error_m=5.0",
    ];
    let settings = settings.into_iter().flat_map(|setting| ["--set", setting]);
    let outcome = fly(&["--mode", "inprocess"].into_iter().chain(settings).collect::<Vec<_>>());
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let run = outcome.out.display().to_string();
    let exported = launcher().args(["export", &run, "--to", "csv"]).output().expect("the launcher starts");
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    let second = Command::new(python).arg(top().join("tests/python/indi.py")).arg(format!("{run}/csv")).output();
    let second = second.expect("python starts");
    let [told, failed] = [&second.stdout, &second.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    let shares: Vec<f64> = told.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    assert!(shares.len() == 2 && shares.iter().all(|share| *share < 1e-9), "{told}{failed}");
}

#[test]
fn sensed_actuators_need_no_model_of_their_lag() {
    let settings = [
        "run.duration_s=8.0",
        "attitude.law=indi",
        "mission.trajectory=hover",
        "initial.attitude_deg=[20.0, -25.0, 40.0]",
        "run.command_delay_ms=10.0",
        "plant.rotor_lag_s=0.12",
        "plant.servo_lag_s=0.12",
        "bounds.max_position_error_m=inf",
        "bounds.final_position_error_m=0.1",
    ];
    let code = |origin: &str| {
        let origin = format!("attitude.indi.actuators={origin}");
        let set = settings.into_iter().chain([origin.as_str()]).flat_map(|setting| ["--set", setting]);
        fly(&["--mode", "inprocess", "--no-log"].into_iter().chain(set).collect::<Vec<_>>()).code()
    };
    assert_eq!([code("sensed"), code("modelled")], [Some(0), Some(1)]);
}

/// Every law must have the settings that docs/front.py searches for it, and the script's four commands must accept each
/// other's results.
#[test]
fn the_search_of_the_fronts_flies_every_law() {
    let script = std::fs::read_to_string(top().join("docs/front.py")).expect("a script");
    let packages = script.split_once("front/bin/pip install ").and_then(|(_, rest)| rest.lines().next());
    let packages: Vec<&str> = packages.expect("the packages that it needs").split(' ').collect();
    let Some(python) = python_with(&packages) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let front = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.arg(top().join("docs/front.py")).args(arguments).current_dir(folder.path());
        let output = command.env("TREFOIL", launcher().get_program()).output().expect("python runs");
        let [told, failed] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        assert!(output.status.success(), "{arguments:?}: {told}{failed}");
        told
    };
    let laws = ["mpc", "lqr", "pid", "geometric", "indi", "lqr1"];
    for law in laws {
        let told = front(&["search", law, "1", "2"]);
        assert!(told.starts_with(&format!("{law} 1 2 tries, ")), "{told}");
    }
    front(&["judge", "41"]);
    let told = front(&["report", "41", "83"]);
    let (volumes, tunings) = told.split_once("differences of the means").expect("two tables");
    let tunings = tunings.split_once("lost of 60\n").expect("the last table").1;
    let row = |table: &str, name: &str| -> Vec<String> {
        let row = table.lines().find(|line| line.split(' ').next() == Some(name));
        row.unwrap_or_else(|| panic!("{name} has no row: {told}")).split_whitespace().map(str::to_owned).collect()
    };
    for law in laws {
        let volume: f64 = row(volumes, law)[1].parse().expect("a number");
        // `lqr1` knows no delay, so a tuning of it may have no margin.
        assert!(volume < 1.0 && (volume > 0.0 || law == "lqr1"), "{told}");
        let error_m: f64 = row(tunings, &format!("{law}-1*"))[1].parse().expect("a number");
        // The starting tunings fly the legs within 5 cm.
        assert!((0.003..0.05).contains(&error_m), "{told}");
    }
    let printed = front(&["laws", "41"]);
    let printed: toml::Table = printed.parse().expect("TOML");
    let controllers = printed["controller"].as_table().expect("a table");
    assert!(controllers.keys().map(String::as_str).eq(["geometric", "indi", "lqr", "lqr1", "mpc", "pid"]), "{printed}");
}
