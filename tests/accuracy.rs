//! How near a flight comes to what was asked for, where a wrong reference would show.

use crate::harness::fly;

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
    let outcome = flown(&[
        "mission.trajectory=\"waypoints\"",
        "mission.waypoints_m=[[0,0,0],[0,0,-20],[80,0,-20],[80,80,-20],[0,80,-20],[0,0,-20]]",
        "mission.times_s=[0,10,20,30,40,50]",
        "mission.ramp_s=\"min-jerk\"",
    ]);
    let worst_m = outcome.metric("max_position_error_m");
    assert!(worst_m < 0.4, "{worst_m} m; 9.21 with a limit on w in place of one on the climb");
}

#[test]
fn a_heading_across_180_degrees_turns_the_short_way() {
    let turn = |to_deg: i32| {
        let heading = format!("mission.heading_deg=[[0.0, 170.0], [5.0, {to_deg}.0]]");
        let settings = ["mission.trajectory=\"hover\"", "initial.attitude_deg=[0, 0, 170]", "run.duration_s=10"];
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
        "mpc.disturbance_gain=0.1",
        "plant.disturbance=[[1.0, [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]]]",
    ]);
    let last = outcome.run()["metrics"]["final_position_error_m"].as_f64().expect("a number");
    assert!(last < 0.02, "{last} m off at the end");
}
