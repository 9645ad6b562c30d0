//! Tests of trajectories against the independent simulator, closed forms and finite differences.

use contract::Scenario;
use contract::scenario::{Mission, Profile, Ramp, RampName, TrajectoryKind};
use proptest::prelude::*;

use super::scenario;
use crate::Trajectory;

/// Trajectory of a mission.
fn of(mission: Mission) -> Trajectory {
    Trajectory::new(&Scenario { mission, ..Scenario::default() })
}

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
    // The independent simulator's feed-forward, theta_ref = -a_x / g, changes on the very sample a ramp begins.
    let trajectory = Trajectory::new(&Scenario::from(Profile::Paper));
    let full = 8.0 / 8.5 / 1.5;
    for (t, expected) in [(10.0, full), (11.49, full), (11.5, 0.0), (18.49, 0.0), (18.5, -full), (20.0, 0.0)] {
        assert!((trajectory.at(t).acceleration_mps2[0] - expected).abs() < 1e-12, "at {t} s");
    }
    assert!((trajectory.at(20.0).acceleration_mps2[1] - full).abs() < 1e-12);
}

#[test]
fn a_rest_below_the_ground_stays_below_a_vehicle_that_is_measured_there() {
    let mut scenario = scenario(Profile::Robust, TrajectoryKind::Waypoints);
    scenario.plant.ground.present = true;
    let ground = &scenario.plant.ground;
    let standing_m = ground.down_m - ground.leg_m;
    scenario.mission.waypoints_m = vec![[0.0, 0.0, standing_m - 1.0], [0.0, 0.0, standing_m + 0.25]];
    scenario.mission.times_s = vec![0.0, 5.0];
    let depth_m = |trajectory: &Trajectory, below_m: f64, t_s: f64| {
        trajectory.for_vehicle_at(standing_m + below_m, t_s).position_m[2] - trajectory.at(t_s).position_m[2]
    };
    let trajectory = Trajectory::new(&scenario);
    for (below_m, t_s, expected_m) in [(0.5, 6.0, 0.5), (0.0, 6.0, 0.0), (-0.5, 6.0, 0.0), (0.5, 4.9, 0.0)] {
        assert!((depth_m(&trajectory, below_m, t_s) - expected_m).abs() < 1e-12, "{below_m} m below at {t_s} s");
    }
    scenario.plant.ground.present = false;
    assert_eq!(depth_m(&Trajectory::new(&scenario), 0.5, 6.0), 0.0, "in the air every height is one to fly at");
    scenario.plant.ground.present = true;
    scenario.mission.waypoints_m[1][2] = standing_m - 0.1;
    assert_eq!(depth_m(&Trajectory::new(&scenario), 0.5, 6.0), 0.0, "a hover above the ground is one");
}

#[test]
fn without_ramps_the_velocity_is_constant() {
    let mut mission = scenario(Profile::Robust, TrajectoryKind::Waypoints).mission;
    mission.ramp_s = Ramp::Seconds(0.0);
    (mission.waypoints_m, mission.times_s) = (vec![[1.0, 0.0, 0.0], [3.0, 0.0, -4.0]], vec![0.1, 0.3]);
    let trajectory = of(mission);
    for t in [0.1, 0.2, 0.3f64.next_down()] {
        let here = trajectory.at(t);
        assert!((here.velocity_mps[0] - 10.0).abs() < 1e-12 && (here.velocity_mps[2] + 20.0).abs() < 1e-12);
        assert!((here.position_m[0] - 1.0 - 10.0 * (t - 0.1)).abs() < 1e-12);
        assert!(here.acceleration_mps2.iter().all(|a| a.abs() < 1e-12));
    }
    for (t, x) in [(0.0, 1.0), (0.3, 3.0), (9.0, 3.0)] {
        assert!((trajectory.at(t).position_m[0] - x).abs() < 1e-12 && trajectory.at(t).velocity_mps[0].abs() < 1e-12);
    }
}

#[test]
fn a_step_is_at_rest_before_and_after() {
    let trajectory = Trajectory::new(&scenario(Profile::Robust, TrajectoryKind::Step));
    for (t, x) in [(0.0, 0.0), (0.99, 0.0), (1.0, 10.0), (60.0, 10.0)] {
        let here = trajectory.at(t);
        assert!((here.position_m[0] - x).abs() < 1e-12 && here.velocity_mps[0].abs() < 1e-12);
    }
}

#[test]
fn the_circle_goes_clockwise_around_its_centre_5_m_to_the_east_and_closes() {
    let trajectory = Trajectory::new(&scenario(Profile::Robust, TrajectoryKind::Circle));
    for t in [0.0, 60.0, 70.0] {
        assert!(trajectory.at(t).position_m.iter().all(|x| x.abs() < 1e-9), "at the origin at {t} s");
    }
    let side = trajectory.at(30.0).position_m;
    assert!(side[0].abs() < 1e-9 && (side[1] - 10.0).abs() < 1e-9 && (side[2] + 10.0).abs() < 1e-9);
    for t in [15.0, 20.0, 40.0, 45.0] {
        let crate::Setpoint { position_m: [north, east, down], velocity_mps: [north_mps, east_mps, _], .. } =
            trajectory.at(t);
        assert!(((east - 5.0).hypot(north) - 5.0).abs() < 1e-9 && (down + 10.0).abs() < 1e-9, "at {t} s");
        assert_eq!(north > 0.0, t < 30.0, "out in the north, back in the south: at {t} s");
        assert!(north * east_mps - (east - 5.0) * north_mps > 0.0, "clockwise seen from above: at {t} s");
    }
}

/// Circle of 40 m radius.
fn wide_circle(laps: u32, period_s: f64) -> Trajectory {
    let mission = scenario(Profile::Robust, TrajectoryKind::Circle).mission;
    of(Mission { radius_m: 40.0, height_m: 20.0, period_s, laps, ..mission })
}

#[test]
fn between_its_first_and_last_half_lap_a_circle_is_periodic_at_constant_speed() {
    let (laps, period_s) = (5, 25.0);
    let trajectory = wide_circle(laps, period_s);
    let ends_s = period_s * 15.0 * 5.0 / 47.0;
    let steady_s = ends_s * 8.0 / 15.0; // of one lap
    for t in [10.0 + ends_s / 2.0, 40.0, 55.5] {
        let [here, later] = [t, t + steady_s].map(|t| trajectory.at(t));
        let speed_mps = std::f64::consts::TAU * 40.0 / steady_s;
        let [north, east, _] = here.position_m;
        let to_centre = nalgebra::Vector3::new(-north, 40.0 - east, 0.0) / 40.0;
        let velocity = nalgebra::Vector3::from(here.velocity_mps);
        let acceleration = nalgebra::Vector3::from(here.acceleration_mps2);
        assert!((to_centre.norm() - 1.0).abs() < 1e-12 && (velocity.norm() - speed_mps).abs() < 1e-9, "at {t} s");
        assert!((acceleration - to_centre * speed_mps * speed_mps / 40.0).norm() < 1e-9, "v2 / r inwards at {t} s");
        let apart = nalgebra::Vector3::from(here.position_m) - nalgebra::Vector3::from(later.position_m);
        assert!(apart.norm() < 1e-9, "the same place a lap later: {apart}");
    }
}

#[test]
fn laps_take_their_period_on_average_and_one_lap_is_min_jerk() {
    for laps in [1, 2, 7] {
        let trajectory = wide_circle(laps, 30.0);
        let end_s = 10.0 + 30.0 * f64::from(laps);
        for (t, height_m) in [(0.0, 0.0), (10.0, 20.0), (end_s, 20.0), (end_s + 10.0, 0.0)] {
            let here = trajectory.at(t);
            assert!(here.velocity_mps.iter().all(|v| v.abs() < 1e-9), "{laps} laps, at {t} s");
            let [north, east, down] = here.position_m;
            assert!(north.abs() < 1e-9 && east.abs() < 1e-9 && (down + height_m).abs() < 1e-9);
        }
        let farthest = trajectory.at(10.0 + 15.0 * f64::from(laps)).position_m; // halfway by symmetry
        let east_m = if laps % 2 == 1 { 80.0 } else { 0.0 };
        assert!((farthest[1] - east_m).abs() < 1e-9, "{laps} laps: {farthest:?}");
    }
    let quarter = wide_circle(1, 30.0).at(10.0 + 7.5);
    let turns: f64 = 10.0 / 64.0 - 15.0 / 256.0 + 6.0 / 1024.0;
    assert!((quarter.position_m[0] - 40.0 * libm::sin(turns * std::f64::consts::TAU)).abs() < 1e-9);
}

/// Spline through `waypoints_m` at `times_s`.
fn spline(waypoints_m: Vec<[f64; 3]>, times_s: Vec<f64>) -> Trajectory {
    let mission = scenario(Profile::Robust, TrajectoryKind::Waypoints).mission;
    of(Mission { waypoints_m, times_s, ramp_s: Ramp::Named(RampName::Spline), ..mission })
}

#[test]
fn a_spline_through_points_of_a_min_jerk_leg_is_that_leg() {
    let leg = [[1.0, -2.0, 0.0], [81.0, 30.0, -20.0]];
    let mission = scenario(Profile::Robust, TrajectoryKind::Waypoints).mission;
    let min_jerk = of(Mission {
        waypoints_m: leg.to_vec(),
        times_s: vec![2.0, 12.0],
        ramp_s: Ramp::Named(RampName::MinJerk),
        ..mission
    });
    for times_s in [vec![2.0, 12.0], vec![2.0, 3.5, 12.0], vec![2.0, 2.7, 5.0, 9.0, 9.5, 12.0]] {
        let through = spline(times_s.iter().map(|t| min_jerk.at(*t).position_m).collect(), times_s.clone());
        for t in (0..140).map(|i| f64::from(i) * 0.1) {
            let (ours, theirs) = (through.at(t), min_jerk.at(t));
            for i in 0..3 {
                assert!((ours.position_m[i] - theirs.position_m[i]).abs() < 1e-9, "{times_s:?} at {t} s");
                assert!((ours.velocity_mps[i] - theirs.velocity_mps[i]).abs() < 1e-9);
                assert!((ours.acceleration_mps2[i] - theirs.acceleration_mps2[i]).abs() < 1e-8);
            }
        }
    }
}

#[test]
fn a_spline_passes_its_waypoints_without_a_jump_up_to_the_fourth_derivative() {
    let waypoints_m =
        vec![[0.0, 0.0, 0.0], [0.0, 0.0, -8.0], [20.0, 5.0, -8.0], [25.0, -10.0, -12.0], [0.0, 0.0, -8.0]];
    let times_s = vec![0.0, 4.0, 9.0, 11.0, 20.0];
    let trajectory = spline(waypoints_m.clone(), times_s.clone());
    let acceleration = |t: f64| nalgebra::Vector3::from(trajectory.at(t).acceleration_mps2);
    for (waypoint, &t) in waypoints_m.iter().zip(&times_s) {
        assert!((0..3).all(|i| (trajectory.at(t).position_m[i] - waypoint[i]).abs() < 1e-9), "at {t} s");
    }
    for end in [0.0, 20.0] {
        let here = trajectory.at(end);
        assert!(here.velocity_mps.iter().chain(&here.acceleration_mps2).all(|x| x.abs() < 1e-9), "at rest at {end} s");
    }
    // The acceleration is a cubic on each side: four points of it give its derivatives at the waypoint exactly.
    for &t in &times_s[1..4] {
        let h = 0.1;
        let derivatives = |h: f64| {
            let [a0, a1, a2, a3] =
                [0.0, 1.0, 2.0, 3.0].map(|i| acceleration(if i > 0.0 { t + i * h } else { t + h * 1e-9 }));
            let jerk = (-11.0 * a0 + 18.0 * a1 - 9.0 * a2 + 2.0 * a3) / (6.0 * h);
            let snap = (2.0 * a0 - 5.0 * a1 + 4.0 * a2 - a3) / (h * h);
            (jerk, snap)
        };
        let (after, before) = (derivatives(h), derivatives(-h));
        assert!(
            (after.0 - before.0).norm() < 1e-5 * after.0.norm().max(1.0),
            "jerk at {t} s: {} {}",
            after.0,
            before.0
        );
        assert!(
            (after.1 - before.1).norm() < 1e-5 * after.1.norm().max(1.0),
            "snap at {t} s: {} {}",
            after.1,
            before.1
        );
    }
}

proptest! {
    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_position(
        t in 0.01_f64..109.9, ramp in 0_usize..4, circle: bool, laps in 1_u32..4,
    ) {
        let mut mission = scenario(Profile::Robust, TrajectoryKind::Survey).mission;
        if circle {
            (mission.trajectory, mission.laps, mission.period_s) = (TrajectoryKind::Circle, laps, 30.0);
        }
        let named = [RampName::MinJerk, RampName::Spline].map(Ramp::Named);
        mission.ramp_s = [Ramp::Seconds(1.5), Ramp::Seconds(4.0), named[0], named[1]][ramp];
        let trajectory = of(mission);
        let h = 1e-4;
        let (before, here, after) = (trajectory.at(t - h), trajectory.at(t), trajectory.at(t + h));
        for i in 0..3 {
            let velocity = (after.position_m[i] - before.position_m[i]) / (2.0 * h);
            // A trapezoid's acceleration jumps at the ends of its ramps, at most by 8 m / 6 s / 1.5 s within h.
            prop_assert!((velocity - here.velocity_mps[i]).abs() < 2e-4, "{velocity} {:?}", here.velocity_mps);
            let jump = (after.acceleration_mps2[i] - before.acceleration_mps2[i]).abs() > 1e-2;
            let acceleration = (after.velocity_mps[i] - before.velocity_mps[i]) / (2.0 * h);
            prop_assert!(jump || (acceleration - here.acceleration_mps2[i]).abs() < 1e-2);
        }
    }
}
