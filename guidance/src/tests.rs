//! Tests of directions, magnitudes and limits.

use contract::message::{Kinematics, Reference, Stamp, State, guidance_flags};
use proptest::prelude::*;
use settings::{DelayCompensation, DelayName, Profile, Scenario, TrajectoryKind};

use crate::{Guidance, Trajectory};

mod limits;
mod preview;
mod reentry;
mod silence;
mod trajectory;

fn scenario(profile: Profile, trajectory: TrajectoryKind) -> Scenario {
    let mut scenario = Scenario::from(profile);
    scenario.mission.trajectory = trajectory;
    scenario
}

/// Default scenario with these tables of `mission.part`.
fn with_parts(parts: &str) -> Scenario {
    settings::load(None, &[format!("mission.part=[{parts}]")]).unwrap()
}

fn roll_trim() -> f64 {
    airframe::Trim::solve(&airframe::Parameters::default(), false).roll_rad
}

fn hovering(tick: u64) -> State {
    let measured = Kinematics { attitude_rad: [roll_trim(), 0.0, 0.0], ..Kinematics::default() };
    let command_in_force = airframe::Trim::solve(&airframe::Parameters::default(), false).actuation.into();
    State { stamp: Stamp { tick, sequence: 1, ..Stamp::default() }, measured, command_in_force, ..State::default() }
}

/// Answer to a hover displaced to `position_m`, with heading `psi`, at the first tick.
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
    let share = 30_f64.to_radians() / 2_f64.sqrt(); // share of each angle in the tilt, which is limited as a whole
    assert!((far.attitude_rad[1] + share).abs() < 1e-12);
    assert!((far.attitude_rad[0] - roll_trim() + share).abs() < 1e-12, "the limit counts from trim");
    assert!((far.w_mps * roll_trim().cos() + 4.0).abs() < 1e-12, "the limit is that of the climb");
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
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.preview_s = 0.0; // the first answer has no preview
    let mut guidance = Guidance::new(&s);
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
    // The vehicle is level, faces east, and is pushed north at 1 m/s2: to its left, against body y.
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
fn the_observer_holds_while_the_vehicle_is_upset() {
    let mut guidance = Guidance::new(&scenario(Profile::Robust, TrajectoryKind::Hover));
    let mut answer = |tick: u64, pitch_rad: f64| {
        let mut state = hovering(tick);
        state.measured.attitude_rad[1] = pitch_rad;
        let north_mps = 0.1 * tick as f64; // an acceleration of 10 m/s2
        state.measured.velocity_mps = nalgebra::Rotation3::from_euler_angles(roll_trim(), pitch_rad, 0.0)
            .inverse_transform_vector(&nalgebra::Vector3::new(north_mps, 0.0, 0.0))
            .into();
        guidance.step(tick, &state).disturbance_mps2
    };
    for tick in 0..50 {
        answer(tick, 0.0);
    }
    let before = answer(50, 0.0);
    assert!(before[0] > 1.0, "{before:?}");
    for tick in 51..100 {
        assert_eq!(answer(tick, if tick % 2 == 0 { 0.53 } else { -1.2 }), before, "tick {tick}");
    }
    let after = answer(100, 0.52);
    assert!(after != before && after[0] - before[0] < 0.2, "one sample counts, not all: {before:?} {after:?}");
}

#[test]
fn feed_forward_leads_by_the_measured_delay_only_if_the_controller_measures_it() {
    let answer = |delay_compensation, lead_s, age_ns| {
        let mut s = with_parts("{kind='takeoff', height_m=8}, {kind='circle', radius_m=5, period_s=12}");
        (s.attitude.delay_compensation, s.guidance.lead_s) = (delay_compensation, lead_s);
        let (mut guidance, trajectory) = (Guidance::new(&s), Trajectory::new(&s));
        let answers = (300..310).map(|tick| {
            let mut state = hovering(tick);
            let setpoint = trajectory.at(0.01 * tick as f64);
            (state.measured.position_m, state.measured.velocity_mps) = (setpoint.position_m, setpoint.velocity_mps);
            (state.applied_sequence, state.applied_age_ns) = (tick, age_ns);
            guidance.step(tick, &state)
        });
        answers.last().unwrap()
    };
    let (measured, sample) = (DelayCompensation::Named(DelayName::Measured), DelayCompensation::Sample(true));
    let numbers = |r: &Reference| {
        let preview = r.preview.iter().flat_map(|ahead| [&[ahead.w_mps][..], &ahead.attitude_rad].concat());
        r.attitude_rad.into_iter().chain([r.w_mps]).chain(preview).collect::<Vec<f64>>()
    };
    let apart = |one: &Reference, other: &Reference| {
        numbers(one).iter().zip(numbers(other)).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
    };
    let leads = answer(measured, 0.02, 50_000_000);
    assert!(apart(&leads, &answer(sample, 0.07, 50_000_000)) < 1e-12, "delay and lead add up");
    assert!(apart(&leads, &answer(sample, 0.02, 50_000_000)) > 1e-4);
    assert_eq!(answer(sample, 0.02, 50_000_000), answer(sample, 0.02, 0), "else the delay does not matter");
}

#[test]
fn rate_references_turn_the_angles_at_their_speed() {
    // Textbook relation in the other direction, from body rates to Euler rates.
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
    state.measured.velocity_mps[2] = crate::pid::ExactW::new(&state).at(-1.5);
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

proptest! {
    #[test]
    fn any_bits_get_a_finite_answer_and_bad_ones_change_nothing(
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
            quiet.step(1, &hovering(0)); // as if the bad state had never been received
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
        prop_assert!(answer.w_mps.abs() <= 2.0 * (speed_mps + 4.0) + 1e-9, "{} at {speed_mps}", answer.w_mps);
        prop_assert!(answer.rates_radps.iter().all(|r| r.is_finite()));
    }
}
