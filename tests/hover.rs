//! Hover, bandwidths and margins of a scenario: checked against flights, each other and their output.

use std::path::Path;

use contract::message::Truth;
use flight::guarded;
use flight::hover::{Hover, Loops};
use flight::log::Record;
use settings::{Initial, Scenario, load};

use crate::harness::{fly, launcher, top};

/// Duration of a flight that starts beside the hover \[s\].
const FLIGHT_S: f64 = 60.0;
/// Largest difference between a computed margin and the margin of flights \[ms\].
const GRID_MS: f64 = 10.0;
/// Settings with fixed gains, so that their margins stay when the default profile is tuned anew.
const PID: [&str; 4] =
    ["profile=paper", "attitude.law=pid", "attitude.pid.kp=[4, 48, 48, 48]", "attitude.pid.kd=[12, 12, 12]"];

fn scenario(settings: &[&str]) -> Scenario {
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    load(None, &settings).expect("a scenario")
}

fn loops(settings: &[&str]) -> Loops {
    Hover::of(&scenario(settings)).loops.expect("the launcher's own nodes")
}

/// Flies a hover from 2 cm and 1 degree beside it; returns whether the vehicle is back at the end.
fn is_held(settings: &[&str], changed: &str) -> bool {
    let duration = format!("run.duration_s={FLIGHT_S}");
    let own = ["mission.trajectory=hover", &duration, changed];
    let mut scenario = scenario(&[settings, &own].concat());
    scenario.initial = Initial { position_m: [0.02; 3], attitude_deg: [1.0; 3], ..Initial::default() };
    let mut end = Truth::default();
    let watch = |record: &Record| {
        record.message::<Truth>().inspect(|truth| end = **truth);
        true
    };
    guarded::fly(&scenario, true, watch, |_| {}).expect("it is flown");
    let is_near = |of: [f64; 3], within: f64| of.iter().all(|x| x.abs() < within);
    is_near(end.actual.position_m, 0.02) && is_near(end.actual.rates_radps, 0.01)
}

#[test]
fn margins_lie_between_a_flight_that_is_held_and_one_that_is_lost() {
    for settings in [&["profile=paper"][..], &PID] {
        let loops = loops(settings);
        let [delay, lag] = [loops.delay_margin, loops.lag_margin].map(|margin| margin.expect("stable as set"));
        assert!(!delay.or_more && !lag.or_more, "{loops:?}");
        let with_delay = |ms: f64| is_held(settings, &format!("run.command_delay_ms={ms:.1}"));
        let with_lag = |ms: f64| is_held(settings, &format!("plant.rotor_lag_s={:.4}", ms * 1e-3));
        let below = |ms: f64| (ms - GRID_MS).max(ms * 0.8);
        assert!(with_delay(below(delay.ms)) && !with_delay(delay.ms + GRID_MS), "{settings:?}: {delay:?}");
        assert!(with_lag(below(lag.ms)) && !with_lag(lag.ms + GRID_MS), "{settings:?}: {lag:?}");
    }
}

#[test]
fn the_papers_loop_loses_its_stability_between_5_and_6_ms_of_delay() {
    let delay = loops(&["profile=paper"]).delay_margin.expect("stable as set");
    assert_eq!((delay.ms, delay.or_more), (5.0, false));
    let held = |ms: f64| is_held(&["profile=paper"], &format!("run.command_delay_ms={ms:.1}"));
    assert!(held(5.0) && !held(6.0));
    let with_3_ms = loops(&["profile=paper", "run.command_delay_ms=3.0"]).delay_margin.expect("stable as set");
    assert_eq!(with_3_ms.ms, 5.0, "the delay of the scenario is part of the margin");
}

#[test]
fn a_compensated_delay_has_more_than_the_margin_of_one_that_is_not() {
    let margin = |set: &[&str]| loops(&[&PID[..], set].concat()).delay_margin.expect("stable as set");
    let [plain, measured] = [
        &["attitude.actuator_lag_model_s=0.03"][..],
        &["attitude.actuator_lag_model_s=0.03", "attitude.delay_compensation=measured"],
    ]
    .map(margin);
    assert!(measured.ms > plain.ms, "{plain:?} {measured:?}");
}

#[test]
fn a_law_of_higher_gain_has_the_larger_bandwidth() {
    let of = |gains: &[&str]| {
        let loops = loops(&[&["profile=paper", "attitude.law=pid"][..], gains].concat());
        let (attitude, position) = (loops.attitude.expect("stable"), loops.position.expect("stable"));
        [attitude.w_radps, attitude.phi_radps, attitude.theta_radps, attitude.psi_radps, position.down_radps]
            .map(|radps| radps.expect("a bandwidth"))
    };
    let slow = of(&["attitude.pid.kp=[2, 24, 24, 24]", "attitude.pid.ki=[1, 20, 20, 20]", "attitude.pid.kd=[9, 9, 9]"]);
    let fast =
        of(&["attitude.pid.kp=[4, 48, 48, 48]", "attitude.pid.ki=[4, 64, 64, 64]", "attitude.pid.kd=[12, 12, 12]"]);
    assert!(slow.iter().zip(fast).all(|(slow, fast)| *slow < fast), "{slow:?} {fast:?}");
}

#[test]
fn twice_the_thrust_is_twice_the_thrust_over_weight() {
    let ratio = |set: &[&str]| Hover::of(&scenario(set)).thrust_over_weight;
    let own = ratio(&["profile=paper"]);
    assert!((own - 4.0).abs() < 1e-9, "the speeds of profile paper go to twice those of the hover: {own}");
    let known = Scenario::default().airframe;
    let [kf, km] = [known.kf, known.km].map(|of| 2.0 * of);
    let (kf, km) = (format!("plant.airframe.kf={kf:e}"), format!("plant.airframe.km={km:e}"));
    assert!((ratio(&["profile=paper", &kf, &km]) / own - 2.0).abs() < 1e-9);
    let heavy = format!("plant.airframe.mass_kg={}", 2.0 * known.mass_kg);
    assert!((ratio(&["profile=paper", &heavy]) / own - 0.5).abs() < 1e-9);
}

#[test]
fn an_unstable_loop_is_said_to_be_so_and_has_no_number() {
    let settings = ["profile=paper", "run.command_delay_ms=20.0"];
    let hover = Hover::of(&scenario(&settings));
    let none = Loops { attitude: None, position: None, delay_margin: None, lag_margin: None };
    assert_eq!(hover.loops, Some(none));
    let rows = hover.rows();
    assert_eq!(rows.iter().filter(|(_, value)| value == "unstable").count(), 4, "{rows:?}");
    let check = launcher().args(["check", "survey", "--set", settings[0], "--set", settings[1]]).output();
    let said = String::from_utf8(check.expect("the launcher runs").stderr).expect("text");
    assert!(said.trim_end().ends_with("survey: valid, but its control loops are unstable about the hover"), "{said}");
}

#[test]
fn a_vehicle_that_the_controllers_do_not_know_is_no_unstable_one() {
    let own = loops(&PID).delay_margin.expect("stable as set");
    for set in ["plant.airframe.mass_kg=1.4", "plant.rotor_effectiveness=[0.9, 1.0, 1.0]"] {
        let loops = loops(&[&PID[..], &[set]].concat());
        let delay = loops.delay_margin.unwrap_or_else(|| panic!("{set}: {loops:?}"));
        assert!(loops.attitude.is_some() && (delay.ms - own.ms).abs() < 0.3 * own.ms, "{set}: {own:?} {loops:?}");
    }
    for set in ["plant.airframe.mass_kg=1.3", "plant.tilt_reaction=true"] {
        let loops = loops(&["profile=robust", set]);
        assert!(loops.attitude.is_some() && loops.position.is_some(), "{set}: {loops:?}");
    }
}

/// Returns the standard output of `trefoil check` with `arguments`.
fn checked(arguments: &[&str]) -> String {
    let output = launcher().arg("check").args(arguments).output().expect("the launcher runs");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[test]
fn check_run_and_report_tell_the_same_and_the_output_of_check_is_a_scenario() {
    let settings = [&PID[..], &["run.duration_s=1.0", "run.mode=inprocess"]].concat();
    let arguments: Vec<&str> =
        std::iter::once("survey").chain(settings.iter().flat_map(|set| ["--set", set])).collect();
    let survey = top().join("scenarios/survey.toml");
    let owned: Vec<String> = settings.iter().map(|&set| set.to_owned()).collect();
    let hover = Hover::of(&load(Some(&survey), &owned).expect("a scenario"));
    let text = checked(&arguments);
    for (name, value) in hover.rows() {
        assert!(text.contains(&format!("\n# {name}: {value}\n")), "{name}: {value}: {text}");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("again.toml");
    std::fs::write(&file, &text).expect("can be written");
    assert_eq!(checked(&[file.to_str().expect("a plain path")]), text);

    let flown = fly(&arguments);
    let in_run: Hover = serde_json::from_value(flown.run()["hover"].clone()).expect("a hover");
    assert_eq!(in_run, hover);
    let report = std::fs::read_to_string(flown.out.join("report.html")).expect("a report");
    assert!(hover.rows().iter().all(|(name, value)| report.contains(name) && report.contains(value)));
}

#[test]
fn loops_around_a_program_of_the_user_are_not_computed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let script = folder.path().join("law.py");
    std::fs::write(&script, "").expect("can be written");
    let program = |path: &Path| format!("node.attitude-mpc={{ exec='python3', args=['{}'] }}", path.display());
    let text = checked(&["survey", "--set", "run.mode=lockstep", "--set", &program(&script)]);
    assert!(
        text.contains("\n# delay margin: not computed: a node is not the launcher's own (`node.*.exec`)\n"),
        "{text}"
    );
    assert!(text.contains("\n# largest thrust over weight: "), "{text}");
}
