//! Estimator of the navigation unit: turns samples of an IMU and of slower, later sensors into the present motion.
//!
//! | module | holds |
//! |---|---|
//! | [`state`] | nominal state, and its motion over a sample of the IMU |
//! | [`filter`] | error-state Kalman filter: covariance, measurements, resets |
//! | [`source`] | sources of measurements: gates and records |
//! | [`noise`] | errors that the filter expects |
//! | `lane` | an IMU with its filter, and the choice among lanes |
//! | `memory` | memory as words |
//! | `yaw` | check of the heading by the receiver's velocity |
//! | [`alignment`] | start of a unit that stands still |
//!
//! ```text
//! IMUs, position, velocity, height, field -> [ frames of the last `delay` ] -> a filter for each IMU, at the horizon
//!                                                |                               |
//!                                                +----- State::moved, each ------+--> present estimate, lane in use
//! ```
//!
//! The filter lags by the delay of the latest sensor, as in PX4's ECL: at its horizon every measurement has arrived and
//! is fused at the time at which it was made, in order, so that no delay needs a correction and the covariance equals
//! that of a filter without delay. The present estimate is the state at the horizon, moved over the samples of the IMU
//! since then. A buffer of past states to return to would give the same estimates for more memory: a covariance for
//! each sample.
//!
//! A measurement that equals the previous measurement bit by bit is ignored, so a sensor that is stuck counts as
//! silent.
//!
//! The estimate is finite whatever the sensors give: values of an IMU that are NaN or beyond its range are replaced by
//! the last values, and other measurements out of range are left out.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

use std::collections::VecDeque;

use nalgebra::{SVector, Vector2, Vector3};

pub mod alignment;
pub mod filter;
mod lane;
mod memory;
pub mod noise;
pub mod source;
pub mod state;
mod yaw;

pub use filter::Filter;
use lane::ImuLane;
use memory::{Visit, optional, plain};
pub use noise::{Constants, ExpectedNoise, InitialErrors, Wander};
pub use source::{Source, SourceRecord};
pub use state::{Covariance, Imu, State};

/// Largest number of IMUs of a unit.
pub const IMUS: usize = 2;

/// Largest position, velocity and share of the field that are accepted as measurements, far beyond every flight. A
/// covariance that a reset makes as large still resolves the smallest biases.
const MAX_POSITION_M: f64 = 5000.0;
const MAX_VELOCITY_MPS: f64 = 200.0;
const MAX_FIELD: f64 = 10.0;

/// Measurements made at the end of a sample of the IMU; a measurement that is not finite is ignored.
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
    /// Returns the measurements that differ from the `last` of the same sensor, and stores all in `last`.
    fn since(&self, last: &mut Self) -> Self {
        fn news<T: PartialEq + Copy>(now: Option<T>, last: &mut Option<T>) -> Option<T> {
            let news = now.filter(|_| now != *last);
            *last = now.or(*last);
            news
        }
        Self {
            position_m: news(self.position_m, &mut last.position_m),
            velocity_mps: news(self.velocity_mps, &mut last.velocity_mps),
            height_m: news(self.height_m, &mut last.height_m),
            field: news(self.field, &mut last.field),
            flow_mps: news(self.flow_mps, &mut last.flow_mps),
        }
    }

    /// Passes the memory to `visit`, as [`Navigation::visit`].
    fn visit(&mut self, visit: Visit) {
        let Self { position_m, velocity_mps, height_m, field, flow_mps } = self;
        for vector in [position_m, velocity_mps, field] {
            optional(vector, visit);
        }
        optional(height_m, visit);
        optional(flow_mps, visit);
    }
}

/// Samples of all IMUs, and the other measurements at their end.
type Frame = ([Imu; IMUS], Aiding);

/// Estimator with the frames since its horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct Navigation {
    /// Lanes, one for each IMU.
    lanes: Vec<ImuLane>,
    /// Index of the lane whose estimate is used.
    flown: usize,
    /// Standard deviations of the constant errors of the IMUs.
    constants: Constants,
    /// Last measurement of each sensor that reached the horizon.
    last: Aiding,
    /// Frames that the filters have not reached, oldest first.
    frames: VecDeque<Frame>,
    /// Number of frames from the horizon to now.
    delay: usize,
    period_s: f64,
}

impl Navigation {
    /// Builds an estimator from filters at the start, one for each IMU, at most [`IMUS`]; the first filter is used
    /// first. Samples of the IMUs, whose errors have the deviations `constants`, are `period_s` apart. The horizon is
    /// `delay` samples ago.
    pub fn new(filters: impl IntoIterator<Item = Filter>, constants: Constants, period_s: f64, delay: usize) -> Self {
        let lanes = filters.into_iter().take(IMUS).map(ImuLane::new).collect();
        let frames = VecDeque::with_capacity(delay + 1);
        Self { lanes, flown: 0, constants, last: Aiding::default(), frames, delay, period_s }
    }

    /// Returns the filter in use, whose state is the state at the horizon.
    pub fn filter(&self) -> &Filter {
        &self.lane().filter
    }

    /// Number of the IMU whose filter is in use, from 0.
    pub fn imu(&self) -> usize {
        self.flown
    }

    /// Number of IMUs that can be trusted: they give new samples, and no source contradicts their filter.
    pub fn sound(&self) -> usize {
        self.lanes.iter().filter(|lane| !lane.is_ill() && !lane.filter.is_contradicted()).count()
    }

    fn lane(&self) -> &ImuLane {
        &self.lanes[self.flown]
    }

    /// Receives a sample of each IMU, and the other measurements at their end.
    pub fn update(&mut self, imus: &[Imu; IMUS], aiding: &Aiding) {
        let Self { lanes, period_s, .. } = self;
        let mut taken = [Imu::default(); IMUS];
        for ((taken, lane), imu) in taken.iter_mut().zip(&mut *lanes).zip(imus) {
            *taken = lane.receive(imu, *period_s);
        }
        self.frames.push_back((taken, *aiding));
        while self.frames.len() > self.delay
            && let Some((imus, aiding)) = self.frames.pop_front()
        {
            let aiding = aiding.since(&mut self.last);
            for (lane, imu) in self.lanes.iter_mut().zip(&imus) {
                lane.filter.predict(imu, self.period_s);
                fuse(&mut lane.filter, &aiding);
                lane.filter.symmetrise();
            }
        }
        self.flown = lane::choose(&mut self.lanes, self.flown, &self.constants, self.period_s);
    }

    /// Estimates the state `ahead_s` after the last sample of the IMU, and the body rates \[rad/s\].
    pub fn estimate(&self, ahead_s: f64) -> (State, Vector3<f64>) {
        let ImuLane { filter, last, .. } = self.lane();
        let moved = |state: State, imu: &Imu, dt_s| state.moved(imu, dt_s, filter.g_mps2());
        let newest = self.samples().fold(filter.state, |state, imu| moved(state, imu, self.period_s));
        let state = if ahead_s > 0.0 { moved(newest, last, ahead_s) } else { newest };
        (state, last.rates_radps - state.rates_bias_radps)
    }

    /// Covariance of the error of [`estimate`](Self::estimate) at the same `ahead_s`.
    pub fn covariance(&self, ahead_s: f64) -> Covariance {
        let ImuLane { filter, last, .. } = self.lane();
        let samples = self.frames.len() as f64;
        let mean = |of: fn(&Imu) -> Vector3<f64>| {
            let sum = self.samples().fold(Vector3::zeros(), |sum, imu| sum + of(imu));
            if self.frames.is_empty() { of(last) } else { sum / samples }
        };
        let imu =
            Imu { specific_force_mps2: mean(|imu| imu.specific_force_mps2), rates_radps: mean(|imu| imu.rates_radps) };
        filter.covariance_after(&imu, self.period_s, samples + ahead_s / self.period_s)
    }

    /// Samples of the IMU in use, from the horizon on.
    fn samples(&self) -> impl Iterator<Item = &Imu> {
        self.frames.iter().map(|(imus, _)| &imus[self.flown])
    }

    /// Passes the memory to `visit`, which writes it elsewhere, or replaces it by the memory of another estimator.
    pub fn visit(&mut self, visit: Visit) {
        let Self { lanes, flown, last, frames, delay, .. } = self;
        for lane in lanes.iter_mut() {
            lane.visit(visit);
        }
        last.visit(visit);
        let mut counts = [*flown, frames.len()].map(|count| count as u64);
        plain(&mut counts, visit);
        *flown = (counts[0] as usize).min(lanes.len() - 1);
        frames.resize((counts[1] as usize).min(*delay), Default::default());
        for (imus, aiding) in frames {
            imus.iter_mut().take(lanes.len()).for_each(|imu| plain(imu, visit));
            aiding.visit(visit);
        }
    }
}

/// Fuses the measurements at the horizon, except measurements that are NaN or out of range.
fn fuse(filter: &mut Filter, aiding: &Aiding) {
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

/// Returns whether every value is a number, and below `range`.
fn is_within<const N: usize>(values: &SVector<f64, N>, range: f64) -> bool {
    values.iter().all(|value| value.abs() < range)
}

#[cfg(test)]
mod tests;
