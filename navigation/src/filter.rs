//! Error-state Kalman filter: covariance, measurements, gates and resets.
//!
//! ```text
//! P  = F P F' + Q                              Sola, arXiv 1711.02508, section 5.4, eqs. 266 to 270
//! S  = H P H' + V,   K = P H' / S              section 6, eqs. 273 to 276
//! P  = (I - K H) P (I - K H)' + K V K'         Joseph's form: symmetric, and positive after rounding too
//! x  = x + K y,   P = G P G'                   eqs. 282 to 287, with G = I - [K y / 2]x for the attitude: G turns
//!                                              the error into the axes of the new attitude
//! ```
//!
//! A measurement is refused if its normalised innovation `y' / S y` is above the chi-square quantile of 0.999; the
//! horizontal and the vertical part of a receiver's measurement are gated separately. A source that is refused for
//! `RESET_AFTER_S` disagrees for good, and a reset follows: of the error of the source (drift, bias, own field) if it
//! disagrees alone; of the motion if another source of the same motion is refused too, or if the source was silent
//! before. A velocity that disagrees alone is refused as long as it disagrees. The covariance of the states that are
//! reset grows by the innovation, `H' y^2 H`, so that the filter accepts the innovation. Resets are counted.

use libm::hypot;
use nalgebra::{Matrix3, RowVector3, SMatrix, SVector, Vector2, Vector3};

use crate::memory::{Visit, plain};
use crate::noise::{Constants, ExpectedNoise};
use crate::source::{Measured, SOURCES, Source, SourceRecord, direct, scalar};
use crate::state::{
    ACCELERATION_BIAS, ATTITUDE, Covariance, DECLINATION, DRIFT, ERRORS, HARD_IRON, Imu, RATES_BIAS, State, StateError,
    VELOCITY, turn,
};
use crate::yaw::YawCheck;

/// Time for which a source must disagree until a reset \[s\].
const RESET_AFTER_S: f64 = 2.0;
/// Time for which two sources must disagree at once before the motion that both measure is reset \[s\].
const TOGETHER_S: f64 = 1.0;
/// Time after which the drift has followed an antenna that a turn has moved \[s\].
const LASTS_S: f64 = 1.0;
/// Deviation from which on a heading counts as unknown, and smallest error of a heading that counts as wrong \[rad\].
const UNKNOWN_RAD: f64 = 0.8;
const WRONG_RAD: f64 = 0.35;
/// Smallest horizontal share of the magnetic field from which a heading is computed.
pub(crate) const MIN_HORIZONTAL: f64 = 0.1;

/// Error-state Kalman filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    /// Estimate.
    pub state: State,
    /// Covariance of the estimate's error.
    pub covariance: Covariance,
    noise: ExpectedNoise,
    g_mps2: f64,
    /// Magnitudes of body rates and acceleration in the last sample of the IMU \[rad/s, m/s2\].
    pace: [f64; 2],
    records: [SourceRecord; SOURCES],
    yaw: YawCheck,
}

impl Filter {
    /// Builds a filter that starts at `state` with an error of `covariance`.
    pub fn new(state: State, covariance: Covariance, noise: ExpectedNoise, g_mps2: f64) -> Self {
        Self {
            state,
            covariance,
            noise,
            g_mps2,
            pace: [0.0; 2],
            records: [SourceRecord::default(); SOURCES],
            yaw: YawCheck::default(),
        }
    }

    /// Gravity \[m/s2\].
    pub fn g_mps2(&self) -> f64 {
        self.g_mps2
    }

    /// Returns the record of `source`.
    pub fn record(&self, source: Source) -> SourceRecord {
        self.records[source as usize]
    }

    /// Largest squared normalised innovation of the last measurements of all sources, as a share of its gate, up to 1.
    pub fn surprise(&self) -> f64 {
        Source::ALL.iter().fold(0.0, |most: f64, source| most.max(self.record(*source).nis / source.gate())).min(1.0)
    }

    /// Returns whether a source has disagreed for at least `TOGETHER_S`.
    pub fn is_contradicted(&self) -> bool {
        self.records.iter().any(|record| record.disputed_s() >= TOGETHER_S)
    }

    /// Begins anew at the estimate of another filter. The IMU of this filter has errors of its own, with the deviations
    /// `constants`. The records keep their counts of measurements and resets.
    pub fn begin_at(&mut self, other: &Self, constants: &Constants) {
        let zero = Vector3::zeros();
        self.state = State { acceleration_bias_mps2: zero, rates_bias_radps: zero, ..other.state };
        self.covariance = other.covariance;
        for (from, deviations) in
            [(ACCELERATION_BIAS, constants.acceleration_bias_mps2), (RATES_BIAS, constants.rates_bias_radps)]
        {
            self.covariance.fixed_rows_mut::<3>(from).fill(0.0);
            self.covariance.fixed_columns_mut::<3>(from).fill(0.0);
            for (i, deviation) in deviations.iter().enumerate() {
                self.covariance[(from + i, from + i)] = deviation * deviation;
            }
        }
        (self.pace, self.yaw) = (other.pace, other.yaw);
        for (record, from) in self.records.iter_mut().zip(&other.records) {
            let SourceRecord { silent_s, spell, outage_s, nis, .. } = *from;
            *record = SourceRecord { silent_s, spell, outage_s, nis, ..*record };
        }
    }

    /// Moves state and covariance over a sample of the IMU.
    pub fn predict(&mut self, imu: &Imu, dt_s: f64) {
        self.covariance = self.covariance_after(imu, dt_s, 1.0);
        let before = self.state;
        self.state = before.moved(imu, dt_s, self.g_mps2);
        let faster = self.state.velocity_mps - before.velocity_mps;
        self.yaw.moved(&faster.xy(), dt_s);
        self.pace = [(imu.rates_radps - before.rates_bias_radps).norm(), faster.norm() / dt_s];
        let State { drift_m, barometer_bias_m, hard_iron, .. } = &mut self.state;
        let wandering = drift_m.iter_mut().chain([barometer_bias_m]).chain(hard_iron);
        wandering.zip(self.noise.wandering()).for_each(|(error, wander)| *error *= wander.step(dt_s).0);
        self.records.iter_mut().for_each(|record| record.silent_s += dt_s);
    }

    /// Covariance after a number of `samples` of the IMU of `dt_s` each, whose mean is `imu`; to first order in their
    /// duration.
    pub fn covariance_after(&self, imu: &Imu, dt_s: f64, samples: f64) -> Covariance {
        let transition = self.state.transition(imu, dt_s * samples);
        let half = transition.times(&self.covariance).transpose();
        let mut covariance = transition.times(&half);
        let steps = samples.sqrt();
        for (from, deviation) in [
            (VELOCITY, self.noise.specific_force_mps2 * dt_s),
            (ATTITUDE, self.noise.rates_radps * dt_s),
            (ACCELERATION_BIAS, self.noise.acceleration_bias_walk * dt_s.sqrt()),
            (RATES_BIAS, self.noise.rates_bias_walk * dt_s.sqrt()),
        ] {
            let deviation = deviation * steps;
            for i in from..from + 3 {
                covariance[(i, i)] += deviation * deviation;
            }
        }
        for (i, wander) in (DRIFT..).zip(self.noise.wandering()) {
            let (left, new) = wander.step(dt_s * samples);
            covariance.row_mut(i).scale_mut(left);
            covariance.column_mut(i).scale_mut(left);
            covariance[(i, i)] += new;
        }
        covariance
    }

    /// Fuses a position, NED \[m\].
    pub fn fuse_position(&mut self, position_m: Vector3<f64>) {
        let off = |state: &State| position_m - state.position_m - state.drift_m;
        let ExpectedNoise { antenna_m, clock_s, .. } = self.noise;
        let turned_m = antenna_m * (self.pace[0] * LASTS_S).min(1.0);
        let late_m = hypot(turned_m, clock_s * self.state.velocity_mps.norm());
        let noise = self.noise.position_m.map(|white| hypot(white, late_m));
        self.fuse(Source::Position, &direct(Source::Position, off(&self.state).xy(), 1.0, noise.xy()));
        self.fuse(Source::Depth, &direct(Source::Depth, scalar(off(&self.state).z), 1.0, scalar(noise.z)));
    }

    /// Fuses a velocity, NED \[m/s\].
    pub fn fuse_velocity(&mut self, velocity_mps: Vector3<f64>) {
        self.yaw.fix(&velocity_mps.xy());
        let off = |state: &State| velocity_mps - state.velocity_mps;
        let ExpectedNoise { antenna_m, clock_s, .. } = self.noise;
        let late_mps = hypot(antenna_m * self.pace[0], clock_s * self.pace[1]);
        let noise = self.noise.velocity_mps.map(|white| hypot(white, late_mps));
        self.check_heading(&velocity_mps.xy());
        self.fuse(Source::Velocity, &direct(Source::Velocity, off(&self.state).xy(), 0.0, noise.xy()));
        self.fuse(Source::Sink, &direct(Source::Sink, scalar(off(&self.state).z), 0.0, scalar(noise.z)));
    }

    /// Fuses a height above the origin \[m\].
    pub fn fuse_height(&mut self, height_m: f64) {
        let innovation = self.state.barometer_bias_m - height_m - self.state.position_m.z;
        let fast_m = self.noise.wind_pressure * self.state.velocity_mps.norm_squared() / (2.0 * self.g_mps2);
        let noise = scalar(hypot(self.noise.height_m, fast_m));
        self.fuse(Source::Height, &direct(Source::Height, scalar(innovation), -1.0, noise));
    }

    /// Fuses the heading of a magnetic `field`, body, as shares of its strength; does nothing if the field is vertical
    /// or the heading is unknown.
    pub fn fuse_field(&mut self, field: &Vector3<f64>) {
        if self.heading_error().1 < UNKNOWN_RAD * UNKNOWN_RAD
            && let Some(measured) = self.heading(field)
        {
            self.fuse(Source::Heading, &measured);
        }
    }

    /// Fuses the velocity over the ground ahead and to the right, body \[m/s\].
    pub fn fuse_flow(&mut self, velocity_mps: &Vector2<f64>) {
        self.fuse(Source::Flow, &self.flow(velocity_mps));
    }

    /// Measurement of the heading by a `field` less the vehicle's own field, levelled by the estimated attitude; `None`
    /// if the field is vertical. An error of the tilt turns the level field by the ratio of its vertical to its
    /// horizontal part.
    ///
    /// The Jacobian is that of the field of the map and not of the measured field. The noise of the measured field
    /// would be in both Jacobian and innovation, which would tilt the estimate by degrees in minutes, always in the
    /// same direction. This noise would also change the Jacobian from sample to sample, as if the vehicle's own field
    /// could be told from a wrong heading.
    pub(crate) fn heading(&self, field: &Vector3<f64>) -> Option<Measured<1>> {
        let level = self.state.attitude * (field - self.state.hard_iron);
        let horizontal = hypot(level.x, level.y);
        if horizontal < MIN_HORIZONTAL || libm::cos(self.noise.inclination_rad) < MIN_HORIZONTAL {
            return None;
        }
        let axes = *self.state.attitude.to_rotation_matrix().matrix();
        let (declination_rad, inclination_rad) = (self.state.declination_rad, self.noise.inclination_rad);
        let north = Vector2::new(libm::cos(declination_rad), libm::sin(declination_rad));
        let along = north / libm::cos(inclination_rad);
        let dip = north * libm::tan(inclination_rad);
        let mut jacobian = SMatrix::<f64, 1, ERRORS>::zeros();
        jacobian.fixed_columns_mut::<3>(ATTITUDE).copy_from(&(RowVector3::new(-dip.x, -dip.y, 1.0) * axes));
        jacobian.fixed_columns_mut::<3>(HARD_IRON).copy_from(&(RowVector3::new(along.y, -along.x, 0.0) * axes));
        jacobian[DECLINATION] = -1.0;
        let deviation = self.noise.field / libm::cos(inclination_rad);
        Some(Measured {
            innovation: scalar(wrapped(declination_rad - libm::atan2(level.y, level.x))),
            jacobian,
            variance: scalar(deviation * deviation),
        })
    }

    /// Measurement of the velocity over the ground.
    pub(crate) fn flow(&self, velocity_mps: &Vector2<f64>) -> Measured<2> {
        let back = self.state.attitude.inverse();
        let body = back * self.state.velocity_mps;
        let mut jacobian = SMatrix::<f64, 2, ERRORS>::zeros();
        jacobian.fixed_columns_mut::<3>(VELOCITY).copy_from(&back.to_rotation_matrix().matrix().fixed_rows::<2>(0));
        jacobian.fixed_columns_mut::<3>(ATTITUDE).copy_from(&body.cross_matrix().fixed_rows::<2>(0));
        let variance = SVector::from([self.noise.flow_mps * self.noise.flow_mps; 2]);
        Measured { innovation: velocity_mps - body.xy(), jacobian, variance }
    }

    fn fuse<const N: usize>(&mut self, source: Source, measured: &Measured<N>) {
        let Measured { innovation, jacobian, variance } = measured;
        let noise = SMatrix::from_diagonal(variance);
        let spread = |covariance: &Covariance| {
            let seen = jacobian * covariance;
            (seen * jacobian.transpose() + noise).cholesky().map(|expected| (seen, expected))
        };
        let Some((mut seen, mut expected)) = spread(&self.covariance) else { return };
        let nis = innovation.dot(&expected.solve(innovation));
        let record = &mut self.records[source as usize];
        record.nis = nis;
        if nis > source.gate() {
            if record.spell == 0.0 {
                record.outage_s = record.silent_s;
            }
            record.spell += 1.0;
            if record.disputed_s() < RESET_AFTER_S || self.is_outvoted(source) {
                self.records[source as usize].refused += 1.0;
                return;
            }
            self.records[source as usize].resets += 1.0;
            self.open(source, innovation, jacobian);
            let Some(opened) = spread(&self.covariance) else { return };
            (seen, expected) = opened;
        }
        let record = &mut self.records[source as usize];
        record.accepted += 1.0;
        (record.silent_s, record.spell) = (0.0, 0.0);
        let mut gain = expected.solve(&seen).transpose();
        let (down, variance) = self.heading_error();
        if variance > UNKNOWN_RAD * UNKNOWN_RAD {
            // Far from the truth a Jacobian could turn the heading anywhere. The heading stays, as an error that is
            // considered but not estimated, and so do the vehicle's own field and the declination.
            let along = down.transpose() * gain.fixed_rows::<3>(ATTITUDE);
            let mut rows = gain.fixed_rows_mut::<3>(ATTITUDE);
            rows -= down * along;
            gain.fixed_rows_mut::<{ ERRORS - HARD_IRON }>(HARD_IRON).fill(0.0);
        }
        let kept = self.covariance - gain * seen; // (I - K H) P
        self.covariance = kept - kept * jacobian.transpose() * gain.transpose() + gain * noise * gain.transpose();
        self.inject(&(gain * innovation));
    }

    /// Turns the attitude about the vertical to the heading that the receiver's `velocity_mps` shows, if the heading is
    /// unknown, or if it is wrong and velocities are refused for good. The variance of the velocity then grows by its
    /// squared innovation.
    fn check_heading(&mut self, velocity_mps: &Vector2<f64>) {
        let Some((angle, deviation)) = self.yaw.turn(self.noise.velocity_mps.x) else { return };
        let (down, variance) = self.heading_error();
        let is_wrong =
            angle.abs() > WRONG_RAD.max(3.0 * deviation) && self.record(Source::Velocity).disputed_s() >= RESET_AFTER_S;
        if !is_wrong && variance < UNKNOWN_RAD * UNKNOWN_RAD {
            return;
        }
        self.state.attitude = turn(Vector3::z() * angle) * self.state.attitude;
        let along = self.covariance.fixed_columns::<3>(ATTITUDE) * down / variance.max(f64::MIN_POSITIVE);
        self.covariance += along * along.transpose() * (deviation * deviation - variance);
        let off = velocity_mps - self.state.velocity_mps.xy();
        (0..2).for_each(|i| self.covariance[(VELOCITY + i, VELOCITY + i)] += off[i] * off[i]);
        self.records[Source::Velocity as usize].resets += 1.0;
        self.yaw.forget();
    }

    /// Vertical in body axes, and the variance of the heading about it \[rad2\].
    fn heading_error(&self) -> (Vector3<f64>, f64) {
        let down = self.state.attitude.inverse() * Vector3::z();
        (down, down.dot(&(self.covariance.fixed_view::<3, 3>(ATTITUDE, ATTITUDE) * down)))
    }

    /// Returns whether a `source` without an error of its own disagrees with other sources that are still accepted.
    fn is_outvoted(&self, source: Source) -> bool {
        let agrees =
            |fellow: &Source| self.record(*fellow).accepted > 0.0 && self.record(*fellow).silent_s < TOGETHER_S;
        source.states().1.is_none() && source.fellows().iter().any(agrees)
    }

    /// Enlarges the covariance after `source` has disagreed for good: of its own error, or of the motion that it
    /// measures if the source was silent before, has no error of its own, or does not disagree alone.
    fn open<const N: usize>(
        &mut self,
        source: Source,
        innovation: &SVector<f64, N>,
        jacobian: &SMatrix<f64, N, ERRORS>,
    ) {
        let (motion, own) = source.states();
        let was_silent = self.record(source).outage_s > RESET_AFTER_S;
        let is_alone = source.fellows().iter().all(|fellow| self.record(*fellow).disputed_s() < TOGETHER_S);
        let opened = own.filter(|_| is_alone && !was_silent).unwrap_or(motion);
        let mut rows = SMatrix::<f64, N, ERRORS>::zeros();
        let states = if source == Source::Flow || source == Source::Heading { 3 } else { N };
        rows.columns_mut(opened, states).copy_from(&jacobian.columns(opened, states));
        let Some(gram) = (rows * rows.transpose()).cholesky() else { return };
        let rows = gram.solve(&rows); // the shortest error that explains an innovation of 1
        let surprise = SMatrix::from_diagonal(&innovation.component_mul(innovation));
        self.covariance += rows.transpose() * surprise * rows;
        if matches!(source, Source::Velocity | Source::Flow) && !was_silent {
            // While the sensor of the velocity works, the velocity becomes wrong only by gravity under a wrong
            // attitude.
            let turned = innovation.norm() / (self.g_mps2 * RESET_AFTER_S);
            (ATTITUDE..ATTITUDE + 3).for_each(|i| self.covariance[(i, i)] += turned * turned);
        }
    }

    /// Adds an `error` to the state, and turns the covariance into the axes of the new attitude.
    fn inject(&mut self, error: &StateError) {
        let turn = error.fixed_rows::<3>(ATTITUDE).into_owned();
        let reset = Matrix3::identity() - (turn / 2.0).cross_matrix();
        let rows = reset * self.covariance.fixed_rows::<3>(ATTITUDE);
        self.covariance.fixed_rows_mut::<3>(ATTITUDE).copy_from(&rows);
        let columns = self.covariance.fixed_columns::<3>(ATTITUDE) * reset.transpose();
        self.covariance.fixed_columns_mut::<3>(ATTITUDE).copy_from(&columns);
        self.state = self.state.plus(error);
    }

    /// Makes the covariance exactly symmetric, because a memory stores only one of two mirrored elements.
    pub(crate) fn symmetrise(&mut self) {
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
    }

    /// Passes the memory to `visit`, as [`Navigation::visit`](crate::Navigation::visit).
    pub(crate) fn visit(&mut self, visit: Visit) {
        plain(&mut self.state, visit);
        plain(&mut self.pace, visit);
        plain(&mut self.yaw, visit);
        for i in 0..ERRORS {
            for j in 0..=i {
                plain(&mut self.covariance[(i, j)], visit);
                self.covariance[(j, i)] = self.covariance[(i, j)];
            }
        }
        plain(&mut self.records, visit);
    }
}

/// Wraps `angle` to between -pi and pi \[rad\].
fn wrapped(angle: f64) -> f64 {
    libm::atan2(libm::sin(angle), libm::cos(angle))
}
