//! Precedence, round trips, and one case per way to get a scenario wrong.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;

use crate::*;

const REPOSITORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

#[test]
fn set_wins_over_file_over_profile() {
    let (_folder, path) = file(b"[plant]\nrotor_lag_s = 0.04\nservo_lag_s = 0.05\n[run]\nseed = 7\n");
    let overrides = ["plant.servo_lag_s=0.06", "run.seed=8", "run.seed=9"].map(String::from);
    let scenario = load(Some(&path), &overrides).unwrap();
    assert_eq!((scenario.plant.rotor_lag_s, scenario.plant.servo_lag_s, scenario.run.seed), (0.04, 0.06, 9));
    let rest = PlantSettings { rotor_lag_s: 0.03, servo_lag_s: 0.03, ..scenario.plant };
    assert_eq!(rest, Scenario::default().plant, "what is not set keeps its default");
}

#[test]
fn a_profile_by_set_changes_the_defaults_underneath() {
    let (_folder, path) = file(b"profile = \"robust\"\n[attitude]\ndisturbance_gain = 0.2\n");
    let scenario = load(Some(&path), &["profile=paper".into()]).unwrap();
    let paper = Scenario::from(Profile::Paper);
    let attitude = Attitude { disturbance_gain: 0.2, ..paper.attitude.clone() };
    assert_eq!(scenario, Scenario { attitude, ..paper });
}

#[test]
fn set_takes_toml_and_bare_words() {
    let scenario = from_set(&[
        "name=wind step",
        "run.mode=lockstep",
        "mission.ramp_s=min-jerk",
        "mission.trajectory = \"survey\"",
        "plant.noise={position_m=1e-3}",
        "plant.wind_ned_mps=[[15, [5, 0, 0]]]",
        "plant.drag_linear_nspm=[0.2, 0.2, 0.1]",
        "attitude.delay_compensation=false",
    ])
    .unwrap();
    assert_eq!((scenario.name.as_str(), scenario.run.mode), ("wind step", Mode::Lockstep));
    let mission = (scenario.mission.ramp_s, scenario.mission.trajectory);
    assert_eq!(mission, (Ramp::Named(RampName::MinJerk), TrajectoryKind::Survey));
    assert_eq!(scenario.plant.noise, Noise { position_m: 1e-3, ..Noise::default() });
    assert_eq!(scenario.plant.wind_ned_mps, [(15.0, [5.0, 0.0, 0.0])]);
    assert_eq!(scenario.attitude.delay_compensation, DelayCompensation::Sample(false));
}

#[test]
fn arrays_replace_and_tables_merge() {
    let text = b"[attitude.mpc]\nq = [1, 1, 1, 1, 1, 1, 1]\n[plant.noise]\nposition_m = 0.01\n";
    let (_folder, path) = file(text);
    let overrides = ["attitude.mpc.q=[2, 2, 2, 2, 2, 2, 2]", "plant.noise.rates_dps=0.1"].map(String::from);
    let scenario = load(Some(&path), &overrides).unwrap();
    assert_eq!(scenario.attitude.mpc.q, [2.0; 7]);
    assert_eq!((scenario.plant.noise.position_m, scenario.plant.noise.rates_dps), (0.01, 0.1));
}

#[test]
fn errors_in_the_shape_name_the_key_and_the_fix() {
    let cases: [(&str, &[&str]); 19] = [
        ("duration_s=3", &["unknown key `duration_s`", "--set duration_s=3", "did you mean `run.duration_s`?"]),
        ("plant.mass_kg=1.2", &["unknown key `plant.mass_kg`", "did you mean `plant.airframe.mass_kg`?"]),
        ("mpc={qq=1, law=\"pid\"}", &["unknown key `mpc.qq`", "`attitude.mpc.q`?", "`mpc.law` is `attitude.law` now"]),
        ("realtime.mixer.priority=9", &["`realtime.mixer.priority` is `node.mixer.priority` now", "docs/names.md"]),
        ("plant.rotor_lag=3", &["unknown key `plant.rotor_lag`", "did you mean `plant.rotor_lag_s`?", "substep_s"]),
        ("bounds.x=3", &["unknown key `bounds.x`", "known in `bounds`: final_position_error_m, max_alt"]),
        ("plant.rotor_lag_s=slow", &["`plant.rotor_lag_s`", "string \"slow\", expected a number", "= 0.03"]),
        ("run.seed=-1", &["`run.seed`", "integer `-1`, expected a whole number"]),
        ("attitude.mpc.max_iterations=2.5", &["`attitude.mpc.max_iterations`", "expected a whole number"]),
        ("run.mode=lockstpe", &["`run.mode`", "expected one of `realtime`, `lockstep`, `inprocess`"]),
        ("run.mode.x=1", &["`run.mode` is not a table", "run.mode = \"realtime\""]),
        ("run=3", &["`run` is a table", "duration_s, mode, rate_hz, seed"]),
        ("initial.position_m=[1, 2]", &["`initial.position_m`", "invalid length 2, expected an array of length 3"]),
        ("initial.position_m=[1, 2, 3, 4]", &["`initial.position_m`", "length 4, expected 3", "[0.0, 0.0, 0.0]"]),
        ("plant.wind_ned_mps=[[1, [2, 3, 4], 5]]", &["`plant.wind_ned_mps`", "invalid length 3, expected 2"]),
        ("mission.ramp_s=fast", &["`mission.ramp_s`", "expected seconds or \"min-jerk\""]),
        (
            "initial.position_m=[1, 2",
            &["not TOML: unclosed array", "--set initial.position_m=[1, 2", "write `--set key=value`"],
        ),
        ("run.seed", &["not TOML", "expected `=`", "write `--set key=value`"]),
        ("", &["nothing to set", "write `--set key=value`"]),
    ];
    for (set, expected) in cases {
        check_refused(set, expected);
    }
}

#[test]
fn the_mission_of_earlier_versions_is_refused_by_the_part_that_it_is_now() {
    let cases: [(&str, &[&str]); 8] = [
        ("mission.waypoints_m=[[0, 0, 0]]", &["there is no `mission.waypoints_m`", "kind = \"waypoints\"", "points_m"]),
        ("mission.times_s=[0, 10]", &["there is no `mission.times_s`", "since its beginning"]),
        ("mission.step_m=[1, 2, 3]", &["there is no `mission.step_m`", "\"loiter\"", "\"jump\" with point_m"]),
        ("mission.laps=2", &["there is no `mission.laps`", "\"circle\" with radius_m, period_s and laps"]),
        ("mission.trajectory=circle", &["there is no `mission.trajectory = \"circle\"`", "three parts"]),
        ("mission={trajectory='waypoints'}", &["there is no `mission.trajectory = \"waypoints\"`", "are a part"]),
        ("mission.ramp_s=spline", &["there is no `mission.ramp_s = \"spline\"`", "curve = \"spline\""]),
        ("mission.heading_deg=[[1, 90]]", &["a part has `heading_deg` = [[t_s, deg], ...]"]),
    ];
    for (set, expected) in cases {
        check_refused(set, expected);
    }
}

#[test]
fn parts_are_flown_unless_trajectory_is_set() {
    let parts = "mission.part=[{kind='takeoff', height_m=5}]";
    let scenario = from_set(&[parts]).unwrap();
    assert_eq!(scenario.mission.trajectory, TrajectoryKind::Parts);
    check_returns(&scenario);
    assert_eq!(from_set(&[parts, "mission.trajectory=hover"]).unwrap().mission.part, []);
    check_refused(
        "mission={trajectory='hover', part=[{kind='takeoff', height_m=5}]}",
        &["`mission.part` has no effect"],
    );
}

#[test]
fn the_message_points_into_the_file_and_lists_all_problems() {
    let text = "# gusty\n[plant]\ntilt_max_deg = 95\n[attitude.mpc]\nmax_iterations = 0\n";
    let message = from_merged(text, "gusty.toml").unwrap_err().to_string();
    let first = "error: `plant.tilt_max_deg` = 95.0 is out of range
 --> gusty.toml:3:16
  |
3 | tilt_max_deg = 95
  |                ^^
  |
  = help: allowed: above 0, at most 90";
    assert!(message.contains(first) && message.contains("gusty.toml:5:18"), "{message}");
}

#[test]
fn of_many_wrong_keys_only_the_first_are_listed() {
    let keys = (0..60_000).map(|i| format!("key_{i} = 1\n")).collect::<Vec<_>>().concat();
    let message = from_merged(&keys, "keys.toml").unwrap_err().to_string();
    assert_eq!(message.matches("error: unknown key").count(), 8, "{message}");
    assert!(message.ends_with("there is more: these are the first 8 problems"), "{message}");

    let (_folder, path) = file(keys.repeat(2).as_bytes());
    let message = load(Some(&path), &[]).unwrap_err().to_string();
    assert!(message.contains("and 1048576 are the most that is read"), "{message}");
    let faults = "{at_s=1, target=\"wind\", kind=\"step\"}, ".repeat(1001);
    assert!(from_set(&[&format!("fault=[{faults}]")]).unwrap_err().to_string().contains("1001 of `fault`"));
}

#[test]
fn unknown_words_get_the_nearest_known_one() {
    check_refused("fault=[{at_s=1, target=\"rotr2\", kind=\"off\"}]", &["did you mean `rotor2`?"]);
    check_refused("attitude.law=lqrr", &["did you mean `lqr`?"]);
    for kind in ["iteration cap", "iteration_cap"] {
        check_refused(
            &format!("fault=[{{at_s=1, target=\"mpc\", kind=\"{kind}\"}}]"),
            &["did you mean `iteration-cap`?"],
        );
    }
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let missing = load(Some(Path::new("no/such.toml")), &[]).unwrap_err().to_string();
    assert!(
        missing.contains("cannot read the scenario `no/such.toml`") && missing.contains("`trefoil scenarios`"),
        "{missing}"
    );

    let (folder, path) = file(b"name = \"a\"\n# caf\xe9\n");
    let folder = load(Some(folder.path()), &[]).unwrap_err().to_string();
    assert!(folder.contains("cannot read the scenario"), "{folder}");

    let latin1 = load(Some(&path), &[]).unwrap_err().to_string();
    assert!(latin1.contains("not UTF-8") && latin1.contains("scenario.toml:2:6"), "{latin1}");

    let twice = from_merged("[run]\nseed = 1\nseed = 2\n", "twice.toml").unwrap_err().to_string();
    assert!(twice.contains("not TOML: duplicate key") && twice.contains("twice.toml:3:1"), "{twice}");
}

#[test]
fn shipped_and_reference_scenarios_load_and_are_read_back_exactly() {
    let folders =
        [("scenarios", 6), ("scenarios/aggressive", 5), ("scenarios/missions", 2), ("tests/reference/cases", 9)];
    for (folder, at_least) in folders {
        let entries = fs::read_dir(Path::new(REPOSITORY).join(folder)).unwrap();
        let files: Vec<_> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
        assert!(files.len() >= at_least, "{folder}: only {} files", files.len());
        for file in files {
            check_returns(&load(Some(&file), &[]).unwrap_or_else(|error| panic!("{error}")));
        }
    }
    check_returns(&Scenario::from(Profile::Paper));
}

#[test]
fn the_shipped_survey_is_what_flies_without_a_file() {
    let survey = load(Some(&Path::new(REPOSITORY).join("scenarios/survey.toml")), &[]).unwrap();
    assert!(survey.bounds.max_position_error_m.is_some());
    assert_eq!(Scenario { bounds: Bounds::default(), ..survey }, load(None, &[]).unwrap());
    assert_eq!(load(None, &[]).unwrap(), Scenario::default());
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in "(?s).*") {
        let _ = from_merged(&text, "any.toml");
        let _ = from_set(&[&text]);
    }

    #[test]
    fn no_damaged_scenario_makes_the_reader_panic(
        at in any::<prop::sample::Index>(),
        length in 0..20_usize,
        damage in ".{0,9}|[\\[\\]{}=.\",0-9\n]{0,9}",
    ) {
        let mut text = to_toml(&Scenario::default());
        let start = at.index(text.len());
        let end = (start + length).min(text.len());
        text.replace_range(start..end, &damage);
        let _ = from_merged(&text, "damaged.toml");
    }

    #[test]
    fn any_numbers_are_read_back_exactly(
        gain in prop_oneof![prop::num::f64::SUBNORMAL, prop::num::f64::ZERO, -1e9..1e9],
        positive in prop::array::uniform4(1e-9..1e9),
        position_m in prop::array::uniform3(-200.0..200.0),
        wind in prop::array::uniform3(-20.0..20.0),
        seed in 0..=i64::MAX as u64,
        name in "\\PC*[a-z\"'\\\\]",
    ) {
        let mut scenario = Scenario { name, ..Scenario::default() };
        scenario.run.seed = seed;
        scenario.guidance.kp_phi = gain;
        scenario.mission.heading_deg = gain;
        scenario.attitude.mpc.r = positive;
        scenario.initial.position_m = position_m;
        scenario.plant.wind_ned_mps = vec![(1.0 / 3.0, wind)];
        scenario.plant.drag_quadratic_ns2pm2 = 0.02;
        scenario.bounds.final_position_error_m = Some(positive[0]);
        check_returns(&scenario);
    }
}

/// Checks that `to_toml` and back changes nothing. Printed floats differ if their bits do, the sign of zero included.
fn check_returns(scenario: &Scenario) {
    let text = to_toml(scenario);
    let returned = from_merged(&text, "merged.toml").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(&returned, scenario);
    assert_eq!(to_toml(&returned), text);
}

pub fn check_refused(set: &str, expected: &[&str]) {
    let message = from_set(&[set]).expect_err(set).to_string() + "\n";
    for part in expected {
        assert!(message.contains(part), "`{part}` is missing for `{set}` in:\n{message}");
    }
}

pub fn from_set(overrides: &[&str]) -> Result<Scenario, ScenarioError> {
    load(None, &overrides.iter().map(ToString::to_string).collect::<Vec<_>>())
}

fn file(content: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scenario.toml");
    fs::write(&path, content).unwrap();
    (folder, path)
}

#[test]
fn the_weights_of_the_inputs_follow_the_vehicle_unless_they_are_given() {
    let r = |settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(|&set| set.to_owned()).collect();
        load(None, &settings).unwrap().attitude.mpc.r
    };
    let default = r(&[]);
    assert_eq!(r(&["airframe.mass_kg=2.2"]), [default[0] / 4.0, default[1], default[2], default[3]]);
    assert_eq!(r(&["airframe.ixx_kgm2=0.01195"])[2], default[2] * 4.0, "half the inertia of Table I");
    assert_eq!(r(&["attitude.mpc.r=[1.0, 2.0, 3.0, 4.0]", "airframe.mass_kg=2.2"]), [1.0, 2.0, 3.0, 4.0]);
    let ten_inch = load(None, &["airframe.preset=ten-inch".into()]).unwrap();
    let heavier = format!("airframe.mass_kg={}", 2.0 * ten_inch.airframe.mass_kg);
    assert_eq!(r(&["airframe.preset=ten-inch", &heavier])[0], ten_inch.attitude.mpc.r[0] / 4.0);
    let drawn = Given::load(None, &[]).unwrap().scenario(&[("airframe.mass_kg".into(), 2.2.into())]).unwrap();
    assert_eq!(drawn.attitude.mpc.r[0], default[0] / 4.0, "a campaign's draw too");
}

/// Returns the horizons Np and Nu \[samples\] of a scenario with `settings` given by `--set`.
fn horizons(settings: &[&str]) -> [usize; 2] {
    let scenario = from_set(settings).unwrap_or_else(|error| panic!("{settings:?}: {error}"));
    [scenario.np(), scenario.nu()]
}

#[test]
fn a_horizon_has_the_same_length_at_every_rate() {
    for (rate, robust, paper, given) in [
        ("50", [10, 10], [5, 3], [15, 4]),
        ("100", [20, 20], [10, 5], [30, 7]),
        ("250", [50, 50], [25, 13], [75, 18]),
        ("500", [100, 100], [50, 25], [150, 35]),
        ("2000", [200, 200], [200, 100], [200, 140]),
    ] {
        let rate = format!("run.rate_hz={rate}");
        assert_eq!(horizons(&[&rate]), robust, "{rate}: at most 200 samples by default");
        let solved = horizons(&["attitude.mpc.constraints=cone", &rate]);
        assert_eq!(solved, [robust[0], robust[1].min(20)], "{rate}: at most 20 moves if they are solved for");
        assert_eq!(horizons(&["profile=paper", &rate]), paper, "{rate}");
        let horizon = if given[0] == 200 {
            "attitude.mpc.prediction_horizon_s=0.1"
        } else {
            "attitude.mpc.prediction_horizon_s=0.3"
        };
        assert_eq!(horizons(&[horizon, "attitude.mpc.control_horizon_s=0.07", &rate]), given, "{rate}");
    }
    let fast = from_set(&["run.rate_hz=2000"]).unwrap().attitude.mpc;
    assert_eq!([fast.prediction_horizon_s, fast.control_horizon_s], [0.1, 0.1], "what is flown is what is written");
}

#[test]
fn the_disturbance_estimate_is_as_fast_at_every_rate() {
    for (rate_hz, gain) in [(50, 0.04), (100, 0.02), (250, 0.008), (2000, 0.001)] {
        let rate = format!("run.rate_hz={rate_hz}");
        assert_eq!(from_set(&[&rate]).unwrap().attitude.disturbance_gain, gain, "{rate}: 2 per second");
        assert_eq!(from_set(&["profile=paper", &rate]).unwrap().attitude.disturbance_gain, 0.0, "{rate}");
        assert_eq!(
            from_set(&["attitude.disturbance_gain=0.1", &rate]).unwrap().attitude.disturbance_gain,
            0.1,
            "{rate}"
        );
    }
}

#[test]
fn a_law_by_its_name_alone_has_defaults_that_it_uses() {
    let all = from_set(&[]).unwrap();
    for (law, model, constraints, preview_s, gain) in [
        ("mpc", Model::Coupled, Constraints::None, 0.4, 0.02),
        ("lqr", Model::Coupled, Constraints::None, 0.0, 0.02),
        ("pid", Model::Hover, Constraints::None, 0.0, 0.02),
        ("geometric", Model::Hover, Constraints::None, 0.0, 0.02),
        ("indi", Model::Hover, Constraints::None, 0.0, 0.0),
    ] {
        let named = from_set(&[&format!("attitude.law={law}")]).unwrap_or_else(|error| panic!("{law}: {error}"));
        let Attitude { mpc, disturbance_gain, .. } = &named.attitude;
        let own = (mpc.model, mpc.constraints, named.guidance.preview_s, *disturbance_gain);
        assert_eq!(own, (model, constraints, preview_s, gain), "{law}");
        assert!(named.attitude.delay_compensation.is_measured(), "{law}");
        // With every setting written down, a default that the law does not use would be refused.
        let written = to_toml(&named);
        assert_eq!(from_merged(&written, "written").unwrap_or_else(|error| panic!("{law}: {error}")), named);
        // Settings that do not depend on the law are unchanged.
        let MpcSettings { model, constraints, .. } = all.attitude.mpc;
        let others = Attitude {
            law: all.attitude.law,
            disturbance_gain: all.attitude.disturbance_gain,
            mpc: MpcSettings { model, constraints, ..named.attitude.mpc },
            ..named.attitude
        };
        assert_eq!(others, all.attitude, "{law}");
    }
}

#[test]
fn a_model_or_a_gain_alone_has_defaults_that_go_with_it() {
    let attitude = |set: &str| from_set(&[set]).unwrap_or_else(|error| panic!("{error}")).attitude;
    let scheduled = attitude("attitude.mpc.model=scheduled");
    assert_eq!(scheduled.mpc.model, Model::Scheduled);
    assert_eq!(scheduled.delay_compensation, DelayCompensation::Sample(true));
    assert_eq!(scheduled.disturbance_gain, 0.02);
    let hover = attitude("attitude.mpc.model=hover");
    assert!(hover.delay_compensation.is_measured() && hover.disturbance_gain == 0.02);
    let none = attitude("attitude.disturbance_gain=0");
    assert_eq!((none.mpc.model, none.disturbance_gain), (Model::Hover, 0.0), "only an estimate uses the coupling term");
    assert!(none.delay_compensation.is_measured());
}

#[test]
fn a_horizon_has_the_nearest_whole_number_of_samples() {
    for samples in 1..=200_usize {
        let time_s = samples as f64 / 100.0;
        let set = [time_s, time_s].map(|time_s| format!("{time_s}"));
        let set = [
            format!("attitude.mpc.prediction_horizon_s={}", set[0]),
            format!("attitude.mpc.control_horizon_s={}", set[1]),
        ];
        assert_eq!(horizons(&[&set[0], &set[1]]), [samples; 2]);
    }
    // 0.145 * 100 is less than 14.5 in floating point.
    for (time_s, samples) in [("0.124", 12), ("0.125", 13), ("0.145", 15), ("0.155", 16), ("0.1449", 14)] {
        assert_eq!(horizons(&[&format!("attitude.mpc.prediction_horizon_s={time_s}")])[0], samples, "{time_s}");
    }
    for (set, expected) in [
        (
            "attitude.mpc.prediction_horizon_s=30",
            "`attitude.mpc.prediction_horizon_s` = 30.0 is 3000 samples at 100 Hz",
        ),
        ("attitude.mpc.control_horizon_s=0.0049", "`attitude.mpc.control_horizon_s` = 0.0049 is 0 samples at 100 Hz"),
        ("attitude.mpc.control_horizon_s=-0.05", "is 0 samples at 100 Hz"),
    ] {
        let refused = from_set(&[set]).expect_err(set).to_string();
        assert!(refused.contains(expected) && refused.contains("allowed: 0.01 to 2 at this rate"), "{refused}");
        assert_eq!(refused.matches("error: ").count(), 1, "one mistake: {refused}");
    }
}

#[test]
fn horizons_in_samples_are_refused_with_their_seconds() {
    for (text, expected) in [
        (
            "mpc.np = 30",
            [
                "`mpc.np` is `attitude.mpc.prediction_horizon_s` now, in seconds",
                "at 100 Hz are `attitude.mpc.prediction_horizon_s = 0.3`",
            ],
        ),
        (
            "run.rate_hz = 250\n[mpc]\nnu = 7",
            [
                "`mpc.nu` is `attitude.mpc.control_horizon_s` now",
                "7 samples at 250 Hz are `attitude.mpc.control_horizon_s = 0.028`",
            ],
        ),
        (
            "mpc.nu = 'many'",
            ["`mpc.nu` is `attitude.mpc.control_horizon_s` now", "the number of samples by `run.rate_hz`"],
        ),
        (
            "run = 3\nmpc.np = -1",
            ["`mpc.np` is `attitude.mpc.prediction_horizon_s` now", "the number of samples by `run.rate_hz`"],
        ),
    ] {
        let refused = from_merged(text, "old.toml").unwrap_err().to_string();
        assert!(expected.iter().all(|part| refused.contains(part)), "{refused}");
    }
}

#[test]
fn a_file_made_from_a_check_follows_its_vehicle_and_the_record_of_a_flight_does_not() {
    let heavy = load(None, &["airframe.mass_kg=2.2".into()]).unwrap();
    let (checked, recorded) = (to_toml_that_follows(&heavy), to_toml(&heavy));
    assert!(checked.contains("# of the vehicle: r = [0.075, "), "{checked}");
    for text in [&checked, &recorded] {
        assert_eq!(load_text(text, "x", &[]).unwrap(), heavy);
    }
    let lighter = |text: &str| load_text(text, "x", &["airframe.mass_kg=1.1".into()]).unwrap().attitude.mpc.r[0];
    assert_eq!([lighter(&checked), lighter(&recorded)], [0.3, 0.075]);
    let slow = load_text(&to_toml_that_follows(&load(None, &[]).unwrap()), "x", &["run.rate_hz=2000".into()]).unwrap();
    assert_eq!([slow.np(), slow.nu()], [200, 200], "the horizons follow the rate");
    assert!(checked.contains("\n# of the rate: disturbance_gain = 0.02\n"), "{checked}");
    assert_eq!(slow.attitude.disturbance_gain, 0.001, "and so does the gain of the estimate");
    let paper = to_toml_that_follows(&load(None, &["profile=paper".into()]).unwrap());
    assert!(!paper.contains("# of the rate"), "its horizons do not: {paper}");
    let own = load(
        None,
        &[
            "attitude.mpc.r=[1.0, 2.0, 3.0, 4.0]",
            "attitude.mpc.prediction_horizon_s=0.3",
            "attitude.mpc.control_horizon_s=0.07",
            "attitude.disturbance_gain=0.1",
        ]
        .map(String::from),
    )
    .unwrap();
    assert!(to_toml_that_follows(&own) == to_toml(&own), "nothing of it follows");
}

#[test]
fn weights_of_another_vehicle_are_noticed() {
    let fitting = |settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(|&set| set.to_owned()).collect();
        weights_that_fit(&load(None, &settings).unwrap())
    };
    let of_table_i = "attitude.mpc.r=[0.4, 300.0, 85.0, 300.0]";
    assert_eq!(fitting(&["airframe.mass_kg=4.4", of_table_i]).map(|r| r[0]), Some(0.01875));
    for fits in [
        &[][..],
        &["airframe.mass_kg=4.4"],
        &["airframe.mass_kg=1.4", of_table_i],
        &["attitude.mpc.r=[40.0, 3e4, 8e3, 3e4]"],
    ] {
        assert_eq!(fitting(fits), None, "{fits:?}");
    }
}
