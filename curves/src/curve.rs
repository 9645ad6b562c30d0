//! Curve of any kind, stretched in time.

use nalgebra::Vector3;

use crate::descent::Descent;
use crate::figure::Figure;
use crate::legs::Legs;
use crate::setpoint::Setpoint;
use crate::through::Through;

/// Number of intervals into which a leg is divided for checks.
pub const SAMPLES: u32 = 100;
/// Number of laps that are sampled at the beginning of a figure, and again at its end. The laps between are like the
/// second lap.
const SAMPLED_LAPS: f64 = 2.0;

/// Kind of a curve.
#[derive(Debug, Clone)]
pub enum CurveShape {
    /// Rest at a place for a time \[s\].
    Rest(Vector3<f64>, f64),
    /// Straight legs.
    Legs(Legs),
    /// Curve through waypoints.
    Through(Through),
    /// Circle, helix or figure eight.
    Figure(Figure),
    /// Landing.
    Descent(Descent),
}

/// Curve, `stretch` times as slow as its shape.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Shape, with its own times.
    pub shape: CurveShape,
    /// Ratio of the curve's times to the times of the shape.
    pub stretch: f64,
}

/// Velocity and acceleration at equal intervals of a leg.
#[derive(Debug, Clone)]
pub struct Leg {
    /// Interval \[s\].
    pub interval_s: f64,
    /// Velocity \[m/s\] and acceleration \[m/s2\] at each instant, both ends included.
    pub samples: Vec<[Vector3<f64>; 2]>,
    /// Lowest and highest coordinates of the position, north, east, down \[m\].
    pub range_m: [Vector3<f64>; 2],
}

impl Leg {
    /// Duration \[s\].
    pub fn duration_s(&self) -> f64 {
        self.interval_s * (self.samples.len() - 1) as f64
    }
}

impl From<CurveShape> for Curve {
    fn from(shape: CurveShape) -> Self {
        Self { shape, stretch: 1.0 }
    }
}

impl Curve {
    /// Duration \[s\].
    pub fn duration_s(&self) -> f64 {
        self.times_s().last().copied().unwrap_or(0.0)
    }

    /// Times at which legs begin and end \[s\]; the whole of a figure is one leg.
    pub fn times_s(&self) -> Vec<f64> {
        let times = match &self.shape {
            CurveShape::Rest(_, duration_s) => vec![0.0, *duration_s],
            CurveShape::Legs(legs) => legs.waypoints.iter().map(|(at_s, _)| *at_s).collect(),
            CurveShape::Through(curve) => curve.times_s().collect(),
            CurveShape::Figure(figure) => vec![0.0, figure.laps.turning_s],
            CurveShape::Descent(descent) => descent.times_s().to_vec(),
        };
        times.into_iter().map(|t_s| t_s * self.stretch).collect()
    }

    /// Reference at `t_s`; at rest at the first point before the beginning, and at the last point after the end.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let k = self.stretch;
        let t_s = t_s / k;
        let Setpoint { position_m, velocity_mps, acceleration_mps2 } = match &self.shape {
            CurveShape::Rest(at, _) => Setpoint::at_rest((*at).into()),
            CurveShape::Legs(legs) => legs.at(t_s),
            CurveShape::Through(curve) => curve.at(t_s),
            CurveShape::Figure(figure) => figure.at(t_s),
            CurveShape::Descent(descent) => descent.at(t_s),
        };
        Setpoint {
            position_m,
            velocity_mps: velocity_mps.map(|v| v / k),
            acceleration_mps2: acceleration_mps2.map(|a| a / (k * k)),
        }
    }

    /// Divides each leg into `intervals`. Of a figure of many laps only the first and the last laps are sampled.
    pub fn legs(&self, intervals: u32) -> Vec<Leg> {
        let times_s = match &self.shape {
            CurveShape::Figure(Figure { laps, .. }) => {
                let (all, some) = (laps.laps, laps.laps.min(2.0 * SAMPLED_LAPS));
                let lap = |i: u32| if f64::from(i) <= SAMPLED_LAPS { f64::from(i) } else { all - some + f64::from(i) };
                (0..=some as u32).map(|i| lap(i) * laps.turning_s / all * self.stretch).collect()
            }
            _ => self.times_s(),
        };
        times_s.windows(2).map(|ends| self.leg(ends[0], ends[1], intervals)).collect()
    }

    /// Lowest and highest coordinates of the position, north, east, down \[m\].
    pub fn range_m(&self) -> [Vector3<f64>; 2] {
        let legs = self.legs(SAMPLES).into_iter().map(|leg| leg.range_m);
        let both = |one: [Vector3<f64>; 2], other: [Vector3<f64>; 2]| [one[0].inf(&other[0]), one[1].sup(&other[1])];
        legs.reduce(both).unwrap_or([self.at(0.0).position_m.into(); 2])
    }

    fn leg(&self, from_s: f64, until_s: f64, intervals: u32) -> Leg {
        let interval_s = (until_s - from_s) / f64::from(intervals);
        let (mut samples, mut range_m) = (vec![], [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)]);
        for i in 0..=intervals {
            let Setpoint { position_m, velocity_mps, acceleration_mps2 } = self.at(from_s + interval_s * f64::from(i));
            let position = Vector3::from(position_m);
            range_m = [range_m[0].inf(&position), range_m[1].sup(&position)];
            samples.push([velocity_mps.into(), acceleration_mps2.into()]);
        }
        Leg { interval_s, samples, range_m }
    }
}
