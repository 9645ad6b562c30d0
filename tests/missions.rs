//! Missions of parts, flown: from the ground and back to it, through random waypoints, and refused before the flight.

use proptest::prelude::*;

use crate::harness::{Outcome, fly, launcher};

const INSPECTION: &str = "scenarios/missions/inspection.toml";

/// Flies a scenario in process with these settings.
fn flown(scenario: &[&str], settings: &[String]) -> Outcome {
    let set = settings.iter().flat_map(|setting| ["--set", setting]);
    fly(&scenario.iter().copied().chain(["--mode", "inprocess", "--no-log"]).chain(set).collect::<Vec<_>>())
}

#[test]
fn an_inspection_lands_where_it_should_and_disarms() {
    let outcome = flown(&[INSPECTION], &[]);
    assert_eq!((outcome.code(), &outcome.run()["ground"]), (Some(0), &"landed".into()), "{}", outcome.stderr);
    let run = outcome.run();
    let phases: Vec<&str> =
        run["phases"].as_array().expect("a list").iter().filter_map(|one| one["phase"].as_str()).collect();
    assert_eq!(phases, ["standing", "taking off", "in flight", "landing", "standing"]);
    assert!(outcome.metric("rotor_speed_min") < 1.0, "it disarmed");
    assert!(outcome.metric("rms_position_error_m") < 0.15, "{}", outcome.metric("rms_position_error_m"));
}

#[test]
fn the_check_prints_what_each_part_asks_of_the_vehicle() {
    let output = launcher().args(["check", INSPECTION]).output().expect("the launcher runs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    for expected in ["the vehicle has", "curves may use", "0 takeoff", "3 figure-eight", "6 landing"] {
        assert!(stderr.contains(expected), "{expected}: {stderr}");
    }
    assert!(!stderr.contains("note: the mission takes"), "{stderr}");
    let short = launcher().args(["check", INSPECTION, "--set", "run.duration_s=20"]).output().expect("it runs");
    let stderr = String::from_utf8_lossy(&short.stderr);
    assert!(stderr.contains("note: the mission takes") && stderr.contains("the flight ends at 20.0 s"), "{stderr}");
}

#[test]
fn a_mission_that_leaves_its_points_is_flown_with_a_warning_and_times_that_keep_it() {
    let check = |settings: &[&str]| {
        let set = settings.iter().flat_map(|setting| ["--set", setting]);
        let output = launcher().args(["check", "survey"]).args(set).output().expect("the launcher runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let of_curve = |curve: &str, times_s: &str| {
        let part =
            format!("{{kind=\"waypoints\", curve=\"{curve}\", points_m=[[1,0,-8],[0,0,-8]], times_s={times_s}}}");
        let part = format!("mission.part=[{part}]");
        check(&["initial.position_m=[0,0,-8]", &part])
    };
    let offered = |stderr: &str| {
        let rest = stderr.split_once("with `times_s = ").unwrap_or_else(|| panic!("no times: {stderr}")).1;
        rest.split_once('`').expect("an end").0.to_owned()
    };
    for curve in ["min-snap", "quintic", "spline"] {
        let (code, strays) = of_curve(curve, "[2,22]");
        assert_eq!(code, Some(0), "a warning is no refusal: {strays}");
        assert!(strays.contains("warning: `mission.part[0]`: its curve goes "), "{strays}");
        assert!(strays.contains("0.0 to 1.0"), "the reach of its points: {strays}");
        let (code, stays) = of_curve(curve, &offered(&strays));
        assert!(code == Some(0) && !stays.contains("warning"), "{stays}");
    }
    let inspection = launcher().args(["check", INSPECTION]).output().expect("the launcher runs");
    assert!(!String::from_utf8_lossy(&inspection.stderr).contains("warning"));
}

#[test]
fn what_the_vehicle_cannot_do_is_refused_before_the_flight_with_its_place() {
    for command in ["check", "fly"] {
        let arguments = [command, INSPECTION, "--set", "mission.part=[{kind=\"takeoff\", height_m=10, duration_s=2}]"];
        let output = launcher().args(arguments).output().expect("the launcher runs");
        let stderr = String::from_utf8_lossy(&output.stderr);
        let expected = "`mission.part[0]`: it asks for 9.4 m/s up or down, the vehicle has 4.0 \
                        (`guidance.climb_limit_mps`); give it 4.7 s or more";
        assert!(output.status.code() == Some(2) && stderr.contains(expected), "{stderr}");
    }
}

#[test]
fn what_a_hand_made_curve_asks_for_is_a_warning_and_flown() {
    let parts = "mission.part=[{kind='waypoints', curve='min-jerk', points_m=[[0, 0, -9]], times_s=[2]}, \
                 {kind='jump', point_m=[3, 0, -9], duration_s=2}]";
    for command in [&["check", "survey"][..], &["fly", "--mode", "inprocess", "--no-log", "--set", "run.duration_s=4"]]
    {
        let output = launcher().args(command).args(["--set", parts]).output().expect("the launcher runs");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{stderr}");
        for expected in [
            "warning: `mission.part[0]`: the leg to point 0 asks for 8.4 m/s up or down, the vehicle has 4.0",
            "warning: `mission.part[1]`: the reference jumps by 3.0 m",
        ] {
            assert!(stderr.contains(expected), "{expected}: {stderr}");
        }
    }
}

#[test]
fn a_heading_along_the_track_and_a_swap_of_the_guidance_keep_the_mission() {
    let swap = "swap=[{at_s=20.0, node=\"guidance\", set=[\"guidance.kp_phi=0.25\"]}]".to_owned();
    let outcome = flown(&["scenarios/missions/figure-eight.toml"], &[swap]);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn random_waypoints_fly(
        points in prop::collection::vec((-30.0..30.0_f64, -30.0..30.0_f64, -30.0..-1.0_f64), 1..7),
        quintic: bool,
        track: bool,
    ) {
        let points: Vec<[f64; 3]> = points.into_iter().map(|(north, east, down)| [north, east, down]).collect();
        let curve = if quintic { "quintic" } else { "min-snap" };
        let heading = if track { "\"along-track\"" } else { "90.0" };
        let part = format!("{{kind=\"waypoints\", points_m={points:?}, curve=\"{curve}\", heading_deg={heading}}}");
        let settings = [
            format!("mission.part=[{part}, {{kind=\"loiter\", duration_s=2.0}}]"),
            "run.duration_s=40".to_owned(),
        ];
        let outcome = flown(&[], &settings);
        prop_assert_eq!(outcome.code(), Some(0), "{} {:?}", outcome.stderr, settings);
        let rms_m = outcome.metric("rms_position_error_m");
        prop_assert!(rms_m < 0.2 && outcome.metric("final_position_error_m") < 0.2, "{rms_m} {settings:?}");
    }
}
