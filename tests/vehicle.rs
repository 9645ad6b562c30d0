//! Flights with ground, turbulence, sensors, another airframe, and an airframe that differs from the controllers' model
//! of it.

use serde_json::Value;

use crate::harness::{Outcome, fly, top};

/// Flies a shipped scenario in process with these settings.
fn flown(scenario: &str, settings: &[&str]) -> Outcome {
    let file = format!("scenarios/{scenario}.toml");
    let mut arguments = vec![file.as_str(), "--mode", "inprocess", "--no-log"];
    for setting in settings {
        arguments.extend(["--set", setting]);
    }
    fly(&arguments)
}

#[test]
fn a_mission_may_start_and_end_on_the_ground() {
    let outcome = flown("take-off-and-land", &[]);
    assert_eq!((outcome.code(), &outcome.run()["ground"]), (Some(0), &"landed".into()), "{}", outcome.stderr);
    assert!(outcome.run()["ended"].as_str().expect("words").ends_with("and landed"));
    let run = outcome.run();
    let phases: Vec<&str> =
        run["phases"].as_array().expect("a list").iter().filter_map(|one| one["phase"].as_str()).collect();
    assert_eq!(phases, ["standing", "taking off", "in flight", "landing", "standing"]);
    assert!(outcome.metric("rotor_speed_min") < 1.0, "it disarmed");
}

/// Wind that pushes with a fifth of the friction of the feet.
const BREEZE: [&str; 2] = ["plant.wind_ned_mps=[[0, [4, 3, 0]]]", "plant.drag_quadratic_ns2pm2=0.04"];

#[test]
fn how_long_a_landed_vehicle_is_recorded_changes_neither_its_place_nor_its_figures() {
    let [short, long] = ["70", "300"].map(|duration_s| {
        let duration = format!("run.duration_s={duration_s}");
        flown("take-off-and-land", &[&BREEZE[..], &[&duration]].concat())
    });
    for outcome in [&short, &long] {
        assert_eq!((outcome.code(), &outcome.run()["ground"]), (Some(0), &"landed".into()), "{}", outcome.stderr);
        assert_eq!(outcome.run()["solver"]["no_reference"], 0, "a parked vehicle needs none");
    }
    let [short, long] = [short, long].map(|outcome| outcome.run()["metrics"].clone());
    let parked_s = long["on_ground_s"].as_f64().unwrap() - short["on_ground_s"].as_f64().unwrap();
    assert!((parked_s - 230.0).abs() < 1e-6, "{parked_s}");
    let apart = |mut metrics: serde_json::Value| {
        (metrics["on_ground_s"], metrics["rotor_speed_min"]) = (0.into(), 0.into()); // they cover the ground too
        metrics
    };
    assert_eq!(apart(short), apart(long));
}

#[test]
fn a_long_wait_for_the_take_off_ends_as_a_short_one() {
    let waits = |wait_s: f64| {
        let square = "{kind='waypoints', curve='min-jerk', times_s=[10, 20, 30, 40, 50, 62], points_m=[[0, 0, -8], \
                      [8, 0, -8], [8, 8, -8], [0, 8, -8], [0, 0, -8], [0, 0, 0.2]]}";
        let parts = format!("mission.part=[{{kind='loiter', duration_s={wait_s}}}, {square}]");
        flown("take-off-and-land", &[&BREEZE[..], &[&parts, &format!("run.duration_s={}", wait_s + 68.0)]].concat())
    };
    let [short, long] = [1.0, 600.0].map(waits);
    for metric in ["max_position_error_m", "rms_position_error_m", "touchdown_sink_mps", "demand_effort"] {
        let [short, long] = [&short, &long].map(|outcome| outcome.metric(metric));
        assert!((long / short - 1.0).abs() < 1e-6, "{metric}: {short} and {long}");
    }
    let calm = flown("take-off-and-land", &[]);
    assert!(calm.metric("max_position_error_m") < 0.3, "it was 0.54 m, by sliding to hover trim on its feet");
}

#[test]
fn a_fall_is_a_crash_and_ends_the_flight() {
    let outcome = flown(
        "take-off-and-land",
        &["plant.rotor_effectiveness=[0.2, 0.2, 0.2]", "initial.standing=false", "initial.position_m=[0, 0, -8]"],
    );
    let run = outcome.run();
    assert_eq!((outcome.code(), &run["ground"]), (Some(1), &"crashed".into()), "{}", run["ended"]);
    assert!(run["flown_s"].as_f64().expect("a time") < 10.0);
}

#[test]
fn a_descent_without_references_ends_in_a_landing() {
    let fault = "fault=[{at_s=20, target=\"guidance\", kind=\"kill\", for_s=60}]";
    let outcome = flown("take-off-and-land", &[fault]);
    assert_eq!(outcome.run()["ground"], "landed", "{}", outcome.run()["ended"]);
}

/// A hover 5 m above ground whose attitude-mpc is killed for good: the mixer brings the vehicle down.
const BROUGHT_DOWN: [&str; 6] = [
    "initial.standing=false",
    "mission.trajectory=\"hover\"",
    "run.duration_s=20",
    "plant.ground.down_m=5",
    "fault=[{at_s=0.5, target=\"attitude-mpc\", kind=\"kill\", for_s=60}]",
    "bounds={max_position_error_m=inf, max_fallback_s=inf}",
];

#[test]
fn a_vehicle_brought_down_by_the_mixer_stops_where_it_touched_down_and_disarms() {
    let outcome = flown("take-off-and-land", &BROUGHT_DOWN);
    let run = outcome.run();
    assert_eq!((outcome.code(), &run["ground"]), (Some(0), &"landed".into()), "{}", run["ended"]);
    assert!(outcome.metric("max_position_error_m") < 7.0, "it was 78 m, with the rotors at flying speed");
    assert!(outcome.metric("rotor_speed_min") < 1.0);
}

#[test]
fn a_slide_is_no_landing() {
    let on_ice = [&BROUGHT_DOWN[..], &["plant.ground.friction=0.001"]].concat();
    let outcome = flown("take-off-and-land", &on_ice);
    let run = outcome.run();
    assert_eq!((outcome.code(), &run["ground"]), (Some(1), &"slid".into()), "{}", run["ended"]);
    assert!(run["reservations"][0].as_str().expect("words").contains("slid"), "{}", run["reservations"]);
}

#[test]
fn a_flight_that_ends_before_the_rest_has_not_landed() {
    let outcome = flown("take-off-and-land", &["run.duration_s=1"]);
    assert_eq!((outcome.code(), &outcome.run()["ground"]), (Some(0), &"on the ground, not landed".into()));
}

#[test]
fn a_vehicle_that_trips_over_its_feet_tips_over() {
    let trip = [
        "plant.disturbance=[[0.5, [0, 6, 0], [0, 0, 0]]]",
        "plant.ground={friction=10.0, leg_m=0.6, down_m=0.6, present=true}",
        "plant.rotor_effectiveness=[0, 0, 0]",
    ];
    let outcome = flown("take-off-and-land", &trip);
    let run = outcome.run();
    assert_eq!((outcome.code(), &run["ground"]), (Some(1), &"tipped over".into()), "{}", run["ended"]);
}

#[test]
fn a_vehicle_that_is_unlike_its_model_flies() {
    let outcome = flown("mismatch", &[]);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.run()["ended"]);
    let nominal = flown("mismatch", &["attitude.disturbance_gain=0", "guidance.disturbance_observer_radps=0"]);
    let error = |outcome: &Outcome| outcome.metric("rms_position_error_m");
    assert!(error(&outcome) < 0.5 * error(&nominal), "the estimates earn their place");
}

#[test]
fn a_heavier_vehicle_flies_worse_and_not_better() {
    let error = |kg: f64| flown("survey", &[&format!("plant.airframe.mass_kg={kg}")]).metric("rms_position_error_m");
    let [nominal, heavy, heavier] = [1.1, 1.2, 1.3].map(error);
    assert!(nominal < heavy && heavy < heavier, "{nominal} {heavy} {heavier}");
}

#[test]
fn another_airframe_flies_with_its_own_trim_and_weights() {
    let with_loops = |scenario: &str| fly(&[&format!("scenarios/{scenario}.toml"), "--mode", "inprocess"]);
    let outcome = with_loops("second-airframe");
    assert_eq!(outcome.code(), Some(0), "{}", outcome.run()["ended"]);
    let bandwidths = |run: &Value| {
        let loops = &run["hover"]["loops"];
        let of = |which: &str| loops[which].as_object().expect("bandwidths").values().filter_map(Value::as_f64);
        of("attitude").chain(of("position")).collect::<Vec<_>>()
    };
    let [own, paper] = [outcome.run(), with_loops("survey").run()].map(|run| bandwidths(&run));
    assert_eq!([own.len(), paper.len()], [7; 2]);
    let are_alike = own.iter().zip(&paper).all(|(own, paper)| (own / paper - 1.0).abs() < 0.05);
    assert!(are_alike, "the same closed loop: {own:?} and {paper:?} rad/s");
    let own = outcome.metric("max_position_error_m");
    let copied = flown("second-airframe", &["attitude.mpc.r=[0.3, 70.0, 20.0, 1200.0]"]);
    assert!(copied.metric("commands_saturated") + copied.metric("max_position_error_m") >= own);
}

#[test]
fn turbulence_and_sensors_that_can_be_bought_are_borne() {
    for scenario in ["dryden", "typical-sensors", "fast-legs"] {
        let outcome = flown(scenario, &[]);
        assert_eq!(outcome.code(), Some(0), "{scenario}: {}", outcome.run()["ended"]);
    }
    let calm = flown("dryden", &["plant.turbulence.wind_at_6m_mps=0"]).metric("rms_position_error_m");
    assert!(flown("dryden", &[]).metric("rms_position_error_m") > 1.2 * calm);
}

#[test]
fn features_fly_with_typical_sensors_within_60_cm() {
    for scenario in ["fast-legs", "dryden", "wind", "mismatch", "weak-rotor"] {
        let outcome = flown(scenario, &["plant.sensors.preset=typical", "bounds.max_position_error_m=0.6"]);
        assert_eq!(outcome.code(), Some(0), "{scenario}: {}", outcome.run()["ended"]);
    }
}

#[test]
fn a_landing_by_a_height_that_is_wrong_ends_on_the_ground() {
    for (scenario, seed) in [("missions/inspection", 3), ("missions/inspection", 8), ("take-off-and-land", 5)] {
        let seed = format!("run.seed={seed}");
        let outcome = flown(scenario, &["plant.sensors.preset=typical", "bounds.max_position_error_m=inf", &seed]);
        let run = outcome.run();
        assert_eq!(
            (outcome.code(), &run["ground"]),
            (Some(0), &"landed".into()),
            "{scenario} {seed}: {}",
            run["ended"]
        );
    }
}

#[test]
fn ten_seconds_without_a_receiver_are_borne_in_gusts() {
    let lost = "fault=[{at_s=20, for_s=10, target='position', kind='off'}, {at_s=20, for_s=10, target='velocity', \
                kind='off'}]";
    let of_seed = |seed: u32| {
        let seed = format!("run.seed={seed}");
        let outcome = flown(
            "dryden",
            &["plant.sensors.preset=typical", "bounds.max_position_error_m=5", "run.duration_s=50", &seed, lost],
        );
        assert_eq!(outcome.code(), Some(0), "{seed}: {}", outcome.run()["ended"]);
        let back_m = outcome.metric("final_position_error_m");
        assert!(back_m < 0.8, "{seed}: {back_m} m, 20 s after the receiver is back");
        outcome.metric("max_position_error_m")
    };
    let mut most_m: Vec<f64> = (1..=5).map(of_seed).collect();
    most_m.sort_by(f64::total_cmp);
    assert!(most_m[2] < 2.5, "{most_m:?}");
}

#[test]
fn fast_legs_fly_inside_their_bound_by_models_over_the_velocity_alone() {
    let error =
        |model: &str| flown("fast-legs", &[&format!("attitude.mpc.model={model}")]).metric("max_position_error_m");
    let [hover, scheduled] = ["hover", "scheduled"].map(error);
    assert!(scheduled < 0.12 && hover > 1.5 * scheduled, "{hover} {scheduled}");
    let nominal =
        flown("fast-legs", &["attitude.mpc.model=hover", "attitude.disturbance_gain=0"]).metric("max_position_error_m");
    assert!(nominal < 0.12, "it is the estimate that hover's model misleads: {nominal}");
}

#[test]
fn a_vehicle_may_pitch_through_the_vertical() {
    // Pitching up from 80 degrees: Euler angles are singular at 90.
    let outcome = flown("tumble", &["initial.attitude_deg=[11.1, 80, 0]", "initial.rates_radps=[0, 6, 0]"]);
    assert_eq!(outcome.run()["diverged"], false, "{}", outcome.run()["ended"]);
    assert!(outcome.metric("final_position_error_m") < 0.1, "and it comes back");
}

/// A vehicle of 2.2 kg with larger propellers and a slow servo.
const OWN: [&str; 11] = [
    "airframe.mass_kg=2.2",
    "airframe.l1_m=0.3228",
    "airframe.l2_m=0.1613",
    "airframe.l3_m=0.2795",
    "airframe.ixx_kgm2=0.055",
    "airframe.iyy_kgm2=0.060",
    "airframe.izz_kgm2=0.105",
    "airframe.kf=1.5e-5",
    "airframe.km=2.4e-7",
    "plant.servo_lag_s=0.08",
    "plant.servo_rate_limit_radps=5",
];

#[test]
fn an_own_vehicle_flies_as_well_as_that_of_table_i_without_weights_of_its_own() {
    for setting in ["run.command_delay_ms=0", "run.command_delay_ms=20", "run.rate_hz=200"] {
        let outcome = flown("survey", &[&OWN[..], &[setting]].concat());
        assert_eq!(outcome.code(), Some(0), "{setting}: {}", outcome.stderr);
        assert!(!outcome.stderr.contains("warning"), "{}", outcome.stderr);
    }
    let others = ["attitude.mpc.r=[0.3, 70.0, 20.0, 1200.0]", "run.command_delay_ms=20"];
    let own = flown("survey", &[&OWN[..], &others[1..]].concat());
    let outcome = flown("survey", &[&OWN[..], &others].concat());
    let [own, of_others] = [&own, &outcome].map(|outcome| outcome.metric("max_position_error_m"));
    assert!(of_others > 2.0 * own, "the weights of Table I: {of_others} m, its own {own} m");
    assert!(
        outcome.stderr.contains("`attitude.mpc.r`") && outcome.stderr.contains("[0.075, 3.14, 3.78, 17.6]"),
        "{}",
        outcome.stderr
    );
}

/// Flies a scenario with this text in process; returns exit code and state hash, which is empty after a refusal.
fn written(text: &str) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("own.toml");
    std::fs::write(&file, text).expect("the file is written");
    let outcome = fly(&[file.to_str().expect("UTF-8"), "--mode", "inprocess", "--no-log"]);
    let hash = if outcome.code() == Some(2) { String::new() } else { outcome.state_hash() };
    (outcome.code(), hash)
}

/// Asserts that the shipped scenario `name` without any one of its lines gives another flight, or is refused.
fn every_line_counts(name: &str) {
    let file = top().join("scenarios").join(name).with_extension("toml");
    let text = std::fs::read_to_string(file).expect("a shipped scenario");
    let (settings, bounds) = text.split_once("\n[bounds]").expect("they come last");
    let whole = written(&text);
    assert_eq!(whole.0, Some(0), "{name}");
    let lines: Vec<&str> = settings.lines().collect();
    let counts = |line: &&str| line.contains(" = ") && !["#", "name = "].iter().any(|word| line.starts_with(word));
    for line in lines.iter().copied().filter(counts) {
        let others: Vec<&str> = lines.iter().copied().filter(|other| !std::ptr::eq(*other, line)).collect();
        let without = written(&format!("{}\n[bounds]{bounds}", others.join("\n")));
        assert_ne!(without, whole, "{name} without `{line}`");
    }
}

#[test]
fn every_line_of_own_vehicle_changes_the_flight_or_is_missed() {
    every_line_counts("own-vehicle");
}

#[test]
fn every_line_of_own_sensors_changes_the_flight_or_is_missed() {
    every_line_counts("own-sensors");
}

#[test]
fn every_line_of_own_limits_changes_the_flight_or_is_missed() {
    every_line_counts("own-limits");
}

#[test]
fn every_line_of_own_swaps_changes_the_flight_or_is_missed() {
    every_line_counts("own-swaps");
}
