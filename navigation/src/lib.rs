//! Estimator of the navigation unit: turns samples of an IMU and of slower, later sensors into the present motion.
//!
//! | module | holds |
//! |---|---|
//! | [`state`] | nominal state, and its motion over a sample of the IMU |
//! | [`filter`] | error-state Kalman filter: covariance, measurements, gates, resets |
//! | [`alignment`] | start of a unit that stands still |
//!
//! ```text
//! IMU, position, velocity, height, field -> [ frames of the last `delay` ] -> filter at the horizon
//!                                               |                               |
//!                                               +----- State::moved, each ------+--> estimate of now
//! ```
//!
//! The filter lags by the delay of the latest sensor, as in PX4's ECL: at its horizon every measurement has arrived and
//! is fused at the time at which it was made, in order, so that no delay needs a correction and the covariance is that
//! of an undelayed filter. The estimate of now is the state at the horizon moved over the samples of the IMU since. A
//! buffer of past states to return to would give the same estimates for more memory: a covariance for each sample.
//!
//! The estimate is finite whatever the sensors give: values of the IMU that are no numbers are replaced by the last
//! ones, those beyond its range are clipped, and other measurements that cannot be true are left out.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

use std::collections::VecDeque;

use nalgebra::{SVector, Vector2, Vector3};

pub mod alignment;
pub mod filter;
pub mod state;

pub use filter::{Constants, Filter, Noise, Record, Source, Start, Wander};
pub use state::{Covariance, Imu, State};

/// Range of the accelerometer, 16 g \[m/s2\].
const MAX_SPECIFIC_FORCE_MPS2: f64 = 157.0;
/// Range of the gyros, 2000 deg/s \[rad/s\].
const MAX_RATES_RADPS: f64 = 34.9;
/// Largest position, velocity and share of the field that are taken for measurements, far beyond every flight: a
/// covariance that a reset makes as large still holds the smallest biases in its digits.
const MAX_POSITION_M: f64 = 5000.0;
const MAX_VELOCITY_MPS: f64 = 200.0;
const MAX_FIELD: f64 = 10.0;

/// Measurements that were made with a sample of the IMU; a number that is not finite is no measurement.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Aiding {
    /// Position, NED \[m\].
    pub position_m: Option<Vector3<f64>>,
    /// Velocity, NED \[m/s\].
    pub velocity_mps: Option<Vector3<f64>>,
    /// Height above the origin \[m\].
    pub height_m: Option<f64>,
    /// Magnetic field, body, as shares of its strength.
    pub field: Option<Vector3<f64>>,
    /// Velocity over the ground ahead and to the right, body \[m/s\].
    pub flow_mps: Option<Vector2<f64>>,
}

impl Aiding {
    /// Passes to `visit` one number that tells which measurements there are, and the numbers of these.
    fn visit(&mut self, visit: &mut impl FnMut(&mut f64)) {
        let Self { position_m, velocity_mps, height_m, field, flow_mps } = self;
        let there =
            [position_m.is_some(), velocity_mps.is_some(), height_m.is_some(), field.is_some(), flow_mps.is_some()];
        let mut code = there.iter().rev().fold(0.0, |code, there| 2.0 * code + f64::from(u8::from(*there)));
        visit(&mut code);
        let is_there = |i: usize| code as u64 >> i & 1 == 1;
        for (i, vector) in [(0, position_m), (1, velocity_mps), (3, field)] {
            *vector = is_there(i).then(|| vector.unwrap_or_default());
            vector.iter_mut().flat_map(|vector| vector.iter_mut()).for_each(&mut *visit);
        }
        *height_m = is_there(2).then(|| height_m.unwrap_or_default());
        *flow_mps = is_there(4).then(|| flow_mps.unwrap_or_default());
        height_m.iter_mut().chain(flow_mps.iter_mut().flat_map(|flow| flow.iter_mut())).for_each(&mut *visit);
    }
}

/// Estimator with the frames since its horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct Navigation {
    filter: Filter,
    /// Frames that the filter has not reached, oldest first.
    frames: VecDeque<(Imu, Aiding)>,
    /// Number of frames from the horizon to now.
    delay: usize,
    /// Last sample of the IMU.
    last: Imu,
    period_s: f64,
}

impl Navigation {
    /// Builds an estimator from a `filter` at the start, for samples of the IMU `period_s` apart. The horizon is
    /// `delay` samples ago.
    pub fn new(filter: Filter, period_s: f64, delay: usize) -> Self {
        let last = Imu { specific_force_mps2: Vector3::new(0.0, 0.0, -filter.g_mps2()), ..Imu::default() };
        Self { filter, frames: VecDeque::with_capacity(delay + 1), delay, last, period_s }
    }

    /// Returns the filter, whose state is that of the horizon.
    pub fn filter(&self) -> &Filter {
        &self.filter
    }

    /// Receives a sample of the IMU and what was measured at its end.
    pub fn update(&mut self, imu: &Imu, aiding: &Aiding) {
        self.last = Imu {
            specific_force_mps2: in_range(
                &imu.specific_force_mps2,
                &self.last.specific_force_mps2,
                MAX_SPECIFIC_FORCE_MPS2,
            ),
            rates_radps: in_range(&imu.rates_radps, &self.last.rates_radps, MAX_RATES_RADPS),
        };
        self.frames.push_back((self.last, *aiding));
        while self.frames.len() > self.delay
            && let Some((imu, aiding)) = self.frames.pop_front()
        {
            self.filter.predict(&imu, self.period_s);
            self.fuse(&aiding);
        }
    }

    /// Fuses what was measured at the horizon, except what is no number.
    fn fuse(&mut self, aiding: &Aiding) {
        let Self { filter, .. } = self;
        if let Some(position_m) = aiding.position_m.filter(|position| is_within(position, MAX_POSITION_M)) {
            filter.fuse_position(position_m);
        }
        if let Some(velocity_mps) = aiding.velocity_mps.filter(|velocity| is_within(velocity, MAX_VELOCITY_MPS)) {
            filter.fuse_velocity(velocity_mps);
        }
        if let Some(height_m) = aiding.height_m.filter(|height| height.abs() < MAX_POSITION_M) {
            filter.fuse_height(height_m);
        }
        if let Some(field) = aiding.field.filter(|field| is_within(field, MAX_FIELD)) {
            filter.fuse_field(&field);
        }
        if let Some(flow_mps) = aiding.flow_mps.filter(|flow| is_within(flow, MAX_VELOCITY_MPS)) {
            filter.fuse_flow(&flow_mps);
        }
    }

    /// Estimates the state `ahead_s` after the last sample of the IMU, and the body rates \[rad/s\].
    pub fn estimate(&self, ahead_s: f64) -> (State, Vector3<f64>) {
        let moved = |state: State, imu: &Imu, dt_s| state.moved(imu, dt_s, self.filter.g_mps2());
        let newest = self.frames.iter().fold(self.filter.state, |state, (imu, _)| moved(state, imu, self.period_s));
        let state = if ahead_s > 0.0 { moved(newest, &self.last, ahead_s) } else { newest };
        (state, self.last.rates_radps - state.rates_bias_radps)
    }

    /// Covariance of the error of [`estimate`](Self::estimate).
    pub fn covariance(&self, ahead_s: f64) -> Covariance {
        let samples = self.frames.len() as f64;
        let mean = |of: fn(&Imu) -> Vector3<f64>| {
            let sum = self.frames.iter().fold(Vector3::zeros(), |sum, (imu, _)| sum + of(imu));
            if self.frames.is_empty() { of(&self.last) } else { sum / samples }
        };
        let imu =
            Imu { specific_force_mps2: mean(|imu| imu.specific_force_mps2), rates_radps: mean(|imu| imu.rates_radps) };
        self.filter.covariance_after(&imu, self.period_s, samples + ahead_s / self.period_s)
    }

    /// Passes every number of the memory to `visit`, to be read or written.
    pub fn visit(&mut self, visit: &mut impl FnMut(&mut f64)) {
        self.filter.visit(visit);
        visit_imu(&mut self.last, visit);
        let mut length = self.frames.len() as f64;
        visit(&mut length);
        self.frames.resize((length as usize).min(self.delay), Default::default());
        for (imu, aiding) in &mut self.frames {
            visit_imu(imu, visit);
            aiding.visit(visit);
        }
    }
}

/// Values of a sensor within `range`, with those of the `last` sample where they are no numbers.
fn in_range(values: &Vector3<f64>, last: &Vector3<f64>, range: f64) -> Vector3<f64> {
    values.zip_map(last, |value, last| if value.is_nan() { last } else { value.clamp(-range, range) })
}

/// Returns whether every number is one, and below `range`.
fn is_within<const N: usize>(values: &SVector<f64, N>, range: f64) -> bool {
    values.iter().all(|value| value.abs() < range)
}

fn visit_imu(imu: &mut Imu, visit: &mut impl FnMut(&mut f64)) {
    imu.specific_force_mps2.iter_mut().chain(&mut imu.rates_radps).for_each(visit);
}

#[cfg(test)]
mod tests;
