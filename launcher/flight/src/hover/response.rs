//! Responses to small steps of a reference, and their bandwidths.
//!
//! ```text
//! h_k = (y_k - y_k-1) / step        response to an impulse, from the response to a step
//! T(w) = sum h_k exp(-j w k Ts)     response over the frequency w
//! ```
//!
//! `y` is the true motion minus the motion in a flight without the step, so that a hover away from the reference does
//! not count.

use contract::message::Truth;
use runtime::node::Open;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Mission, MissionPart, PartKind, Scenario, TrajectoryKind};

use super::held::{HELD, STEP_TICK, STEPS};
use super::small::{SMALL, fly};

/// Bandwidths of the attitude loop: frequencies at which the response of w, phi, theta and psi to their own references
/// in REFERENCE falls below -3 dB, in rad/s. The references of the body rates change with those of the angles as
/// `guidance.rate_reference` says. Null if a response is below -3 dB at 0.1 rad/s already, or stays above -3 dB up to
/// half the rate of the ring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AttitudeBandwidths {
    /// Bandwidth of w, the body z velocity \[rad/s\].
    pub w_radps: Option<f64>,
    /// Bandwidth of phi, the roll \[rad/s\].
    pub phi_radps: Option<f64>,
    /// Bandwidth of theta, the pitch \[rad/s\].
    pub theta_radps: Option<f64>,
    /// Bandwidth of psi, the yaw \[rad/s\].
    pub psi_radps: Option<f64>,
}

/// Bandwidths of the position loop: frequencies at which the response of the position to the mission's position falls
/// below -3 dB, at the heading 0, in rad/s. Null in the same cases as in [`AttitudeBandwidths`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PositionBandwidths {
    /// Bandwidth to the north \[rad/s\].
    pub north_radps: Option<f64>,
    /// Bandwidth to the east \[rad/s\].
    pub east_radps: Option<f64>,
    /// Bandwidth down \[rad/s\].
    pub down_radps: Option<f64>,
}

/// Duration of a flight for the attitude \[s\]: at its end the response has settled.
const ATTITUDE_S: f64 = 5.0;
/// Duration of a flight for the position \[s\]: at its end the response has settled.
const POSITION_S: f64 = 16.0;
/// Lowest frequency at which a response is computed \[rad/s\].
const LOWEST_RADPS: f64 = 0.1;
/// Ratio of each frequency of the search to the previous one.
const RATIO: f64 = 1.02;
/// Number of halvings of the interval between the last two frequencies.
const HALVINGS: u32 = 20;

/// Computes the bandwidths from the references of w, phi, theta and psi to these quantities.
pub fn attitude_bandwidths(scenario: &Scenario) -> AttitudeBandwidths {
    let course = |guidance| {
        course(scenario, guidance, ATTITUDE_S, |truth| {
            let ([_, _, w], [phi, theta, psi]) = (truth.actual.velocity_mps, truth.actual.attitude_rad);
            [w, phi, theta, psi]
        })
    };
    let held = course(HELD);
    let radps = |i: usize| bandwidth(i, &course(STEPS[i]), &held, scenario.sample_s());
    AttitudeBandwidths { w_radps: radps(0), phi_radps: radps(1), theta_radps: radps(2), psi_radps: radps(3) }
}

/// Computes the bandwidths from the mission's position to the vehicle's, north, east and down.
pub fn position_bandwidths(scenario: &Scenario) -> PositionBandwidths {
    let step_at_s = STEP_TICK as f64 * scenario.sample_s();
    let stepped = |i: usize| {
        let mut point_m = [0.0; 3];
        point_m[i] = SMALL;
        let wait = MissionPart { duration_s: Some(step_at_s), ..MissionPart::new(PartKind::Loiter) };
        let step =
            MissionPart { point_m: Some(point_m), duration_s: Some(POSITION_S), ..MissionPart::new(PartKind::Jump) };
        let part = vec![wait, step];
        let mission = Mission { trajectory: TrajectoryKind::Parts, part, ..scenario.mission.clone() };
        Scenario { mission, ..scenario.clone() }
    };
    let course = |scenario: &Scenario| course(scenario, ring::nodes::open, POSITION_S, |truth| truth.actual.position_m);
    let held = course(scenario);
    let radps = |i: usize| bandwidth(i, &course(&stepped(i)), &held, scenario.sample_s());
    PositionBandwidths { north_radps: radps(0), east_radps: radps(1), down_radps: radps(2) }
}

/// Flies, and returns the numbers that `of` takes from each sample, from the step on.
fn course<const N: usize>(
    scenario: &Scenario,
    guidance: Open,
    flight_s: f64,
    of: impl Fn(&Truth) -> [f64; N],
) -> Vec<[f64; N]> {
    let mut course = vec![];
    fly(scenario, scenario, guidance, flight_s, |truth| {
        if truth.tick >= STEP_TICK {
            course.push(of(truth));
        }
        true
    });
    course
}

/// Returns the frequency at which the response of number `i` to a step, `stepped` minus `held`, falls below -3 dB
/// \[rad/s\]; `None` if the response is below at [`LOWEST_RADPS`] already, or above up to half the sampling rate.
fn bandwidth<const N: usize>(i: usize, stepped: &[[f64; N]], held: &[[f64; N]], sample_s: f64) -> Option<f64> {
    let response: Vec<f64> = stepped.iter().zip(held).map(|(with, without)| (with[i] - without[i]) / SMALL).collect();
    let impulse: Vec<f64> = response.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let is_below = |radps: f64| squared_magnitude(&impulse, radps * sample_s) < 0.5;
    if is_below(LOWEST_RADPS) {
        return None;
    }
    let mut above = LOWEST_RADPS;
    while !is_below(above * RATIO) {
        above *= RATIO;
        if above * sample_s > std::f64::consts::PI {
            return None;
        }
    }
    let mut below = above * RATIO;
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(above, below);
        let end = if is_below(middle) { &mut below } else { &mut above };
        *end = middle;
    }
    Some(above)
}

/// Squared magnitude of the Fourier transform of `impulse`; `angle_rad` is the frequency times the sample time.
fn squared_magnitude(impulse: &[f64], angle_rad: f64) -> f64 {
    let (sin, cos) = libm::sincos(angle_rad);
    // Horner's rule in exp(-j angle): the phase does not count, so the order may be reversed.
    let [re, im] = impulse.iter().fold([0.0, 0.0], |[re, im], h| [re * cos - im * sin + h, re * sin + im * cos]);
    re * re + im * im
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bandwidth of a response to a step, sampled at 1000 Hz for 60 s.
    fn bandwidth_of(response: impl Fn(f64) -> f64) -> Option<f64> {
        let stepped: Vec<[f64; 1]> = (0..60_000).map(|k| [7.0 + SMALL * response(f64::from(k) * 1e-3)]).collect();
        bandwidth(0, &stepped, &vec![[7.0]; stepped.len()], 1e-3)
    }

    #[test]
    fn the_bandwidth_is_that_of_the_transfer_function() {
        for pole in [0.5, 5.0, 50.0] {
            let first_order = bandwidth_of(|t| 1.0 - (-pole * t).exp()).expect("a bandwidth");
            assert!((first_order / pole - 1.0).abs() < 0.01, "{pole}: {first_order}");
            // Both poles at -p: -3 dB at p sqrt(sqrt 2 - 1).
            let second_order = bandwidth_of(|t| 1.0 - (1.0 + pole * t) * (-pole * t).exp()).expect("a bandwidth");
            assert!((second_order / (pole * 0.643_59) - 1.0).abs() < 0.01, "{pole}: {second_order}");
        }
        assert_eq!(bandwidth_of(|t| f64::from(t > 0.0)), None, "it follows at once");
        assert_eq!(bandwidth_of(|_| 0.0), None, "it does not follow");
    }
}
