//! Curves that stray far from their points, and times with which they stay near.
//!
//! Given times decide how far a smooth curve swings out: a vehicle that has little time for a short leg and much time
//! for the next passes the point between the legs fast, and takes most of the second leg to come back. The path depends
//! only on the ratios of the times. The times of the [fastest] curve suit the lengths of the legs, so times in these
//! ratios are offered for the same points.
//!
//! [fastest]: crate::fastest

use nalgebra::Vector3;

use crate::curve::{Curve, SAMPLES};
use crate::fastest;
use crate::heading::Rule;
use crate::limits::VehicleLimits;
use crate::plan::{Least, MissionPlan, PartMotion, PlanPart, Start};

/// Step to which offered times are rounded \[s\].
const STEP_S: f64 = 0.01;
/// Least factor by which offered times exceed the fastest times, so that rounding breaks no limit.
const SLACK: f64 = 1.01;

/// Curve that goes beyond the box of its points by more than their longest leg.
#[derive(Debug, Clone, PartialEq)]
pub struct Stray {
    /// Largest distance beyond the box, along an axis \[m\].
    pub beyond_m: f64,
    /// Longest leg \[m\].
    pub longest_leg_m: f64,
    /// Times with which the curve does not stray; `None` if none are found.
    pub offer: Option<Offer>,
}

/// Times with which a curve stays near its points.
#[derive(Debug, Clone, PartialEq)]
pub struct Offer {
    /// Times of all points but the first, counted from the first \[s\].
    pub times_s: Vec<f64>,
    /// Largest remaining distance beyond the box of the points, along an axis \[m\].
    pub beyond_m: f64,
}

impl Stray {
    /// Finds the stray of `curve` from `points_m`, the first of which is the place where the curve begins; `None` if
    /// the curve stays near. Offered times keep `limits`, and take no longer than the curve unless the limits require
    /// it.
    pub fn find(curve: &Curve, points_m: &[[f64; 3]], least: Least, limits: &VehicleLimits) -> Option<Self> {
        let legs_m = points_m.windows(2).map(|ends| (Vector3::from(ends[1]) - Vector3::from(ends[0])).norm());
        let longest_leg_m = legs_m.fold(0.0, f64::max);
        let beyond_m = beyond_m(curve, points_m);
        let offer = || offer(curve, points_m, least, limits).filter(|offer| offer.beyond_m <= longest_leg_m);
        (beyond_m > longest_leg_m).then(|| Self { beyond_m, longest_leg_m, offer: offer() })
    }
}

/// Lowest and highest coordinates of points, north, east, down \[m\].
pub fn range_m(points_m: &[[f64; 3]]) -> [Vector3<f64>; 2] {
    let empty = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
    points_m.iter().map(|point| Vector3::from(*point)).fold(empty, |[low, high], at| [low.inf(&at), high.sup(&at)])
}

/// Largest distance of the curve beyond the box of points, along an axis \[m\].
fn beyond_m(curve: &Curve, points_m: &[[f64; 3]]) -> f64 {
    let ([low, high], [lowest, highest]) = (range_m(points_m), curve.range_m());
    (low - lowest).max().max((highest - high).max()).max(0.0)
}

/// Finds times for the points in the ratios of the fastest times; `None` for too many points, or if a limit is
/// exceeded.
fn offer(curve: &Curve, points_m: &[[f64; 3]], least: Least, limits: &VehicleLimits) -> Option<Offer> {
    let (first, others) = points_m.split_first().filter(|(_, others)| others.len() <= fastest::MAX_POINTS)?;
    let timed = |times_s| through(*first, others.to_vec(), times_s, least, limits);
    let quickest = timed(None)?;
    let stretch = (curve.duration_s() / quickest.duration_s()).max(SLACK);
    let rounded = |t_s: &f64| (t_s * stretch / STEP_S).round() * STEP_S;
    let times_s: Vec<f64> = quickest.times_s().iter().skip(1).map(rounded).collect();
    let offered = timed(Some(times_s.clone()))?;
    let fits = limits.fits(&offered.legs(SAMPLES), 1.0);
    fits.then(|| Offer { times_s, beyond_m: beyond_m(&offered, points_m) })
}

fn through(
    position_m: [f64; 3],
    points_m: Vec<[f64; 3]>,
    times_s: Option<Vec<f64>>,
    least: Least,
    limits: &VehicleLimits,
) -> Option<Curve> {
    let start = Start { position_m, heading_rad: 0.0, heading_rate_radps: 0.0, limits: *limits };
    let part = PlanPart { motion: PartMotion::Through { points_m, times_s, least }, heading: Rule::KEEP };
    MissionPlan::new(&start, &[part]).parts().first().map(|planned| planned.curve.clone())
}
