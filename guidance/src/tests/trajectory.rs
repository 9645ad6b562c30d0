//! Tests of trajectories against the independent simulator, and of rests below the ground.

use settings::{Profile, Scenario};

use super::with_parts;
use crate::Trajectory;

#[test]
fn val_survey_reference() {
    let s = Scenario::from(Profile::Paper);
    let trajectory = Trajectory::new(&s);
    // Reference position of the independent simulator at 0.1 s and, by symmetry, halfway up.
    assert!((trajectory.at(0.1).position_m[2] + 0.003_137_254_9).abs() < 1e-10);
    assert!((trajectory.at(5.0).position_m[2] + 4.0).abs() < 1e-12);
    assert_eq!(trajectory.at(20.0).position_m, [8.0, 0.0, -8.0]);
    assert_eq!(trajectory.at(99.0).position_m, [0.0, 0.0, 0.0]);
}

#[test]
fn val_ramps_begin_at_their_instant() {
    // The independent simulator's feed-forward, theta_ref = -a_x / g, changes at the very sample at which a ramp
    // begins.
    let trajectory = Trajectory::new(&Scenario::from(Profile::Paper));
    let full = 8.0 / 8.5 / 1.5;
    for (t, expected) in [(10.0, full), (11.49, full), (11.5, 0.0), (18.49, 0.0), (18.5, -full), (20.0, 0.0)] {
        assert!((trajectory.at(t).acceleration_mps2[0] - expected).abs() < 1e-12, "at {t} s");
    }
    assert!((trajectory.at(20.0).acceleration_mps2[1] - full).abs() < 1e-12);
}

#[test]
fn a_rest_below_the_ground_stays_below_a_vehicle_that_is_measured_there() {
    let ground = &Scenario::default().plant.ground;
    let standing_m = ground.down_m - ground.leg_m;
    let landing = |present, end_m: f64| {
        let end = format!("points_m=[[0, 0, {:?}]], times_s=[5]", standing_m + end_m);
        let mut scenario = with_parts(&format!("{{kind='waypoints', curve='min-jerk', {end}}}"));
        scenario.plant.ground.present = present;
        Trajectory::new(&scenario)
    };
    let depth_m = |trajectory: &Trajectory, below_m: f64, t_s: f64| {
        trajectory.for_vehicle_at(standing_m + below_m, t_s).position_m[2] - trajectory.at(t_s).position_m[2]
    };
    let trajectory = landing(true, 0.25);
    for (below_m, t_s, expected_m) in [(0.5, 6.0, 0.5), (0.0, 6.0, 0.0), (-0.5, 6.0, 0.0), (0.5, 4.9, 0.0)] {
        assert!((depth_m(&trajectory, below_m, t_s) - expected_m).abs() < 1e-12, "{below_m} m below at {t_s} s");
    }
    assert_eq!(depth_m(&landing(false, 0.25), 0.5, 6.0), 0.0, "in the air every height is one to fly at");
    assert_eq!(depth_m(&landing(true, -0.1), 0.5, 6.0), 0.0, "a hover above the ground is one");
}
