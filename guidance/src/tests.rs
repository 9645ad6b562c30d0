//! Direction before magnitude, then limits, then the independent simulator.

use contract::message::{Kinematics, Stamp, State, guidance_flags};
use contract::scenario::{Mission, Profile, Ramp, RampName, TrajectoryKind};
use contract::{Scenario, message::Reference};
use proptest::prelude::*;

use crate::{Guidance, Trajectory};

mod reentry;
mod silence;

fn scenario(profile: Profile, trajectory: TrajectoryKind) -> Scenario {
    let mut scenario = Scenario::from(profile);
    scenario.mission.trajectory = trajectory;
    scenario
}

fn roll_trim() -> f64 {
    airframe::Trim::solve(&airframe::Parameters::default(), false).roll_rad
}

fn hovering(tick: u64) -> State {
    let measured = Kinematics { attitude_rad: [roll_trim(), 0.0, 0.0], ..Kinematics::default() };
    let command_in_force = airframe::Trim::solve(&airframe::Parameters::default(), false).actuation.into();
    State { stamp: Stamp { tick, sequence: 1, ..Stamp::default() }, measured, command_in_force, ..State::default() }
}

/// The answer to a hover displaced to `position_m`, with heading `psi`, at the first tick.
fn answer(profile: Profile, position_m: [f64; 3], psi: f64) -> Reference {
    let mut state = hovering(0);
    state.measured.position_m = position_m;
    state.measured.attitude_rad[2] = psi;
    Guidance::new(&scenario(profile, TrajectoryKind::Hover)).step(state.stamp.tick, &state)
}

#[test]
fn errors_lean_the_right_way() {
    for profile in [Profile::Paper, Profile::Robust] {
        let south = answer(profile, [-1.0, 0.0, 0.0], 0.0);
        assert!(south.attitude_rad[1] < 0.0, "north is reached nose down");
        let west = answer(profile, [0.0, -1.0, 0.0], 0.0);
        assert!(west.attitude_rad[0] > roll_trim(), "east is reached right side down");
        let high = answer(profile, [0.0, 0.0, -1.0], 0.0);
        assert!(high.w_mps > 0.0, "down is positive");
    }
}

#[test]
fn errors_are_turned_into_the_heading_frame() {
    let east_ahead = answer(Profile::Robust, [0.0, -0.5, 0.0], std::f64::consts::FRAC_PI_2);
    let north_ahead = answer(Profile::Robust, [-0.5, 0.0, 0.0], 0.0);
    for i in 0..2 {
        assert!((east_ahead.attitude_rad[i] - north_ahead.attitude_rad[i]).abs() < 1e-12);
    }
    let unturned = answer(Profile::Paper, [0.0, -0.5, 0.0], std::f64::consts::FRAC_PI_2);
    assert!(unturned.attitude_rad[1].abs() < 1e-12, "the paper's controller does not know its heading");
}

#[test]
fn limits_hold_and_raise_their_flags() {
    let far = answer(Profile::Robust, [-100.0, 100.0, 100.0], 0.0);
    let limit = 30_f64.to_radians();
    assert!((far.attitude_rad[1] + limit).abs() < 1e-12);
    assert!((far.attitude_rad[0] - roll_trim() + limit).abs() < 1e-12, "the limit counts from trim");
    assert!((far.w_mps + 4.0).abs() < 1e-12);
    let all = guidance_flags::ROLL_LIMITED | guidance_flags::PITCH_LIMITED | guidance_flags::W_LIMITED;
    assert_eq!(far.flags & all, all);
}

#[test]
fn the_integral_is_added_before_use_and_clamped() {
    let mut s = scenario(Profile::Paper, TrajectoryKind::Hover);
    s.guidance.integral_limit = 0.05;
    let mut guidance = Guidance::new(&s);
    let mut state = hovering(0);
    state.measured.position_m = [0.0, 0.0, 1.0];
    let first = guidance.step(state.stamp.tick, &state);
    assert!((first.w_mps - (-5.0 - 0.1 * 0.01)).abs() < 1e-12, "one rectangle of 10 ms, and no derivative yet");
    let mut last = first;
    for tick in 1..100 {
        state.stamp.tick = tick;
        last = guidance.step(state.stamp.tick, &state);
    }
    assert!((last.w_mps - (-5.0 - 0.1 * 0.05)).abs() < 1e-12);
    assert_ne!(last.flags & guidance_flags::INTEGRAL_CLAMPED, 0);
}

#[test]
fn a_gap_in_the_samples_counts_as_the_time_it_took() {
    let integral = |ticks: &[u64]| {
        let mut guidance = Guidance::new(&scenario(Profile::Paper, TrajectoryKind::Hover));
        let answers = ticks.iter().map(|tick| {
            let mut state = hovering(*tick);
            state.measured.position_m = [0.0, 0.0, 1.0];
            guidance.step(state.stamp.tick, &state).w_mps
        });
        answers.last().unwrap()
    };
    assert!((integral(&[0, 1, 2, 3, 4]) - integral(&[0, 4])).abs() < 1e-12);
}

#[test]
fn bad_and_repeated_samples_repeat_the_answer() {
    let mut guidance = Guidance::new(&scenario(Profile::Robust, TrajectoryKind::Survey));
    let good = guidance.step(0, &hovering(0));
    let mut bad = hovering(1);
    bad.measured.rates_radps[1] = f64::NAN;
    let answer = guidance.step(bad.stamp.tick, &bad);
    assert_eq!(answer, Reference { flags: good.flags | guidance_flags::BAD_INPUT, ..good });
    assert_eq!(guidance.step(0, &hovering(0)), good);
}

#[test]
fn a_bad_first_sample_is_answered_by_hover() {
    let mut guidance = Guidance::new(&scenario(Profile::Robust, TrajectoryKind::Hover));
    let mut bad = hovering(0);
    bad.measured.position_m[0] = f64::INFINITY;
    let answer = guidance.step(bad.stamp.tick, &bad);
    assert_eq!(answer.flags, guidance_flags::BAD_INPUT);
    let good = guidance.step(1, &hovering(1));
    assert_eq!(answer, Reference { flags: guidance_flags::BAD_INPUT, ..good });
}

#[test]
fn the_observer_leans_against_a_push_and_settles_on_it() {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.disturbance_observer_radps = 5.0;
    let mut guidance = Guidance::new(&s);
    // Level, facing east, pushed north at 1 m/s2: to the left, against body y.
    let mut last = Reference::default();
    for tick in 0..300 {
        let mut state = hovering(tick);
        let north_mps = 0.01 * tick as f64;
        let (sin, cos) = roll_trim().sin_cos();
        state.measured.attitude_rad[2] = std::f64::consts::FRAC_PI_2;
        state.measured.velocity_mps = [0.0, -north_mps * cos, north_mps * sin];
        last = guidance.step(state.stamp.tick, &state);
        let expected = 1.0 - 0.95f64.powf(tick as f64);
        assert!(last.disturbance_mps2[0].abs() < 1e-9);
        assert!((last.disturbance_mps2[1] + expected).abs() < 1e-9, "5 % of the gap closes every sample");
    }
    s.guidance.disturbance_observer_radps = 0.0;
    let mut state = hovering(0);
    state.measured.attitude_rad[2] = std::f64::consts::FRAC_PI_2;
    let still = Guidance::new(&s).step(state.stamp.tick, &state);
    assert!(last.attitude_rad[0] > still.attitude_rad[0], "right side down against a push to the left");
}

#[test]
fn rate_references_turn_the_angles_at_their_speed() {
    // The reverse way, from body rates to Euler rates, as in any textbook.
    let (phi, theta) = (0.4f64, -0.6f64);
    let wanted = nalgebra::Vector3::new(0.3, -0.7, 1.1);
    let [p, q, r]: [f64; 3] = crate::rates::body_rates(&wanted, &nalgebra::Vector3::new(phi, theta, 2.0)).into();
    let turn = q * phi.sin() + r * phi.cos();
    let back = nalgebra::Vector3::new(p + turn * theta.tan(), q * phi.cos() - r * phi.sin(), turn / theta.cos());
    assert!((back - wanted).norm() < 1e-14);
}

#[test]
fn exact_w_makes_the_wanted_climb() {
    let mut state = hovering(0);
    state.measured.attitude_rad = [0.4, -0.3, 1.0];
    state.measured.velocity_mps = [3.0, -2.0, 0.0];
    state.measured.velocity_mps[2] = crate::pid::exact_w(-1.5, &state);
    let [phi, theta, psi] = state.measured.attitude_rad;
    let to_ned = nalgebra::Rotation3::from_euler_angles(phi, theta, psi);
    let velocity = to_ned * nalgebra::Vector3::from(state.measured.velocity_mps);
    assert!((velocity.z + 1.5).abs() < 1e-12);
}

#[test]
fn the_limit_of_climb_leaves_w_free_to_keep_the_altitude_at_speed() {
    let mut state = hovering(0);
    state.measured.attitude_rad = [roll_trim(), -0.4, 0.0];
    let level_mps = nalgebra::Rotation3::from_euler_angles(roll_trim(), -0.4, 0.0)
        .inverse_transform_vector(&nalgebra::Vector3::new(12.0, 0.0, 0.0));
    state.measured.velocity_mps = level_mps.into();
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.velocity_feedforward = false;
    s.guidance.kd_w = 0.0;
    let answer = Guidance::new(&s).step(0, &state);
    assert!(level_mps.z < -4.5 && (answer.w_mps - level_mps.z).abs() < 1e-9, "{} for {}", answer.w_mps, level_mps.z);
    assert_eq!(answer.flags & guidance_flags::W_LIMITED, 0);
}

#[test]
fn val_survey_reference() {
    let s = Scenario::from(Profile::Paper);
    let trajectory = Trajectory::new(&s.mission);
    // Reference position of the independent simulator at 0.1 s and, by symmetry, halfway up.
    assert!((trajectory.at(0.1).position_m[2] + 0.003_137_254_9).abs() < 1e-10);
    assert!((trajectory.at(5.0).position_m[2] + 4.0).abs() < 1e-12);
    assert_eq!(trajectory.at(20.0).position_m, [8.0, 0.0, -8.0]);
    assert_eq!(trajectory.at(99.0).position_m, [0.0, 0.0, 0.0]);
}

#[test]
fn val_ramps_begin_at_their_instant() {
    // The independent simulator's feed-forward, theta_ref = -a_x / g, changes on the very sample a ramp begins.
    let trajectory = Trajectory::new(&Scenario::from(Profile::Paper).mission);
    let full = 8.0 / 8.5 / 1.5;
    for (t, expected) in [(10.0, full), (11.49, full), (11.5, 0.0), (18.49, 0.0), (18.5, -full), (20.0, 0.0)] {
        assert!((trajectory.at(t).acceleration_mps2[0] - expected).abs() < 1e-12, "at {t} s");
    }
    assert!((trajectory.at(20.0).acceleration_mps2[1] - full).abs() < 1e-12);
}

#[test]
fn without_ramps_the_velocity_is_constant() {
    let mut mission = scenario(Profile::Robust, TrajectoryKind::Waypoints).mission;
    mission.ramp_s = Ramp::Seconds(0.0);
    (mission.waypoints_m, mission.times_s) = (vec![[1.0, 0.0, 0.0], [3.0, 0.0, -4.0]], vec![0.1, 0.3]);
    let trajectory = Trajectory::new(&mission);
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
    let trajectory = Trajectory::new(&scenario(Profile::Robust, TrajectoryKind::Step).mission);
    for (t, x) in [(0.0, 0.0), (0.99, 0.0), (1.0, 10.0), (60.0, 10.0)] {
        let here = trajectory.at(t);
        assert!((here.position_m[0] - x).abs() < 1e-12 && here.velocity_mps[0].abs() < 1e-12);
    }
}

#[test]
fn the_circle_goes_clockwise_around_its_centre_5_m_to_the_east_and_closes() {
    let trajectory = Trajectory::new(&scenario(Profile::Robust, TrajectoryKind::Circle).mission);
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

/// A circle of 40 m radius.
fn wide_circle(laps: u32, period_s: f64) -> Trajectory {
    let mission = scenario(Profile::Robust, TrajectoryKind::Circle).mission;
    Trajectory::new(&Mission { radius_m: 40.0, height_m: 20.0, period_s, laps, ..mission })
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

/// A spline through `waypoints_m` at `times_s`.
fn spline(waypoints_m: Vec<[f64; 3]>, times_s: Vec<f64>) -> Trajectory {
    let mission = scenario(Profile::Robust, TrajectoryKind::Waypoints).mission;
    Trajectory::new(&Mission { waypoints_m, times_s, ramp_s: Ramp::Named(RampName::Spline), ..mission })
}

#[test]
fn a_spline_through_points_of_a_min_jerk_leg_is_that_leg() {
    let leg = [[1.0, -2.0, 0.0], [81.0, 30.0, -20.0]];
    let mission = scenario(Profile::Robust, TrajectoryKind::Waypoints).mission;
    let min_jerk = Trajectory::new(&Mission {
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
        let trajectory = Trajectory::new(&mission);
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

    #[test]
    fn any_bits_at_all_get_a_finite_answer_and_leave_no_trace_if_bad(
        bits in prop::array::uniform12(any::<u64>()), observer: bool, paper: bool,
    ) {
        let mut s = scenario(if paper { Profile::Paper } else { Profile::Robust }, TrajectoryKind::Survey);
        s.guidance.disturbance_observer_radps = if observer { 5.0 } else { 0.0 };
        let (mut disturbed, mut quiet) = (Guidance::new(&s), Guidance::new(&s));
        quiet.step(0, &hovering(0));
        disturbed.step(0, &hovering(0));
        let mut state = hovering(1);
        let [a, b, c, d] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from_bits(bits[3 * i + j])));
        state.measured = Kinematics { position_m: a, velocity_mps: b, attitude_rad: c, rates_radps: d };
        let answer = disturbed.step(state.stamp.tick, &state);
        let numbers = [answer.attitude_rad, answer.rates_radps, [answer.w_mps, 0.0, 0.0]];
        prop_assert!(numbers.as_flattened().iter().all(|x| x.is_finite()));
        if answer.flags & guidance_flags::BAD_INPUT != 0 {
            quiet.step(1, &hovering(0)); // as if nothing had come
            prop_assert_eq!(disturbed.step(2, &hovering(2)), quiet.step(2, &hovering(2)));
        }
    }

    #[test]
    fn any_finite_state_gets_a_finite_answer_inside_the_limits(
        position in prop::array::uniform3(-500.0_f64..500.0),
        velocity in prop::array::uniform3(-50.0_f64..50.0),
        roll in -3.0_f64..3.0, pitch in -1.55_f64..1.55, yaw in -20.0_f64..20.0,
    ) {
        let mut state = hovering(3);
        state.measured.position_m = position;
        state.measured.velocity_mps = velocity;
        state.measured.attitude_rad = [roll, pitch, yaw];
        let answer = Guidance::new(&scenario(Profile::Robust, TrajectoryKind::Survey)).step(state.stamp.tick, &state);
        let limit = 30_f64.to_radians() + 1e-12;
        prop_assert!((answer.attitude_rad[0] - roll_trim()).abs() <= limit && answer.attitude_rad[1].abs() <= limit);
        let speed_mps = nalgebra::Vector3::from(velocity).norm();
        prop_assert!(answer.w_mps.abs() <= speed_mps + 4.0 + 1e-9, "no component is larger than the whole");
        prop_assert!(answer.rates_radps.iter().all(|r| r.is_finite()));
    }
}
