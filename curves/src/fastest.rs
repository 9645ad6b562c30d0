//! Times at which the curve through waypoints is fastest, within the limits of a vehicle.
//!
//! Each leg first gets the time that it takes alone, from rest to rest. The curve through the waypoints at these times
//! is [stretched](crate::limits) until it touches a limit. The path of the curve, and thus its duration, depends on the
//! ratios of the times: with the first times the curve can take twice as long as with the best times. A pattern search
//! (Hooke and Jeeves, Journal of the ACM 8(2), 1961) therefore makes the legs longer and shorter one by one, and keeps
//! each change that makes the curve faster. Mellinger and Kumar (ICRA 2011) descend the gradient of the snap instead,
//! which considers no limits.

use nalgebra::Vector3;

use crate::curve::{Curve, CurveShape, SAMPLES};
use crate::limits::VehicleLimits;

/// Largest number of points after the first: the duration of the search grows with its square.
pub const MAX_POINTS: usize = 50;
/// Factor of a leg's time in the first sweep; its root is taken after each sweep without a gain.
const FIRST_FACTOR: f64 = 1.4;
/// Factor at which the search ends.
const LAST_FACTOR: f64 = 1.02;
/// Share of the duration that a change must gain.
const GAIN: f64 = 1e-3;
/// Largest number of sweeps over all legs.
const MAX_SWEEPS: u32 = 30;
/// Number of samples of a leg during the search.
const COARSE: u32 = 25;

/// Builds the fastest curve that `solve` makes through `waypoints`, within `limits`.
pub fn through(
    waypoints: &[Vector3<f64>],
    limits: &VehicleLimits,
    solve: impl Fn(&[(f64, Vector3<f64>)]) -> CurveShape,
) -> Curve {
    let curve = |durations_s: &[f64]| Curve::from(solve(&timed(waypoints, durations_s)));
    let mut durations_s: Vec<f64> = waypoints.windows(2).map(|ends| alone_s(&(ends[1] - ends[0]), limits)).collect();
    let first = curve(&durations_s);
    let mut best_s = first.duration_s() * limits.least_stretch(&first.legs(COARSE));
    let mut factor = FIRST_FACTOR;
    for _ in 0..MAX_SWEEPS {
        let before_s = best_s;
        for leg in 0..durations_s.len() {
            for factor in [factor, 1.0 / factor] {
                let mut tried_s = durations_s.clone();
                tried_s[leg] *= factor;
                let tried = curve(&tried_s);
                let legs = tried.legs(COARSE);
                if limits.fits(&legs, best_s * (1.0 - GAIN) / tried.duration_s()) {
                    best_s = tried.duration_s() * limits.least_stretch(&legs);
                    durations_s = tried_s;
                    break;
                }
            }
        }
        if best_s == before_s {
            factor = factor.sqrt();
        }
        if factor < LAST_FACTOR {
            break;
        }
    }
    let best = curve(&durations_s);
    Curve { stretch: limits.least_stretch(&best.legs(SAMPLES)), ..best }
}

/// Pairs each waypoint with its time; the first time is 0.
fn timed(waypoints: &[Vector3<f64>], durations_s: &[f64]) -> Vec<(f64, Vector3<f64>)> {
    let mut at_s = 0.0;
    let later = durations_s.iter().map(|duration_s| {
        at_s += duration_s;
        at_s
    });
    std::iter::once(0.0).chain(later).zip(waypoints.iter().copied()).collect()
}

/// Shortest first guess of a leg's time \[s\], for waypoints that coincide.
const MIN_ALONE_S: f64 = 0.1;

/// Time that a straight way takes from rest to rest, within the limits of speed and acceleration \[s\].
fn alone_s(way: &Vector3<f64>, limits: &VehicleLimits) -> f64 {
    let (g, has) = (limits.g_mps2, &limits.most);
    let [least, most] = has.thrust_mps2;
    let sideways_mps2 = has.acceleration_mps2.min(g * libm::tan(has.tilt_rad));
    let vertical_mps2 = has.acceleration_mps2.min(most - g).min(g - least);
    let vertical_mps = has.speed_mps.min(has.vertical_mps);
    let sideways_s = rest_to_rest_s(libm::hypot(way.x, way.y), has.speed_mps, sideways_mps2);
    sideways_s.max(rest_to_rest_s(way.z.abs(), vertical_mps, vertical_mps2)).max(MIN_ALONE_S)
}

fn rest_to_rest_s(way_m: f64, speed_mps: f64, acceleration_mps2: f64) -> f64 {
    let ramp_s = speed_mps / acceleration_mps2;
    if way_m > speed_mps * ramp_s { way_m / speed_mps + ramp_s } else { 2.0 * (way_m / acceleration_mps2).sqrt() }
}
