//! Tests of the limits: limits are equal in all directions, and the integral does not wind up at a limit.

use contract::message::guidance_flags;
use nalgebra::Vector3;
use settings::{Profile, Scenario, TrajectoryKind};

use super::{hovering, roll_trim, scenario};
use crate::Guidance;
use crate::memory::GuidanceMemory;
use crate::observer::HeadingFrame;

/// Memory after every tick of a flight that reaches the limits, turned by `turn_rad` about the origin.
fn turned(turn_rad: f64) -> Vec<GuidanceMemory> {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.mission.heading_deg = turn_rad.to_degrees();
    s.initial.attitude_deg[2] = turn_rad.to_degrees();
    let mut guidance = Guidance::new(&s);
    let frame = HeadingFrame::new(turn_rad);
    let flown = |tick: u64| {
        let mut state = hovering(tick);
        let t_s = 0.01 * tick as f64;
        let position_m = Vector3::new(-3.0 + 4.0 * (0.5 * t_s).sin(), 2.0 - 0.5 * t_s, 1.0 - 0.4 * t_s);
        state.measured.position_m = frame.back(&position_m).into();
        state.measured.velocity_mps = [0.5 * t_s.sin(), -0.3 * t_s.cos(), 0.1];
        state.measured.attitude_rad = [roll_trim() + 0.1 * t_s.cos(), -0.1 * t_s.sin(), turn_rad];
        guidance.step(tick, &state);
        guidance.memory
    };
    (0..800).map(flown).collect()
}

#[test]
fn the_limits_do_not_depend_on_where_north_is() {
    let turn_rad = 37_f64.to_radians();
    let frame = HeadingFrame::new(turn_rad);
    let mut flags = 0;
    for (tick, (one, other)) in turned(0.0).iter().zip(turned(turn_rad)).enumerate() {
        let (a, b) = (&one.reference, &other.reference);
        let misses = [
            (frame.back(&one.integral_ms) - other.integral_ms).amax(),
            (Vector3::from(a.attitude_rad) + Vector3::z() * turn_rad - Vector3::from(b.attitude_rad)).amax(),
            (a.w_mps - b.w_mps).abs(),
            (a.disturbance_mps2[0] - b.disturbance_mps2[0]).abs(),
            (a.disturbance_mps2[1] - b.disturbance_mps2[1]).abs(),
        ];
        assert!(misses.iter().all(|miss| *miss < 1e-12), "tick {tick}: {misses:?}");
        assert_eq!(a.flags, b.flags, "tick {tick}");
        flags |= a.flags;
    }
    let all = guidance_flags::ROLL_LIMITED | guidance_flags::PITCH_LIMITED | guidance_flags::INTEGRAL_CLAMPED;
    assert_eq!(flags & all, all, "the flight reaches them");
}

/// Guidance after `ticks` ticks in which the vehicle stays 2 m south of its hover and 2 m below, with free integrals.
fn held_away(ticks: u64, change: fn(&mut Scenario)) -> Guidance {
    let mut s = scenario(Profile::Robust, TrajectoryKind::Hover);
    s.guidance.integral_limit = 1e9;
    change(&mut s);
    let mut guidance = Guidance::new(&s);
    for tick in 0..ticks {
        let mut state = hovering(tick);
        state.measured.position_m = [-2.0, 0.0, 2.0];
        let answer = guidance.step(tick, &state);
        assert_eq!(answer.flags & guidance_flags::BAD_INPUT, 0, "tick {tick}");
    }
    guidance
}

#[test]
fn the_clipped_part_is_fed_back_into_the_integral() {
    let free = held_away(100, |s| (s.guidance.angle_limit_deg, s.guidance.climb_limit_mps) = (80.0, 1e9));
    assert!((free.memory.integral_ms - Vector3::new(2.0, 0.0, -2.0)).amax() < 1e-12, "2 m for 1 s");
    let limited = held_away(100, |_| {}).memory.integral_ms;
    assert!(limited.x < 1.0 && limited.z > -1.6, "both fall behind: {limited}");
    // The integral settles where Ki times the integral is the limit of the output.
    let Guidance { memory, settings, .. } = held_away(60_000, |_| {});
    let next = memory.integral_ms + memory.error_m * 0.01;
    let reached = [settings.ki_theta * next.x, settings.ki_w * next.z];
    assert!((reached[0] + 30_f64.to_radians()).abs() < 1e-6 && (reached[1] + 4.0).abs() < 1e-6, "{reached:?}");
}

#[test]
fn without_a_proportional_gain_nothing_is_fed_back() {
    let integral = held_away(100, |s| {
        (s.guidance.kp_theta, s.guidance.kp_w) = (0.0, 0.0);
        (s.guidance.ki_theta, s.guidance.ki_w) = (-10.0, 100.0); // both outputs exceed their limits
    });
    assert!((integral.memory.integral_ms - Vector3::new(2.0, 0.0, -2.0)).amax() < 1e-12, "and none is divided by");
    assert_ne!(integral.memory.reference.flags & guidance_flags::PITCH_LIMITED, 0);
    assert_ne!(integral.memory.reference.flags & guidance_flags::W_LIMITED, 0);
}
