//! Tests of the re-entry after a silence.

use contract::message::Reference;
use settings::{Profile, TrajectoryKind};

use super::{hovering, roll_trim, scenario};
use crate::Guidance;
use crate::limits::ReferenceLimits;

/// Answers from the first state after `silent` ticks of silence on, in which the vehicle has drifted far ahead and
/// down.
fn after(profile: Profile, silent: u64, answers: u64) -> Vec<Reference> {
    let mut guidance = Guidance::new(&scenario(profile, TrajectoryKind::Hover));
    guidance.step(0, &hovering(0));
    for tick in 1..=silent {
        guidance.step(tick, &hovering(0));
    }
    let drifted = |tick| {
        let mut state = hovering(tick);
        state.measured.position_m = [20.0, 0.0, 20.0];
        guidance.step(tick, &state)
    };
    (silent + 1..=silent + answers).map(drifted).collect()
}

#[test]
fn after_a_long_silence_the_answer_is_small_and_grows() {
    let answers = after(Profile::Robust, 50, 301);
    let pitch_deg = |i: usize| answers[i].attitude_rad[1].to_degrees();
    assert!((pitch_deg(0) - 15.0).abs() < 1e-9, "back, by raising the nose: {}", pitch_deg(0));
    let climb_mps = |i: usize| answers[i].w_mps * roll_trim().cos(); // w is along body z at the roll of trim
    assert!((climb_mps(0) + 1.0).abs() < 1e-9, "and up: {}", climb_mps(0));
    assert!((pitch_deg(100) - 20.0).abs() < 1e-9 && (climb_mps(100) + 2.0).abs() < 1e-9);
    assert!((pitch_deg(300) - 30.0).abs() < 1e-9, "after 3 s as ever");
    assert!((climb_mps(300) + 4.0).abs() < 1e-9);
    assert!((answers[0].attitude_rad[0] - roll_trim()).abs() < 1e-9, "about trim");
}

#[test]
fn a_short_gap_limits_nothing() {
    for (silent, limited) in [(0, false), (9, false), (10, true)] {
        let first = after(Profile::Robust, silent, 1)[0];
        assert_eq!(first.attitude_rad[1].to_degrees() < 29.0, limited, "{silent} ticks");
    }
}

#[test]
fn states_without_thrust_leave_integrals_and_observer_alone() {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.disturbance_observer_radps = 5.0;
    let mut guidance = Guidance::new(&s);
    let before = guidance.step(0, &hovering(0));
    let mut falling = hovering(1);
    falling.command_in_force.rotor_speed = [0.0; 3];
    for tick in 1..50 {
        falling.stamp.tick = tick;
        falling.measured.velocity_mps = [0.1 * tick as f64; 3];
        let answer = guidance.step(tick, &falling);
        assert_eq!(Reference { flags: 0, ..answer }, before);
        assert!(contract::message::guidance_flags::repeated(answer.flags));
    }
    assert_eq!(guidance.memory.integral_ms.norm(), 0.0);
}

#[test]
fn the_limits_of_the_settings_hold_during_reentry() {
    let tight = ReferenceLimits { angle_rad: 0.1, climb_mps: 0.5 };
    for since_s in [None, Some(0.0), Some(1.0), Some(2.99), Some(3.0), Some(1e9)] {
        assert_eq!(tight.after_silence(since_s), tight);
    }
    let wide = ReferenceLimits { angle_rad: 1.0, climb_mps: 1e9 };
    assert!(wide.after_silence(Some(2.99)).angle_rad < 0.53 && wide.after_silence(Some(2.99)).climb_mps < 4.0);
    assert_eq!(wide.after_silence(Some(3.0)), wide);
}
