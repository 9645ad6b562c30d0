//! Lane: one IMU with a filter of its own, and the choice among lanes.
//!
//! ```text
//! worse    = integral of (surprise - surprise of the lane in use) where they differ by more than HYSTERESIS,
//!            forgotten with FORGET_S
//! surprise = largest y' / S y of the last measurements, as a share of its gate, up to 1
//! ```
//!
//! All lanes get the same measurements of the other sensors, so the lanes differ only by their IMUs. An IMU that gives
//! nothing new, because it is silent or stuck, is detected by the age of its last new sample, before its lane has an
//! error. An IMU that gives wrong numbers is detected by the innovations of its lane. PX4's `EKF2Selector` compares
//! sums of test ratios. In PX4 a lane that has diverged stays diverged; here it begins anew from the lane in use.

use nalgebra::Vector3;

use crate::filter::Filter;
use crate::memory::{Visit, plain};
use crate::noise::Constants;
use crate::state::Imu;

/// Range of the accelerometer, 16 g \[m/s2\].
const MAX_SPECIFIC_FORCE_MPS2: f64 = 157.0;
/// Range of the gyros, 2000 deg/s \[rad/s\].
const MAX_RATES_RADPS: f64 = 34.9;

/// Age of an IMU's last new sample above which the IMU is ill \[s\]; at 50 deg/s the attitude then errs by a degree.
const STALE_S: f64 = 0.02;
/// Time for which an IMU must give new samples until it is well again \[s\]: longer than the delay of every sensor.
const WELL_AFTER_S: f64 = 1.0;
/// Smallest difference of two lanes' surprises that counts.
const HYSTERESIS: f64 = 0.2;
/// Time constant with which differences are forgotten \[s\].
const FORGET_S: f64 = 2.0;
/// Integral of the difference by which a lane must be better to replace the lane in use \[s\].
const CHANGE_S: f64 = 0.1;
/// Integral of the difference at which a worse lane begins anew from the lane in use \[s\].
const ANEW_S: f64 = 1.0;

/// IMU with its filter.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ImuLane {
    /// Filter at the horizon.
    pub filter: Filter,
    /// Last sample that was taken.
    pub last: Imu,
    /// Age of the last new sample \[s\].
    stale_s: f64,
    /// Time for which the IMU has been well, up to [`WELL_AFTER_S`] \[s\].
    well_s: f64,
    /// Integral of the surprise of this lane less the surprise of the lane in use \[s\].
    worse_s: f64,
}

impl ImuLane {
    /// Builds the lane of an IMU that has been well.
    pub fn new(filter: Filter) -> Self {
        let last = Imu { specific_force_mps2: Vector3::new(0.0, 0.0, -filter.g_mps2()), ..Imu::default() };
        Self { filter, last, stale_s: 0.0, well_s: WELL_AFTER_S, worse_s: 0.0 }
    }

    /// Receives a sample of the IMU, and returns the sample to use: a value that is NaN or beyond the range is replaced
    /// by the last value.
    pub fn receive(&mut self, measured: &Imu, period_s: f64) -> Imu {
        let (force, of_force) =
            in_range(&measured.specific_force_mps2, &self.last.specific_force_mps2, MAX_SPECIFIC_FORCE_MPS2);
        let (rates, of_rates) = in_range(&measured.rates_radps, &self.last.rates_radps, MAX_RATES_RADPS);
        self.stale_s = if of_force && of_rates { 0.0 } else { self.stale_s + period_s };
        self.well_s = if self.stale_s > STALE_S { 0.0 } else { (self.well_s + period_s).min(WELL_AFTER_S) };
        self.last = Imu { specific_force_mps2: force, rates_radps: rates };
        self.last
    }

    /// Returns whether the IMU gives no new samples, or has given them for less than [`WELL_AFTER_S`].
    pub fn is_ill(&self) -> bool {
        self.well_s < WELL_AFTER_S
    }

    /// Passes the memory to `visit`, as [`Navigation::visit`](crate::Navigation::visit).
    pub fn visit(&mut self, visit: Visit) {
        self.filter.visit(visit);
        plain(&mut self.last, visit);
        for time_s in [&mut self.stale_s, &mut self.well_s, &mut self.worse_s] {
            plain(time_s, visit);
        }
    }
}

/// Returns the values of a sensor, with the `last` value in place of each NaN and each value beyond `range`; and `true`
/// if all were in range and one is new.
fn in_range(values: &Vector3<f64>, last: &Vector3<f64>, range: f64) -> (Vector3<f64>, bool) {
    let taken = values.zip_map(last, |value, last| if value.abs() <= range { value } else { last });
    (taken, taken == *values && taken != *last)
}

/// Chooses among `lanes` after a sample, and returns the index of the lane to use in place of `flown`. Another lane
/// begins anew from the chosen lane when its IMU is well again, or when it is much worse; its biases then have the
/// deviations `constants`.
pub(crate) fn choose(lanes: &mut [ImuLane], flown: usize, constants: &Constants, period_s: f64) -> usize {
    let of_flown = lanes[flown].filter.surprise();
    for lane in &mut *lanes {
        let worse = lane.filter.surprise() - of_flown;
        let tells = if worse.abs() > HYSTERESIS { worse * period_s } else { 0.0 };
        let worse_s = (lane.worse_s * (1.0 - period_s / FORGET_S) + tells).min(ANEW_S);
        lane.worse_s = if lane.is_ill() { ANEW_S } else { worse_s };
    }
    let is_better = |lane: &ImuLane| !lane.is_ill() && (lanes[flown].is_ill() || lane.worse_s < -CHANGE_S);
    let chosen = lanes.iter().position(is_better).unwrap_or(flown);
    if chosen != flown {
        for lane in &mut *lanes {
            lane.worse_s = 0.0;
        }
    }
    for i in 0..lanes.len() {
        if i != chosen && lanes[i].worse_s >= ANEW_S && !lanes[i].is_ill() {
            let best = lanes[chosen].filter.clone();
            lanes[i].filter.begin_at(&best, constants);
            lanes[i].worse_s = 0.0;
        }
    }
    chosen
}

#[cfg(test)]
mod tests;
