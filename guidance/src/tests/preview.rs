//! Tests of the preview against the references of later ticks.

use airframe::angle;
use contract::message::PREVIEW;
use nalgebra::{Rotation3, Vector3};

use super::*;

const STEP_TICKS: u64 = 5;

const LEGS: &str = "{kind='waypoints', curve='trapezoid', ramp_s=1.5, points_m=[[0, 0, -8], [8, 0, -8]], \
    times_s=[10, 20], heading_deg=[[1, 120], [6, -120], [11, 30]]}";
const CIRCLE: &str = "{kind='takeoff', height_m=10, duration_s=10, heading_deg=[[1, 120], [6, -120]]}, \
    {kind='circle', radius_m=5, period_s=40, heading_deg=[[1, 30]]}";

fn turning(parts: &str) -> Scenario {
    let mut scenario = with_parts(parts);
    scenario.guidance.heading_rate_limit_dps = 60.0;
    scenario.guidance.preview_s = 0.01 * (STEP_TICKS * PREVIEW as u64) as f64;
    scenario
}

/// Reference at `tick` for a level vehicle with the position, velocity and heading of the trajectory, displaced by
/// `east_m`.
fn beside(scenario: &Scenario, tick: u64, east_m: f64) -> Reference {
    let (mut guidance, t_s) = (Guidance::new(scenario), tick as f64 * scenario.sample_s());
    let (setpoint, psi) = (guidance.trajectory.at(t_s), guidance.trajectory.heading_at(t_s));
    let mut state = hovering(tick);
    let [x, y, z] = setpoint.position_m;
    state.measured.position_m = [x, y + east_m, z];
    state.measured.attitude_rad = [0.0, 0.0, psi];
    let to_body = Rotation3::from_euler_angles(0.0, 0.0, psi).inverse();
    state.measured.velocity_mps = (to_body * Vector3::from(setpoint.velocity_mps)).into();
    guidance.step(tick, &state)
}

/// Angles and w of a reference.
fn numbers(reference: &Reference) -> impl Iterator<Item = f64> {
    reference.attitude_rad.into_iter().chain([reference.w_mps])
}

#[test]
fn a_lead_is_the_feed_forward_of_a_later_time_at_the_place_of_now() {
    let turning = turning(CIRCLE);
    let mut straight = turning.clone();
    straight.mission.part.iter_mut().for_each(|part| part.heading_deg = None);
    // The preview turns the feed-forward with the expected heading, the lead with the measured heading.
    for (now, skipped) in [(straight, 0), (turning, 2)] {
        let mut led = now.clone();
        led.guidance.lead_s = 0.01 * STEP_TICKS as f64;
        for tick in (0..1500).step_by(7) {
            let [of_now, of_lead] = [&now, &led].map(|scenario| beside(scenario, tick, 0.0));
            assert_eq!(
                (of_lead.position_m, of_lead.velocity_mps),
                (of_now.position_m, of_now.velocity_mps),
                "at {tick}"
            );
            let ahead = of_now.preview[0];
            let changes = ahead.attitude_rad.into_iter().chain([ahead.w_mps]);
            for ((change, now), led) in changes.zip(numbers(&of_now)).zip(numbers(&of_lead)).skip(skipped) {
                assert!(angle::wrapped(now + change - led).abs() < 1e-9, "at {tick}: {led}");
            }
        }
    }
}

#[test]
fn a_preview_is_the_reference_of_a_vehicle_that_keeps_its_place() {
    for (parts, east_m) in [(LEGS, 0.0), (LEGS, 0.3), (CIRCLE, -0.2)] {
        let mut scenario = turning(parts);
        scenario.guidance.ki_phi = 0.0; // the integral would grow until the later tick
        scenario.guidance.ki_theta = 0.0;
        let mut largest = [0.0_f64; 4];
        for tick in (0..1500).step_by(7) {
            let now = beside(&scenario, tick, east_m);
            assert_eq!(now.preview_step_ns, STEP_TICKS * 10_000_000);
            for (ahead, number) in now.preview.iter().zip(1..) {
                let later = beside(&scenario, tick + number * STEP_TICKS, east_m);
                let changes = ahead.attitude_rad.into_iter().chain([ahead.w_mps]);
                for (((change, now), later), largest) in
                    changes.zip(numbers(&now)).zip(numbers(&later)).zip(&mut largest)
                {
                    let miss = angle::wrapped(change - (later - now));
                    assert!(miss.abs() < 1e-9, "{parts} at {tick}, element {number}: {miss}");
                    *largest = largest.max(change.abs());
                }
            }
        }
        assert!(largest.iter().all(|change| *change > 0.01), "there was something to see: {largest:?}");
    }
}

#[test]
fn a_heading_that_turns_past_south_turns_on_in_the_preview() {
    let scenario = turning("{kind='loiter', duration_s=20, heading_deg=[[0, 170], [5, -170]]}");
    let ahead = beside(&scenario, 495, 0.0).preview;
    let turned: Vec<f64> = ahead.iter().map(|ahead| ahead.attitude_rad[2].to_degrees()).collect();
    for (degrees, number) in turned.iter().zip(0..) {
        let expected = f64::min(3.0 * f64::from(number), 20.0); // a turn at 60 degrees/s begins at the first element
        assert!((degrees - expected).abs() < 1e-6, "{turned:?}");
    }
}

#[test]
fn without_the_setting_there_is_no_preview() {
    let mut scenario = turning(LEGS);
    scenario.guidance.preview_s = 0.0;
    let reference = beside(&scenario, 100, 0.0);
    assert_eq!((reference.preview_step_ns, reference.preview), (0, Reference::default().preview));
}
