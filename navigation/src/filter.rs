//! Error-state Kalman filter: covariance, measurements, gates and resets.
//!
//! ```text
//! P  = F P F' + Q                              Sola, arXiv 1711.02508, section 5.4, eqs. 266 to 270
//! S  = H P H' + V,   K = P H' / S              section 6, eqs. 273 to 276
//! P  = (I - K H) P (I - K H)' + K V K'         Joseph's form: symmetric, and positive after rounding too
//! x  = x + K y,   P = G P G'                   eqs. 282 to 287, with G = I - [K y / 2]x for the attitude: the error is
//!                                              that of the new attitude
//! ```
//!
//! A measurement is refused if its normalised innovation `y' / S y` is above the chi-square quantile of 0.999. A source
//! of which nothing was accepted for `RESET_AFTER_S` is right, and the state wrong: the covariance grows by the
//! innovation (`H' y^2 H`), so that the state moves to the measurement. Resets are counted.

use nalgebra::{Matrix3, RowVector3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};

use crate::state::{
    ACCELERATION_BIAS, ATTITUDE, Covariance, ERRORS, Error, Imu, POSITION, RATES_BIAS, State, VELOCITY,
};

/// Time without an accepted measurement of a source after which its next one resets the state \[s\].
const RESET_AFTER_S: f64 = 2.0;
/// Smallest horizontal share of the magnetic field that tells a heading.
pub(crate) const MIN_HORIZONTAL: f64 = 0.1;

/// Source of measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Position of the satellite receiver.
    Position,
    /// Velocity of the satellite receiver.
    Velocity,
    /// Barometer.
    Height,
    /// Magnetometer.
    Heading,
    /// Velocity over the ground.
    Flow,
}

impl Source {
    /// All sources.
    pub const ALL: [Self; SOURCES] = [Self::Position, Self::Velocity, Self::Height, Self::Heading, Self::Flow];

    /// Normalised innovation squared above which a measurement is refused: the chi-square quantile of 0.999 for the
    /// number of its components.
    pub const fn gate(self) -> f64 {
        match self {
            Self::Height | Self::Heading => 10.828,
            Self::Flow => 13.816,
            Self::Position | Self::Velocity => 16.266,
        }
    }
}

/// Number of sources.
pub const SOURCES: usize = 5;

/// Standard deviations of the errors that the filter expects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Specific force of one sample \[m/s2\].
    pub specific_force_mps2: f64,
    /// Body rates of one sample \[rad/s\].
    pub rates_radps: f64,
    /// Random walk of the accelerometer's bias \[m/s2 / sqrt(s)\].
    pub acceleration_bias_walk: f64,
    /// Random walk of the gyros' bias \[rad/s / sqrt(s)\].
    pub rates_bias_walk: f64,
    /// Position of the satellite receiver, NED \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity of the satellite receiver, NED \[m/s\].
    pub velocity_mps: Vector3<f64>,
    /// Barometer \[m\].
    pub height_m: f64,
    /// Magnetometer, as a share of the field.
    pub field: f64,
    /// Velocity over the ground \[m/s\].
    pub flow_mps: f64,
}

/// Record of one source.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Record {
    /// Measurements that were fused, those of a reset too.
    pub accepted: f64,
    /// Measurements that the gate refused.
    pub refused: f64,
    /// Resets.
    pub resets: f64,
    /// Time since the last accepted measurement \[s\].
    pub silent_s: f64,
    /// Normalised innovation squared of the last measurement.
    pub nis: f64,
}

/// Error-state Kalman filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    /// Estimate.
    pub state: State,
    /// Covariance of its error.
    pub covariance: Covariance,
    noise: Noise,
    g_mps2: f64,
    records: [Record; SOURCES],
}

impl Filter {
    /// Builds a filter that starts at `state` with an error of `covariance`.
    pub fn new(state: State, covariance: Covariance, noise: Noise, g_mps2: f64) -> Self {
        Self { state, covariance, noise, g_mps2, records: [Record::default(); SOURCES] }
    }

    /// Gravity \[m/s2\].
    pub fn g_mps2(&self) -> f64 {
        self.g_mps2
    }

    /// Returns the record of `source`.
    pub fn record(&self, source: Source) -> Record {
        self.records[source as usize]
    }

    /// Moves over a sample of the IMU.
    pub fn predict(&mut self, imu: &Imu, dt_s: f64) {
        self.covariance = self.covariance_after(imu, dt_s, 1.0);
        self.symmetrise();
        self.state = self.state.moved(imu, dt_s, self.g_mps2);
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
        covariance
    }

    /// Fuses a position, NED \[m\].
    pub fn fuse_position(&mut self, position_m: Vector3<f64>) {
        let noise = self.noise.position_m;
        self.fuse(Source::Position, &direct(position_m - self.state.position_m, POSITION, noise));
    }

    /// Fuses a velocity, NED \[m/s\].
    pub fn fuse_velocity(&mut self, velocity_mps: Vector3<f64>) {
        let noise = self.noise.velocity_mps;
        self.fuse(Source::Velocity, &direct(velocity_mps - self.state.velocity_mps, VELOCITY, noise));
    }

    /// Fuses a height above the origin \[m\].
    pub fn fuse_height(&mut self, height_m: f64) {
        let innovation = SVector::from([-height_m - self.state.position_m.z]);
        self.fuse(Source::Height, &direct(innovation, POSITION + 2, SVector::from([self.noise.height_m])));
    }

    /// Fuses the heading of a magnetic `field`, body, as shares of its strength; none if the field is vertical.
    pub fn fuse_field(&mut self, field: &Vector3<f64>) {
        if let Some(measured) = self.heading(field) {
            self.fuse(Source::Heading, &measured);
        }
    }

    /// Fuses the velocity over the ground ahead and to the right, body \[m/s\].
    pub fn fuse_flow(&mut self, velocity_mps: &Vector2<f64>) {
        self.fuse(Source::Flow, &self.flow(velocity_mps));
    }

    /// Measurement of the heading by a `field`, levelled by the estimated attitude. An error of the tilt turns the
    /// level field by its vertical part over its horizontal one.
    pub(crate) fn heading(&self, field: &Vector3<f64>) -> Option<Measured<1>> {
        let level = self.state.attitude * field;
        let horizontal = libm::hypot(level.x, level.y);
        if horizontal < MIN_HORIZONTAL {
            return None;
        }
        let axes = *self.state.attitude.to_rotation_matrix().matrix();
        let dip = level.xy() * (level.z / (horizontal * horizontal));
        let mut jacobian = SMatrix::<f64, 1, ERRORS>::zeros();
        jacobian.fixed_columns_mut::<3>(ATTITUDE).copy_from(&(RowVector3::new(-dip.x, -dip.y, 1.0) * axes));
        let deviation = self.noise.field / horizontal;
        Some(Measured {
            innovation: SVector::from([-libm::atan2(level.y, level.x)]),
            jacobian,
            variance: SVector::from([deviation * deviation]),
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
        let spread = |covariance: &Covariance| (jacobian * covariance * jacobian.transpose() + noise).cholesky();
        let Some(expected) = spread(&self.covariance) else { return };
        let record = &mut self.records[source as usize];
        record.nis = innovation.dot(&expected.solve(innovation));
        if record.nis > source.gate() {
            if record.silent_s < RESET_AFTER_S {
                record.refused += 1.0;
                return;
            }
            record.resets += 1.0;
            let surprise = SMatrix::from_diagonal(&innovation.component_mul(innovation));
            self.covariance += jacobian.transpose() * surprise * jacobian;
        }
        record.accepted += 1.0;
        record.silent_s = 0.0;
        let Some(expected) = spread(&self.covariance) else { return };
        let gain = expected.solve(&(jacobian * self.covariance)).transpose();
        let kept = Covariance::identity() - gain * jacobian;
        self.covariance = kept * self.covariance * kept.transpose() + gain * noise * gain.transpose();
        self.inject(&(gain * innovation));
    }

    /// Adds an `error` to the state, and turns the covariance into the axes of the new attitude.
    fn inject(&mut self, error: &Error) {
        let turn = error.fixed_rows::<3>(ATTITUDE).into_owned();
        let reset = Matrix3::identity() - (turn / 2.0).cross_matrix();
        let rows = reset * self.covariance.fixed_rows::<3>(ATTITUDE);
        self.covariance.fixed_rows_mut::<3>(ATTITUDE).copy_from(&rows);
        let columns = self.covariance.fixed_columns::<3>(ATTITUDE) * reset.transpose();
        self.covariance.fixed_columns_mut::<3>(ATTITUDE).copy_from(&columns);
        self.symmetrise();
        self.state = self.state.plus(error);
    }

    /// Removes what rounding has added between an element and its mirror image.
    fn symmetrise(&mut self) {
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
    }

    /// Passes every number of the memory to `visit`, to be read or written.
    pub fn visit(&mut self, visit: &mut impl FnMut(&mut f64)) {
        self.state.visit(visit);
        for i in 0..ERRORS {
            for j in 0..=i {
                visit(&mut self.covariance[(i, j)]);
                self.covariance[(j, i)] = self.covariance[(i, j)];
            }
        }
        for Record { accepted, refused, resets, silent_s, nis } in &mut self.records {
            [accepted, refused, resets, silent_s, nis].into_iter().for_each(&mut *visit);
        }
    }
}

/// Covariance at the start: `deviations` of position, velocity, tilt, heading, and of the biases of accelerometer and
/// gyros, about an `attitude`.
pub fn initial_covariance(attitude: &UnitQuaternion<f64>, deviations: &[f64; 6]) -> Covariance {
    let [position, velocity, tilt, heading, acceleration_bias, rates_bias] =
        deviations.map(|deviation| deviation * deviation);
    let axes = *attitude.to_rotation_matrix().matrix();
    let level = Matrix3::from_diagonal(&Vector3::new(tilt, tilt, heading));
    let mut covariance = Covariance::zeros();
    for (from, block) in [
        (POSITION, Matrix3::from_diagonal_element(position)),
        (VELOCITY, Matrix3::from_diagonal_element(velocity)),
        (ATTITUDE, axes.transpose() * level * axes),
        (ACCELERATION_BIAS, Matrix3::from_diagonal_element(acceleration_bias)),
        (RATES_BIAS, Matrix3::from_diagonal_element(rates_bias)),
    ] {
        covariance.fixed_view_mut::<3, 3>(from, from).copy_from(&block);
    }
    covariance
}

/// Measurement by its innovation, its Jacobian by the error, and the variance of its noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured<const N: usize> {
    pub innovation: SVector<f64, N>,
    pub jacobian: SMatrix<f64, N, ERRORS>,
    pub variance: SVector<f64, N>,
}

/// Measurement of the error states from `from` on.
fn direct<const N: usize>(innovation: SVector<f64, N>, from: usize, deviation: SVector<f64, N>) -> Measured<N> {
    let mut jacobian = SMatrix::<f64, N, ERRORS>::zeros();
    jacobian.fixed_columns_mut::<N>(from).copy_from(&SMatrix::identity());
    Measured { innovation, jacobian, variance: deviation.component_mul(&deviation) }
}
