//! Tests of missing states, and of the snapshot.

use contract::message::{Reference, State, guidance_flags};
use contract::snapshot::{self, SNAPSHOT_WORDS, Snapshot};
use proptest::prelude::*;
use runtime::node::Core;
use settings::{Profile, Scenario, TrajectoryKind};

use super::{hovering, scenario};
use crate::Guidance;

/// State at `tick` of a vehicle that hovers `east_m` east of its reference.
fn beside(tick: u64, east_m: f64) -> State {
    let mut state = hovering(tick);
    state.measured.position_m = [0.0, east_m, 0.0];
    state
}

#[test]
fn a_stale_state_repeats_the_answer_with_a_flag() {
    let mut guidance = Guidance::new(&scenario(Profile::Robust, TrajectoryKind::Survey));
    let nothing = State::default();
    let first = guidance.step(0, &nothing);
    assert_eq!(first.flags, guidance_flags::STALE, "before the first state: hover");
    assert_eq!(Reference { flags: 0, ..first }.attitude_rad, guidance.step(0, &hovering(0)).attitude_rad);
    let answer = guidance.step(1, &beside(1, 0.3));
    for tick in 2..500 {
        let repeated = guidance.step(tick, &beside(1, 0.3));
        assert_eq!(repeated, Reference { flags: answer.flags | guidance_flags::STALE, ..answer });
    }
    assert_eq!(guidance.step(500, &hovering(500)).flags & guidance_flags::STALE, 0);
}

/// Answers before and after a silence of `silent` ticks to a vehicle beside its reference.
fn around_a_silence(s: &Scenario, silent: u64) -> (Reference, Reference) {
    let mut guidance = Guidance::new(s);
    let before = (0..20).map(|tick| guidance.step(tick, &beside(tick, 0.3))).last().unwrap();
    for tick in 20..20 + silent {
        guidance.step(tick, &beside(19, 0.3));
    }
    (before, guidance.step(20 + silent, &beside(20 + silent, 0.3)))
}

#[test]
fn the_integral_stands_still_in_a_silence() {
    for profile in [Profile::Paper, Profile::Robust] {
        let s = scenario(profile, TrajectoryKind::Hover);
        let (before, next) = around_a_silence(&s, 0);
        let period = next.attitude_rad[0] - before.attitude_rad[0];
        assert!(period < 0.0, "one more rectangle of an error to the left");
        for silent in [1, 10, 300] {
            let (before, after) = around_a_silence(&s, silent);
            let bump = after.attitude_rad[0] - before.attitude_rad[0];
            assert!((bump - period).abs() < 1e-15, "{profile:?}: {bump} after {silent} ticks is not {period}");
        }
    }
}

#[test]
fn after_a_silence_differences_span_the_whole_silence() {
    // The paper's derivative: 3 cm in 30 ticks is 0.1 m/s, not 3 m/s.
    let s = scenario(Profile::Paper, TrajectoryKind::Hover);
    let mut guidance = Guidance::new(&s);
    guidance.step(0, &hovering(0));
    for tick in 1..30 {
        guidance.step(tick, &hovering(0));
    }
    let back = guidance.step(30, &beside(30, 0.03));
    let k = &s.guidance;
    let expected = -0.03 * k.kp_phi - 0.03 * 0.01 * k.ki_phi - 0.1 * k.kd_phi;
    let lean = back.attitude_rad[0] - super::roll_trim();
    assert!((lean - expected).abs() < 1e-12, "{lean} is not {expected}");
}

#[test]
fn the_observer_counts_a_silence_as_one_period() {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.disturbance_observer_radps = 5.0;
    let mut guidance = Guidance::new(&s);
    guidance.step(0, &hovering(0));
    for tick in 1..100 {
        guidance.step(tick, &hovering(0));
    }
    let mut pushed = hovering(100);
    pushed.measured.velocity_mps[0] = 1.0; // 1 m/s in a second: 1 m/s2, of which 5 % enters the estimate
    let back = guidance.step(100, &pushed);
    assert!((back.disturbance_mps2[0] - 0.05).abs() < 1e-12, "{:?}", back.disturbance_mps2);
}

#[test]
fn the_observer_keeps_no_noise_of_the_last_state_before_a_short_gap() {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.disturbance_observer_radps = 5.0;
    let noisy = |tick: u64| {
        let mut state = hovering(tick);
        state.measured.velocity_mps[0] = [0.1, -0.1, 0.03, -0.07][tick as usize % 4];
        state
    };
    for lost in 1..=3 {
        let (mut whole, mut holed) = (Guidance::new(&s), Guidance::new(&s));
        let estimates = (0..=20 + lost).map(|tick| {
            let state = noisy(if (20..20 + lost).contains(&tick) { 19 } else { tick });
            [whole.step(tick, &noisy(tick)), holed.step(tick, &state)].map(|answer| answer.disturbance_mps2[0])
        });
        let [whole_mps2, holed_mps2] = estimates.last().unwrap();
        // An error of 0.2 m/s enters with 5 rad/s as 1 m/s2, of which a period forgets 5 %.
        let apart_mps2 = (holed_mps2 - whole_mps2).abs();
        assert!(apart_mps2 < 0.05 * lost as f64, "{apart_mps2} m/s2 after {lost} lost states");
    }
}

#[test]
fn the_observer_learns_a_steady_push_through_a_gap_as_without_one() {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.disturbance_observer_radps = 5.0;
    let pushed = |tick: u64| {
        let mut state = hovering(tick);
        state.measured.velocity_mps[0] = 0.01 * tick as f64;
        state
    };
    let estimate = |lost: std::ops::Range<u64>| {
        let mut guidance = Guidance::new(&s);
        let answers =
            (0..60).map(|tick| guidance.step(tick, &pushed(if lost.contains(&tick) { lost.start - 1 } else { tick })));
        answers.last().unwrap().disturbance_mps2[0]
    };
    for lost in [30..31, 30..32, 30..39] {
        assert!((estimate(lost.clone()) - estimate(0..0)).abs() < 1e-12, "{lost:?}");
    }
}

#[test]
fn the_observer_counts_a_gap_with_thrust_cut_as_one_period() {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.disturbance_observer_radps = 5.0;
    let mut guidance = Guidance::new(&s);
    guidance.step(0, &hovering(0));
    let mut falling = hovering(1);
    falling.command_in_force.rotor_speed = [0.0; 3];
    guidance.step(1, &falling);
    let memory = guidance.snapshot();
    guidance = Guidance::new(&s);
    assert!(guidance.restore(&memory));
    guidance.step(2, &hovering(0));
    let mut pushed = hovering(4);
    pushed.measured.velocity_mps[0] = 0.04; // 1 m/s2, of which 5 % enters the estimate
    let back = guidance.step(4, &pushed);
    assert!((back.disturbance_mps2[0] - 0.05).abs() < 1e-12, "{:?}", back.disturbance_mps2);
    pushed.stamp.tick = 6;
    pushed.measured.velocity_mps[0] = 0.06;
    let later = guidance.step(6, &pushed).disturbance_mps2[0];
    assert!((later - (1.0 - 0.95_f64.powi(3))).abs() < 1e-12, "and the next one as it was: {later}");
}

#[test]
fn a_bad_snapshot_changes_nothing() {
    let s = scenario(Profile::Robust, TrajectoryKind::Survey);
    let (mut guidance, mut twin) = (Guidance::new(&s), Guidance::new(&s));
    let mut torn = guidance.snapshot();
    torn[7] ^= 1;
    let mut bad = guidance.memory;
    bad.reference.attitude_rad[2] = f64::NAN;
    for snapshot in [torn, snapshot::pack(&bad), [0; SNAPSHOT_WORDS]] {
        assert!(!guidance.restore(&snapshot));
    }
    assert_eq!(guidance.step(1, &beside(1, 0.3)), twin.step(1, &beside(1, 0.3)));
}

proptest! {
    #[test]
    fn a_restored_node_answers_bit_by_bit_like_the_one_it_continues(
        path in prop::collection::vec((prop::array::uniform3(-2.0..2.0_f64), prop::array::uniform3(-0.5..0.5_f64), 0_u64..3), 2..60),
        until in 0_usize..60, paper: bool,
    ) {
        let mut s = scenario(if paper { Profile::Paper } else { Profile::Robust }, TrajectoryKind::Survey);
        s.guidance.disturbance_observer_radps = if paper { 0.0 } else { 5.0 };
        let mut guidance = Guidance::new(&s);
        let mut continued = None;
        for (tick, (position_m, velocity_mps, late)) in (0..).zip(path) {
            if tick == until as u64 {
                let snapshot: Snapshot = guidance.snapshot();
                let mut candidate = Guidance::new(&s);
                prop_assert!(candidate.restore(&snapshot));
                continued = Some(candidate);
            }
            let mut state = hovering(tick.saturating_sub(late / 2)); // a third of the states come a tick late
            state.measured.position_m = position_m;
            state.measured.velocity_mps = velocity_mps;
            let answer = guidance.step(tick, &state);
            if let Some(continued) = &mut continued {
                prop_assert_eq!(continued.step(tick, &state), answer);
            }
        }
    }
}

#[test]
fn a_candidate_with_an_observer_starts_without_a_bump() {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    let northward = |tick: u64| {
        let mut state = hovering(tick);
        state.measured.velocity_mps[0] = 3.0;
        state
    };
    let mut without = Guidance::new(&s);
    for tick in 0..5 {
        without.step(tick, &northward(tick));
    }
    s.guidance.disturbance_observer_radps = 5.0;
    let mut with = Guidance::new(&s);
    assert!(with.restore(&without.snapshot()));
    let answer = with.step(5, &northward(5));
    assert!(answer.disturbance_mps2.iter().all(|push| push.abs() < 1e-12), "{:?}", answer.disturbance_mps2);
}
