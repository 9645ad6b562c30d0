//! Sources of measurements: gates, records, and measurements of the motion itself.

use bytemuck::{Pod, Zeroable};
use nalgebra::{SMatrix, SVector};

use crate::state::{ATTITUDE, BAROMETER_BIAS, DRIFT, ERRORS, HARD_IRON, POSITION, VELOCITY};

/// Source of measurements, with a gate of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Position of the satellite receiver, north and east.
    Position,
    /// Position of the satellite receiver, down.
    Depth,
    /// Velocity of the satellite receiver, north and east.
    Velocity,
    /// Velocity of the satellite receiver, down.
    Sink,
    /// Barometer.
    Height,
    /// Magnetometer.
    Heading,
    /// Velocity over the ground.
    Flow,
}

impl Source {
    /// All sources.
    pub const ALL: [Self; SOURCES] =
        [Self::Position, Self::Depth, Self::Velocity, Self::Sink, Self::Height, Self::Heading, Self::Flow];

    /// Number of components of a measurement.
    pub const fn components(self) -> usize {
        match self {
            Self::Depth | Self::Sink | Self::Height | Self::Heading => 1,
            Self::Position | Self::Velocity | Self::Flow => 2,
        }
    }

    /// Squared normalised innovation above which a measurement is refused: the chi-square quantile of 0.999 for the
    /// number of its components.
    pub const fn gate(self) -> f64 {
        if self.components() == 1 { 10.828 } else { 13.816 }
    }

    /// Other sources that the same motion affects.
    pub(crate) const fn fellows(self) -> &'static [Self] {
        match self {
            Self::Position | Self::Heading => &[Self::Velocity, Self::Flow],
            Self::Depth => &[Self::Sink, Self::Height],
            Self::Height => &[Self::Sink, Self::Depth],
            Self::Velocity => &[Self::Position, Self::Flow],
            Self::Sink => &[Self::Depth, Self::Height],
            Self::Flow => &[Self::Position, Self::Velocity],
        }
    }

    /// First error state of the measured motion, and of the sensor's own error; `None` if the filter does not estimate
    /// it.
    pub(crate) const fn states(self) -> (usize, Option<usize>) {
        match self {
            Self::Position => (POSITION, Some(DRIFT)),
            Self::Depth => (POSITION + 2, Some(DRIFT + 2)),
            Self::Height => (POSITION + 2, Some(BAROMETER_BIAS)),
            Self::Velocity | Self::Flow => (VELOCITY, None),
            Self::Sink => (VELOCITY + 2, None),
            Self::Heading => (ATTITUDE, Some(HARD_IRON)),
        }
    }
}

/// Number of sources.
pub const SOURCES: usize = 7;

/// Record of one source.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct SourceRecord {
    /// Number of measurements that were fused, also by a reset.
    pub accepted: f64,
    /// Number of measurements that the gate refused.
    pub refused: f64,
    /// Number of resets.
    pub resets: f64,
    /// Time since the last accepted measurement \[s\].
    pub silent_s: f64,
    /// Number of measurements refused since the last accepted one.
    pub spell: f64,
    /// Time from the last accepted measurement to the first refusal after it \[s\].
    pub outage_s: f64,
    /// Squared normalised innovation of the last measurement.
    pub nis: f64,
}

impl SourceRecord {
    /// Time for which every measurement was refused \[s\]; 0 if the last one was accepted.
    pub(crate) fn disputed_s(&self) -> f64 {
        if self.spell > 0.0 { self.silent_s - self.outage_s } else { 0.0 }
    }
}

/// Measurement: its innovation, the Jacobian by the error state, and the variance of its noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured<const N: usize> {
    pub innovation: SVector<f64, N>,
    pub jacobian: SMatrix<f64, N, ERRORS>,
    pub variance: SVector<f64, N>,
}

/// Measurement by a `source`, with the Jacobian 1 for the motion and `own` for the sensor's own error.
pub(crate) fn direct<const N: usize>(
    source: Source,
    innovation: SVector<f64, N>,
    own: f64,
    deviation: SVector<f64, N>,
) -> Measured<N> {
    let mut jacobian = SMatrix::<f64, N, ERRORS>::zeros();
    let (motion, error) = source.states();
    jacobian.fixed_columns_mut::<N>(motion).copy_from(&SMatrix::identity());
    if let Some(error) = error {
        jacobian.fixed_columns_mut::<N>(error).copy_from(&(SMatrix::identity() * own));
    }
    Measured { innovation, jacobian, variance: deviation.component_mul(&deviation) }
}

pub(crate) fn scalar(value: f64) -> SVector<f64, 1> {
    SVector::from([value])
}
