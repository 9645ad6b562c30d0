//! Tracking accuracy of flights: a wrong reference would show here.

use crate::harness::{fly, top};

/// Flies the default scenario in process with these settings.
fn flown(settings: &[&str]) -> crate::harness::Outcome {
    let mut arguments = vec!["--mode", "inprocess", "--no-log"];
    for setting in settings {
        arguments.extend(["--set", setting]);
    }
    fly(&arguments)
}

#[test]
fn legs_of_80_m_in_10_s_keep_their_altitude() {
    let outcome = flown(&["mission.part=[{kind='waypoints', curve='min-jerk', times_s=[10,20,30,40,50], \
         points_m=[[0,0,-20],[80,0,-20],[80,80,-20],[0,80,-20],[0,0,-20]]}]"]);
    let worst_m = outcome.metric("max_position_error_m");
    assert!(worst_m < 0.4, "{worst_m} m; 9.21 with a limit on w in place of one on the climb");
}

/// Returns the RMS position error of `scenarios/NAME`, flown with `settings` \[m\].
fn rms_m(name: &str, settings: &[&str]) -> f64 {
    let path = top().join("scenarios").join(name);
    let mut arguments = vec![path.to_str().expect("a path in UTF-8"), "--mode", "inprocess", "--no-log"];
    for setting in settings {
        arguments.extend(["--set", setting]);
    }
    fly(&arguments).metric("rms_position_error_m")
}

#[test]
fn a_circle_is_followed_closer_than_its_polygon() {
    let lap = (0..=320_u32).map(|i| {
        let x = f64::from(i) / 320.0;
        let (sin, cos) = (x * x * x * (10.0 + x * (-15.0 + x * 6.0)) * std::f64::consts::TAU).sin_cos();
        format!("[{:?}, {:?}, -20.0]", 40.0 * sin, 40.0 * (1.0 - cos))
    });
    let points = lap.collect::<Vec<_>>().join(",");
    let times = (0..=320_u32).map(|i| format!("{:?}", 10.0 + 0.1 * f64::from(i))).collect::<Vec<_>>().join(",");
    let polygon = format!("mission.part=[{{kind='waypoints', curve='line', points_m=[{points}], times_s=[{times}]}}]");
    let lifted = ["bounds.max_position_error_m=10.0", "run.duration_s=42"];
    let as_polygon = rms_m("fast-circle.toml", &[&[polygon.as_str()][..], &lifted].concat());
    let as_circle = rms_m("fast-circle.toml", &["run.duration_s=42"]);
    assert!(as_circle < 0.2 && as_circle < as_polygon / 5.0, "{as_circle} m, as a polygon {as_polygon} m");
}

#[test]
fn a_spline_is_followed_closer_than_legs_through_the_same_points() {
    let legs = "mission.part=[{kind='waypoints', curve='trapezoid', ramp_s=0.5, times_s=[5,10,14,18,23,28], points_m=\
                [[0,0,-5],[12,4,-6],[24,-4,-7],[36,4,-6],[48,0,-5],[48,0,0]]}]";
    let as_legs = rms_m("slalom.toml", &[legs, "bounds.max_position_error_m=10.0"]);
    let as_spline = rms_m("slalom.toml", &[]);
    assert!(as_spline < as_legs / 2.0, "{as_spline} m, along legs {as_legs} m");
}

#[test]
fn a_heading_across_180_degrees_turns_the_short_way() {
    let turn = |to_deg: i32| {
        let heading = format!("mission.part=[{{kind='loiter', duration_s=10, heading_deg=[[5, {to_deg}]]}}]");
        let settings = ["initial.attitude_deg=[0, 0, 170]", "run.duration_s=10"];
        flown(&[&settings[..], &[&heading]].concat()).metric("max_position_error_m")
    };
    let (across, through) = (turn(-170), turn(190));
    assert!((across - through).abs() < 1e-9 && across < 0.05, "{across} m to -170 and {through} m to 190 degrees");
}

#[test]
fn a_push_sideways_costs_no_altitude_once_it_is_known() {
    let outcome = flown(&[
        "mission.trajectory=\"hover\"",
        "run.duration_s=40",
        "guidance.ki_w=0",
        "guidance.disturbance_observer_radps=5",
        "attitude.disturbance_gain=0.1",
        "plant.disturbance=[[1.0, [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]]]",
    ]);
    let last = outcome.run()["metrics"]["final_position_error_m"].as_f64().expect("a number");
    assert!(last < 0.02, "{last} m off at the end");
}

#[test]
fn a_delay_of_70_ms_is_flown_if_it_is_measured() {
    let late = |compensation: &str| {
        let compensation = format!("attitude.delay_compensation={compensation}");
        flown(&["run.duration_s=20", "run.command_delay_ms=70", "bounds.max_position_error_m=1", &compensation])
    };
    let outcome = late("\"measured\"");
    let worst_m = outcome.metric("max_position_error_m");
    assert!(outcome.code() == Some(0) && worst_m < 0.1, "{worst_m} m");
    assert_eq!(late("true").code(), Some(1), "one sample is not enough");
}

#[test]
fn a_preview_makes_up_for_corners_and_for_a_delay_that_is_measured() {
    let (none, late) = ("guidance.preview_s=0", "run.command_delay_ms=70");
    let [without, led, with] = [&[none][..], &[none, "guidance.lead_s=0.12"], &[]].map(|set| rms_m("survey.toml", set));
    assert!(with < without / 3.0, "{with} m, without a preview {without} m");
    assert!(
        with < led && led < without / 3.0,
        "a lead that fits the mission does nearly as well: {led} m, not {with} m"
    );
    let [without, with] = [&[none, late][..], &[late]].map(|set| rms_m("survey.toml", set));
    assert!(with < without / 4.0 && with < 0.006, "{with} m with 70 ms of delay, without a preview {without} m");
}
